"""What ``cvtimg restore`` does when it runs: versions are read, restored, and written as one image, stack or sheet."""

import math
import os
import re
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cvtimg import quantize_frames, write_image
from cvtimg._shared.pixels import not_black, peak, white_of
from cvtimg._shared.types import Array, Bools, Floats
from cvtimg.batch.tasks import InputsFailedError, Missing
from cvtimg.cli.running import Given, Row, Stopwatch, Task, plot
from cvtimg.pictures import image_info, is_animated, read_frames, read_pages, read_scale, write_frames, write_pages
from cvtimg.pictures.formats.animated import FRAME_WRITERS
from cvtimg.pictures.formats.converted import RAW_SUFFIXES
from cvtimg.pictures.formats.encoding import as_stored
from cvtimg.pictures.pages import PAGE_SUFFIXES, Pages
from cvtimg.restoration import Denoised, restore_versions
from cvtimg.restoration.defects import without_defects
from cvtimg.restoration.versions import stack_versions


class VersionFiles(NamedTuple):
    """Versions of one image and masks as read, and the names of their files."""

    images: list[Array]
    masks: list[Bools] | None
    names: list[str]
    mask_names: list[str]
    alpha: bool | None  # False: no version has any


def _read(sources: Sequence[Path], masks: Sequence[Path], merge: str | None) -> tuple[list[VersionFiles], Pages]:
    """Read the versions of each page of the result, and masks; report all that cannot be read."""
    failed: Missing = []

    def read(paths: Sequence[Path]) -> Iterator[tuple[Path, Pages]]:
        for path in paths:
            try:
                frames = read_frames(path).images if is_animated(path) else ()
                yield path, Pages(frames, "T", (len(frames),)) if frames else read_pages(path)
            except OSError as error:
                failed.append((str(path), error))

    images, known = [*read(sources)], [*read(masks)]
    if failed:
        raise InputsFailedError(failed)
    mask_names, shown = _named([(path, pages.images) for path, pages in known])
    alpha = None if any(image_info(path).has_alpha for path in sources) else False
    for path, pages in images:
        if merge and merge not in pages.axes:
            raise ValueError(f"{path} has the axes {pages.axes}YX, without {merge} to --merge; --axes names them")
    stacks = [(path, *pages.joined().grouped(f"Q{merge or ''}")) for path, pages in images]
    first, stack, groups = stacks[0]
    for path, other, groups_of_file in stacks:
        if len(groups_of_file) != len(groups):
            raise ValueError(f"{path} has {other}, and {first} has {stack}; they must have as many pages")
    versions = []
    for number in range(len(groups)):
        names, each = _named([(path, groups_of_file[number]) for path, _, groups_of_file in stacks])
        versions.append(VersionFiles(each, [not_black(mask) for mask in shown] or None, names, mask_names, alpha))
    return versions, stack


def _named(files: Sequence[tuple[Path, Sequence[Array]]]) -> tuple[list[str], list[Array]]:
    names = []
    for path, pages in files:
        names += [str(path)] if len(pages) == 1 else [f"{path}: page {n + 1}" for n in range(len(pages))]
    return names, [page for _, pages in files for page in pages]


