"""``cvtimg restore``: one good image from several bad ones."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import typer
from typer import Option

from cvtimg._shared.choices import AutoEffortName
from cvtimg.batch import InputsFailedError, Row, Stopwatch, Task, WrongUsageError, check_suffix, plan_one
from cvtimg.batch.tasks import Missing
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.plotting.sheets import Panel
    from cvtimg.restoration.reconstruction import Restoration

EXAMPLES = """Examples:

\b
  cvtimg restore scan_1.png scan_2.png scan_3.png -k 6 -o whole.png
  cvtimg restore photo_*.png --detail --align -o photo.png --sheet sheet.png
  cvtimg restore noisy.png --detail -o clean.png
  cvtimg restore a.tif b.tif --mask a-known.png --mask b-known.png -k 4 -o c.tif --labels c-labels.png
  cvtimg restore day.png night.png --channels -k 12 -o day-12.png
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "versions", "k", "unknown", "energy", "seconds", "output")
#: Versions in a row of the sheet.
_ACROSS = 4


def _weights(text: str) -> list[float]:
    """Parse weights separated by commas."""
    with suppress(ValueError):
        weights = [float(word) for word in text.split(",")]
        if all(0 < weight < math.inf for weight in weights):
            return weights
    raise typer.BadParameter(f"{text!r} must be numbers > 0 with commas between them")


VersionFiles = Annotated[
    list[str],
    typer.Argument(metavar="VERSION...", help="Versions of one image, all of one size: files, folders or patterns."),
]
Segments = Annotated[
    Any,
    Option(
        "--segments",
        "-k",
        metavar="N|auto",
        # More segments than this no file of labels holds.
        parser=options.or_auto(options.whole_number(1, options.MAX_COLORS - 1)),
        help="Number of segments; auto picks it by the energy. With --detail, kinds of patches; auto is 32.",
    ),
]
Output = Annotated[
    Path,
    Option(
        "--output",
        "-o",
        metavar="FILE",
        parser=options.output_file(".png"),
        help="Write the restored image; - for standard output.",
    ),
]
Masks = Annotated[
    list[Path] | None,
    Option(
        "--mask",
        metavar="FILE",
        help="Image that is black where a version is missing; once per version, in their order.",
    ),
]
Nodata = Annotated[
    float | None,
    Option("--nodata", metavar="V", parser=options.number(), help="Treat pixels that are V in all bands as missing."),
]
Weights = Annotated[
    str | None,
    Option("--weights", metavar="W,W,..", parser=_weights, help="Weight of each version; by default from its noise."),
]
EdgeWeight = Annotated[
    Any,
    Option(
        "--edge-weight",
        metavar="L|auto",
        parser=options.or_auto(options.number(0)),
        help="Penalty for each pair of nearby pixels in different segments; auto follows the noise.",
    ),
]
Radius = Annotated[
    float,
    Option(
        metavar="PIXELS",
        parser=options.number(above=0, high=1000),
        help="Standard deviation of the --averaging kernel.",
    ),
]
Renormalize = Annotated[
    Literal["range", "median", "none"],
    Option(help="How to undo the loss of contrast where some versions are painted over."),
]
Hidden = Annotated[
    Literal["outliers", "background", "none"],
    Option(help="Where versions disagree, leave out the outliers, or those that show the background, or none."),
]
Align = Annotated[bool, Option("--align", help="Shift each version onto the first.")]
Channels = Annotated[
    bool, Option("--channels", help="Versions share segments but not colors, as channels do; the first is restored.")
]
Detail = Annotated[
    bool, Option("--detail", help="Restore texture too, patch by patch; for photographs, and to denoise a single one.")
]
Effort = Annotated[
    AutoEffortName, Option(help="How long to search for a better result; auto: with --detail, less for large images.")
]
Seed = Annotated[
    int,
    Option(
        "--seed",
        metavar="N",
        parser=options.whole_number(0, 2**63 - 1),
        help="With --detail: seed of the sample of patches that large images are learned from.",
    ),
]
Labels = Annotated[
    Path | None, Option(metavar="FILE", help="Write the segment of each pixel, from 1: .png, .tif or .npy.")
]
Sheet = Annotated[
    Path | None, Option(metavar="FILE", help="Draw the versions and the restored image on one sheet, to compare.")
]


class Versions(NamedTuple):
    """Versions and masks as read, and the names of their files."""

    images: list[NDArray[Any]]
    masks: list[NDArray[np.bool_]] | None
    names: list[str]
    mask_names: list[str]
    alpha: bool | None  # False: no version has any


