"""``cvtimg restore``: one good image from several bad ones."""

from __future__ import annotations

import math
import os
import re
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from cvtimg.batch import InputsFailedError, Row, Stopwatch, Task, WrongUsageError, plan_one
from cvtimg.batch.tasks import Missing
from cvtimg.cli.running import run_plan
from cvtimg.options.record import Given

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.plotting.sheets import Panel
    from cvtimg.restoration.reconstruction import Restoration

EXAMPLES = """\
  cvtimg restore scan_1.png scan_2.png scan_3.png -k 6 -o whole.png
  cvtimg restore photo_*.png --detail --align -o photo.png --sheet sheet.png
  cvtimg restore noisy.png --detail -o clean.png
  cvtimg restore a.tif b.tif --mask a-known.png --mask b-known.png -k 4 -o c.tif --labels c-labels.png
  cvtimg restore day.png night.png --channels -k 12 -o day-12.png
"""
COLUMNS = ("input", "versions", "k", "unknown", "energy", "seconds", "output")
#: Versions in a row of the sheet.
_ACROSS = 4


class VersionFiles(NamedTuple):
    """Versions and masks as read, and the names of their files."""

    images: list[NDArray[Any]]
    masks: list[NDArray[np.bool_]] | None
    names: list[str]
    mask_names: list[str]
    alpha: bool | None  # False: no version has any


def restore(given: Given) -> int:
    """Restore one image from several noisy or incomplete versions of it.

    Transparent pixels are missing, and those missing in all versions are filled from around them. Where versions
    disagree, what was added to one of them or painted over in it is left out; --hidden changes that. The result has N
    flat colors; without -k, photographs get their detail back, as with --detail.
    """
    outputs = {"-o": given.output, "--labels": given.labels, "--sheet": given.sheet}
    masks = given.mask or []
    plan = plan_one(given.versions, outputs, also_read=masks)
    n_versions = sum(len(task.sources) for task in plan.tasks)
    if masks and plan.tasks and len(masks) != n_versions:
        raise WrongUsageError(f"--mask is given {len(masks)} times, for {n_versions} versions")
    return run_plan(plan, _restore, COLUMNS, given)


def _read(sources: Sequence[Path], masks: Sequence[Path]) -> VersionFiles:
    """Read all versions and masks, and report all that cannot be read."""
    from cvtimg._shared.pixels import not_black
    from cvtimg.pictures import image_info, read_pages

    failed: Missing = []
    names: list[str] = []

    def read(paths: Sequence[Path]) -> list[NDArray[Any]]:
        found: list[NDArray[Any]] = []
        for path in paths:
            try:
                pages = read_pages(path).images
                found += pages
                names.extend([str(path)] if len(pages) == 1 else [f"{path}: page {n + 1}" for n in range(len(pages))])
            except OSError as error:
                failed.append((str(path), error))
        return found

    images, known = read(sources), [not_black(mask) for mask in read(masks)]
    if failed:
        raise InputsFailedError(failed)
    alpha = None if any(image_info(path).has_alpha for path in sources) else False
    return VersionFiles(images, known or None, names[: len(images)], names[len(images) :], alpha)