def restored_versions(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    """Restore the versions of a task, and write what its options name."""
    if given.space is None and all(path.suffix.lower() in RAW_SUFFIXES for path in task.sources):
        given = copy(given)
        given.space = "linear"  # in which a sensor is equally noisy, or as light is
    versions, stack = _read(task.sources, given.mask or [], given.merge)
    if len(versions) > 1:
        _check_room(task, len(versions))
    stopwatch.lap("read")
    results, notes = _restored_all(versions, given)
    stopwatch.lap("cluster")
    counts = Counter(os.path.realpath(path) for path in given.versions)
    twice = [path for path in given.versions if counts[os.path.realpath(path)] > 1]
    notes += [f"{path} is given more than once and counts once" for path in twice]
    notes += _write(task, results, versions[0], stack, given)
    stopwatch.lap("write")
    warning = {"warning": "; ".join(dict.fromkeys(notes))} if notes else {}
    return {**_summary(versions, results), **warning}


def _restored_all(versions: Sequence[VersionFiles], given: Given) -> tuple[list[Denoised], list[str]]:
    """Restore each page; also return what is to be said of them."""
    results, notes = [], []
    # Unless something asks for segments, the picture decides.
    must_be_flat = given.channels or given.labels or given.number != "auto" or given.edge_weight != "auto"
    flat = True if must_be_flat else False if given.detail else None
    how = given.arguments | {"align": given.motion if given.align else False, "flat": flat}
    for read in versions:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            try:
                results.append(restore_versions(read.images, read.names, masks=read.masks, alpha=read.alpha, **how))
            except ValueError as error:
                raise ValueError(_with_names(str(error), read)) from error
        notes += [given.worded(_with_names(str(warning.message), read)) for warning in caught]
    return results, notes + _doubts(results[0], given)


def _doubts(result: Denoised, given: Given) -> list[str]:
    """Say what was taken out of versions, and of a photograph that it was no drawing, its noise, and what is left."""
    unit, said = float(white_of(result.image.dtype)) / 255, []
    is_photograph = not hasattr(result, "labels")
    if is_photograph and not given.detail:
        said.append("no flat drawing, so detail is restored, as by --detail; -k N restores flat colors")
    if is_photograph and not result.noisy:
        written = ", ".join(f"{level / unit:.2f}" for level in result.noise if math.isfinite(level))
        said.append(f"no noise found: {written or 'too little is known'}; --noise S sets it, in levels of 8 bits")
    if result.impulses.any():
        said.append(f"{result.impulses.max():.1%} of the pixels are impulses and filled from around them")
    for what, level in zip(("rows", "columns"), result.stripes.max(axis=0) / unit, strict=True):
        said += [f"{what} differ by {level:.1f} levels of 8 bits, which is taken away"] if level else []
    if result.impulses.any() or result.stripes.any():
        said.append("--hidden none keeps all")
    if is_photograph:
        _, left = without_defects(stack_versions([result.image], alpha=False))
        kinds = zip(("rows", "columns"), left.stripes[0] / unit, strict=True)
        said += [f"{what} of the result differ by {level:.1f} levels of 8 bits" for what, level in kinds if level]
        said += [f"{share:.1%} of the pixels of the result are impulses" for share in left.impulses if share]
    return said


def _summary(versions: Sequence[VersionFiles], results: Sequence[Any]) -> Row:
    """Return what is known of the versions, and of the results or the first of them."""
    first = results[0]
    return {
        "inputs": [name for read in versions for name in read.names],
        "width": first.coverage.shape[1],
        "height": first.coverage.shape[0],
        "channels": first.image.shape[2] if first.image.ndim == 3 else 1,
        **({"pages": len(results)} if len(results) > 1 else {}),
        "versions": len(versions[0].images),
        "unknown": sum(float((result.coverage == 0).mean()) for result in results) / len(results),
        "left_out": sum(float((result.left_out > 0).mean()) for result in results) / len(results),
        "noise": [noise for result in results for noise in _finite(result.noise)],
        **({"impulses": first.impulses.tolist()} if first.impulses.any() else {}),
        **({"stripes": first.stripes.tolist()} if first.stripes.any() else {}),
        "weights": first.weights.tolist(),
        "shifts": first.shifts.tolist(),
        "transforms": first.transforms.tolist(),
        "motion": list(first.models),
        **({} if first.exposures is None else {"exposures": first.exposures.tolist()}),
        "misfits": _finite(first.misfits),
        **(_of_segments(results) if hasattr(first, "labels") else _noise_like(first)),
    }


def _of_segments(results: Sequence[Any]) -> dict[str, Any]:
    return {
        "k": max(len(result.colors) for result in results),
        "edge_weight": results[0].edge_weight,
        "energy": sum(result.energy for result in results),
        "n_iter": max(len(result.energies) - 1 for result in results),
        "converged": all(result.converged for result in results),
    }


def _finite(values: Floats) -> list[float | None]:
    """Return values for JSON, which has no others."""
    return [value if math.isfinite(value) else None for value in values.tolist()]


def _noise_like(result: Denoised) -> dict[str, Any]:
    """Say whether noise is white, or else its level in each band and how far neighbors share it; and how it grows."""
    grows = {} if result.noise_lines is None else {"noise_lines": result.noise_lines.tolist()}
    if result.noise_shared is None:
        return {"noise_like": "white", **grows}
    middle = len(result.noise_shared) // 2
    levels = np.sqrt(np.diag(result.noise_shared[middle, middle])).tolist()
    return {"noise_like": "shared", "noise_bands": levels, "noise_neighbors": result.noise_neighbors, **grows}


def _check_room(task: Task, n_pages: int) -> None:
    for option, path in task.outputs.items():
        pages = f"has {n_pages} pages to restore one by one"
        if option == "--sheet":
            raise ValueError(f"{pages}, and --sheet shows one; select it by --z or --t")
        if path.suffix.lower() not in (FRAME_WRITERS if option == "-o" and is_animated(task.source) else PAGE_SUFFIXES):
            way = f"name an output that can hold them, {option} FILE.tif"
            raise ValueError(f"{pages}: {way}; or --merge T or Z, if they are versions of one")


def _with_names(message: str, read: VersionFiles) -> str:
    """Replace names of arguments in a message by those of files."""
    message = message.replace("align=True", "--align")
    message = re.sub(r"images\[(\d+)\]", lambda match: read.names[int(match[1])], message)
    return re.sub(r"masks\[(\d+)\]", lambda match: read.mask_names[int(match[1])], message)


def _write(task: Task, results: Sequence[Any], read: VersionFiles, stack: Pages, given: Given) -> list[str]:
    outputs = task.outputs
    is_opaque = given.fill_transparent or outputs["-o"].suffix.lower() in (".jpg", ".jpeg")
    images = [result.image if is_opaque else result.with_alpha() for result in results]
    notes = _write_each(outputs["-o"], images, stack, task.source, given)
    if "--labels" in outputs:
        kind = np.uint8 if all(len(result.colors) < 256 for result in results) else np.uint16
        labels = [result.labels.astype(kind) for result in results]
        _write_each(outputs["--labels"], labels, stack, task.source, given)
    if "--sheet" in outputs:
        plot(outputs["--sheet"], given, "draw_sheet", _panels(results[0], read, given))
    return notes


def _write_each(path: Path, images: Sequence[Array], stack: Pages, source: Any, given: Given) -> list[str]:
    """Write an image, or the pages of a stack or animation; return what there is to say about it."""
    if path.suffix.lower() in PAGE_SUFFIXES and (len(images) > 1 or stack.is_joined):
        has_alpha = stack.has_alpha and images[0].shape == stack.images[0].shape
        write_pages(path, replace(stack, images=tuple(images), has_alpha=has_alpha), overwrite=given.overwrite)
    elif len(images) > 1:
        frames = replace(read_frames(source), images=tuple(images))
        if path.suffix.lower() == ".gif":
            quantize_frames(frames, 256).save(path, overwrite=given.overwrite)
        else:
            write_frames(path, frames, overwrite=given.overwrite)
    else:
        stored, notes = as_stored(images[0], path.suffix)
        write_image(path, stored, metadata=read_scale(source), overwrite=given.overwrite)
        return notes
    return []


def _panels(result: Any, read: VersionFiles, given: Given) -> list[list[tuple[Any, str]]]:
    how = {"channels": given.channels, "alpha": read.alpha, "any_size": given.align}
    stack = stack_versions(read.images, read.masks, given.nodata, **how)
    panels = []
    for number, name in enumerate(read.names):
        values, known = stack.bands(number), stack.known[:, :, number]
        colors = values[:, :, :3] if values.shape[2] >= 3 else values[:, :, :1].repeat(3, axis=2)
        alpha = known[:, :, None] * np.float32(peak(stack.dtypes[number]))
        shown = np.concatenate([colors, alpha], axis=2).astype(stack.dtypes[number])
        about = f"{known.mean():.0%} known, noise {result.noise[number]:.3g}, weight {result.weights[number]:.2f}"
        panels.append((shown, f"{Path(name).name}\n{about}"))
    restored = f"restored: {len(result.colors)} segments" if hasattr(result, "colors") else "restored"
    unknown = f"{(result.coverage == 0).mean():.1%} was known in none"
    rows = [panels[start : start + 4] for start in range(0, len(panels), 4)]
    shares = (result.coverage - result.left_out) / len(panels)
    covered = np.rint(255 * shares).astype(np.uint8), "versions used\nwhite: all, black: none"
    return [*rows, [(result.image, f"{restored}\n{unknown}"), covered]]