def restore(
    versions: VersionFiles,
    output: Output,
    segments: Segments = "auto",
    mask: Masks = None,
    nodata: Nodata = None,
    weights: Weights = None,
    align: Align = False,
    channels: Channels = False,
    detail: Detail = False,
    hidden: Hidden = "outliers",
    renormalize: Renormalize = "range",
    averaging: options.Averaging = "none",
    radius: Radius = 2,
    edge_weight: EdgeWeight = "auto",
    volume_power: options.VolumePower = 0,
    space: options.Space = "rgb",
    effort: Effort = "auto",
    seed: Seed = 0,
    labels: Labels = None,
    sheet: Sheet = None,
    max_pixels: options.MaxPixels = None,
    *,
    common: options.CommonOptions,
) -> int:
    """Restore one image from several noisy or incomplete versions of it.

    Transparent pixels are missing, and those missing in all versions are filled from around them. Where versions
    disagree, what was added to one of them or painted over in it is left out; --hidden changes that. The result has N
    flat colors; photographs need --detail.
    """
    from cvtimg import find_images
    from cvtimg.pictures.files import lossless_suffixes
    from cvtimg.segmentation import Averaging

    check_suffix("-o", output, lossless_suffixes())
    check_suffix("--labels", labels, (".png", ".tif", ".tiff", ".npy"))
    outputs = {"-o": output, "--labels": labels, "--sheet": sheet}
    plan = plan_one(versions, find_images, outputs, also_read=mask or [])
    n_versions = sum(len(task.sources) for task in plan.tasks)
    if mask and plan.tasks and len(mask) != n_versions:
        raise WrongUsageError(f"--mask is given {len(mask)} times, for {n_versions} versions")
    how = {
        "n_generators": segments,
        "nodata": nodata,
        "weights": weights,
        "align": align,
        "channels": channels,
        "detail": detail,
        "hidden": hidden,
        "renormalize": renormalize,
        "averaging": None if averaging == "none" else Averaging(averaging, radius=radius),
        "edge_weight": edge_weight,
        "volume_power": volume_power,
        "space": space,
        "effort": effort,
        "rng": seed,
    }
    work = partial(_restore, masks=mask or [], how=how, overwrite=common.overwrite)
    return run_plan(plan, work, COLUMNS, common, max_pixels=max_pixels)


def _read(sources: Sequence[Path], masks: Sequence[Path]) -> Versions:
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
    return Versions(images, known or None, names[: len(images)], names[len(images) :], alpha)


def _restore(
    task: Task, stopwatch: Stopwatch, *, masks: Sequence[Path], how: Mapping[str, Any], overwrite: bool
) -> Row:
    from cvtimg import restore

    read = _read(task.sources, masks)
    stopwatch.lap("read")
    try:
        result = restore(read.images, masks=read.masks, alpha=read.alpha, **how)
    except ValueError as error:
        raise ValueError(_with_names(str(error), read)) from error
    stopwatch.lap("cluster")
    notes = _write(task.outputs, result, read, how, overwrite)
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
        "edge_weight": result.edge_weight,
        "energy": result.energy,
        "n_iter": len(result.energies) - 1,
        "converged": result.converged,
        **({"warning": "; ".join(notes)} if notes else {}),
    }


def _with_names(message: str, read: Versions) -> str:
    """Replace names of arguments in a message by those of files."""
    message = re.sub(r"images\[(\d+)\]", lambda match: read.names[int(match[1])], message)
    return re.sub(r"masks\[(\d+)\]", lambda match: read.mask_names[int(match[1])], message)


def _write(
    outputs: Mapping[str, Path], result: Restoration, read: Versions, how: Mapping[str, Any], overwrite: bool
) -> list[str]:
    """Write what was asked for; return what there is to say about it."""
    import numpy as np

    from cvtimg import write_image
    from cvtimg.pictures.formats.encoding import as_stored

    stored, notes = as_stored(result.image, outputs["-o"].suffix)
    write_image(outputs["-o"], stored, overwrite=overwrite)
    if "--labels" in outputs:
        kind = np.uint8 if len(result.colors) < 256 else np.uint16
        write_image(outputs["--labels"], result.labels.astype(kind), overwrite=overwrite)
    if "--sheet" in outputs:
        from cvtimg.plotting.sheets import contact_sheet

        write_image(outputs["--sheet"], contact_sheet(_panels(result, read, how)), overwrite=overwrite)
    return notes


def _panels(result: Restoration, read: Versions, how: Mapping[str, Any]) -> list[list[Panel]]:
    """Arrange the versions in rows, with the result below them."""
    import numpy as np

    from cvtimg._shared.pixels import peak
    from cvtimg.plotting.sheets import Panel
    from cvtimg.restoration.versions import stack_versions

    stack = stack_versions(read.images, read.masks, how["nodata"], channels=how["channels"], alpha=read.alpha)
    panels = []
    for number, name in enumerate(read.names):
        values, known = stack.bands(number), stack.known[:, :, number]
        colors = values[:, :, :3] if values.shape[2] >= 3 else values[:, :, :1].repeat(3, axis=2)
        alpha = known[:, :, None] * np.float32(peak(stack.dtypes[number]))
        shown = np.concatenate([colors, alpha], axis=2).astype(stack.dtypes[number])
        about = f"{known.mean():.0%} known, noise {result.noise[number]:.3g}, weight {result.weights[number]:.2f}"
        panels.append(Panel(shown, (Path(name).name, about)))
    count = f"{len(result.colors)} kinds of patches" if how["detail"] else f"{len(result.colors)} segments"
    unknown = f"{(result.coverage == 0).mean():.1%} was known in none"
    rows = [panels[start : start + _ACROSS] for start in range(0, len(panels), _ACROSS)]
    shares = (result.coverage - result.left_out) / len(panels)
    covered = Panel(np.rint(255 * shares).astype(np.uint8), ("versions used", "white: all, black: none"))
    return [*rows, [Panel(result.image, (f"restored: {count}", unknown)), covered]]