def _restore(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from cvtimg import restore
    from cvtimg.segmentation import Averaging

    read = _read(task.sources, given.mask or [])
    stopwatch.lap("read")
    try:
        averaging = None if given.averaging == "none" else Averaging(given.averaging, radius=given.radius)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            detail = given.detail or ("auto" if _is_open(given) else False)
            align = given.motion if given.align else False
            about: dict[str, Any] = {
                "masks": read.masks,
                "alpha": read.alpha,
                "averaging": averaging,
                "align": align,
                "detail": detail,
            }
            result = restore(read.images, **about, **given.arguments)
    except ValueError as error:
        raise ValueError(_with_names(str(error), read)) from error
    stopwatch.lap("cluster")
    notes = [given.worded(_with_names(str(one.message), read)) for one in caught]
    if result.detail and not given.detail:
        notes.append("no flat drawing, so detail is restored, as by --detail; -k N restores flat colors")
    notes += [*_given_twice(given.versions), *_write(task.outputs, result, read, given)]
    stopwatch.lap("write")
    return {
        "inputs": read.names,
        "width": result.labels.shape[1],
        "height": result.labels.shape[0],
        "channels": result.image.shape[2] if result.image.ndim == 3 else 1,
        "versions": len(read.images),
        "k": len(result.colors),
        "unknown": float((result.coverage == 0).mean()),
        "left_out": float((result.left_out > 0).mean()),
        "noise": [noise if math.isfinite(noise) else None for noise in result.noise.tolist()],
        "weights": result.weights.tolist(),
        "shifts": result.shifts.tolist(),
        "transforms": result.transforms.tolist(),
        "motion": list(result.models),
        "misfits": [misfit if math.isfinite(misfit) else None for misfit in result.misfits.tolist()],
        "edge_weight": result.edge_weight,
        "energy": result.energy,
        "n_iter": len(result.energies) - 1,
        "converged": result.converged,
        **({"warning": "; ".join(notes)} if notes else {}),
    }


def _is_open(given: Given) -> bool:
    """Tell whether nothing asks for segments, so that the picture decides."""
    for_segments = (given.channels, given.averaging != "none", given.volume_power)
    return given.number == "auto" and given.edge_weight == "auto" and not any(for_segments)


def _given_twice(inputs: Sequence[str | Path]) -> list[str]:
    """Say which inputs are given more than once, though each counts once."""
    counts = Counter(os.path.realpath(path) for path in inputs)
    twice = {str(path): None for path in inputs if counts[os.path.realpath(path)] > 1}
    return [f"{path} is given more than once and counts once" for path in twice]


def _with_names(message: str, read: VersionFiles) -> str:
    """Replace names of arguments in a message by those of files."""
    message = message.replace("align=True", "--align")
    message = re.sub(r"images\[(\d+)\]", lambda match: read.names[int(match[1])], message)
    return re.sub(r"masks\[(\d+)\]", lambda match: read.mask_names[int(match[1])], message)


def _write(outputs: Mapping[str, Path], result: Restoration, read: VersionFiles, given: Given) -> list[str]:
    """Write what was asked for; return what there is to say about it."""
    import numpy as np

    from cvtimg import write_image
    from cvtimg.pictures.formats.encoding import as_stored

    stored, notes = as_stored(result.image, outputs["-o"].suffix)
    write_image(outputs["-o"], stored, overwrite=given.overwrite)
    if "--labels" in outputs:
        kind = np.uint8 if len(result.colors) < 256 else np.uint16
        write_image(outputs["--labels"], result.labels.astype(kind), overwrite=given.overwrite)
    if "--sheet" in outputs:
        from cvtimg.plotting.sheets import contact_sheet

        write_image(outputs["--sheet"], contact_sheet(_panels(result, read, given)), overwrite=given.overwrite)
    return notes


def _panels(result: Restoration, read: VersionFiles, given: Given) -> list[list[Panel]]:
    """Arrange the versions in rows, with the result below them."""
    import numpy as np

    from cvtimg._shared.pixels import peak
    from cvtimg.plotting.sheets import Panel
    from cvtimg.restoration.versions import stack_versions

    stack = stack_versions(read.images, read.masks, given.nodata, channels=given.channels, alpha=read.alpha)
    panels = []
    for number, name in enumerate(read.names):
        values, known = stack.bands(number), stack.known[:, :, number]
        colors = values[:, :, :3] if values.shape[2] >= 3 else values[:, :, :1].repeat(3, axis=2)
        alpha = known[:, :, None] * np.float32(peak(stack.dtypes[number]))
        shown = np.concatenate([colors, alpha], axis=2).astype(stack.dtypes[number])
        about = f"{known.mean():.0%} known, noise {result.noise[number]:.3g}, weight {result.weights[number]:.2f}"
        panels.append(Panel(shown, (Path(name).name, about)))
    count = f"{len(result.colors)} kinds of patches" if result.detail else f"{len(result.colors)} segments"
    unknown = f"{(result.coverage == 0).mean():.1%} was known in none"
    rows = [panels[start : start + _ACROSS] for start in range(0, len(panels), _ACROSS)]
    shares = (result.coverage - result.left_out) / len(panels)
    covered = Panel(np.rint(255 * shares).astype(np.uint8), ("versions used", "white: all, black: none"))
    return [*rows, [Panel(result.image, (f"restored: {count}", unknown)), covered]]
