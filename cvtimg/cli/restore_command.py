"""``cvtimg restore``: one good picture from several bad ones."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

from cvtimg.batch import Missing, Report, Row, Running, Task, WrongUsageError, check_choice, find, run
from cvtimg.cli import options
from cvtimg.cli.batch_options import with_running

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.plotting.sheets import Panel
    from cvtimg.restoration.reconstruction import Restoration

EXAMPLES = """Examples:

\b
  cvtimg restore scan_1.png scan_2.png scan_3.png -k 6 -o whole.png
  cvtimg restore photo_*.png -k 96 --detail --align -o photo.png --sheet sheet.png
  cvtimg restore a.tif b.tif --mask a-known.png --mask b-known.png -k 4 -o c.tif --labels c-labels.png
  cvtimg restore day.png night.png --channels -k 12 -o day-12.png
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "versions", "k", "unknown", "energy", "seconds", "output")
_LARGEST_RADIUS = 1000
#: Versions in a row of the sheet.
_ACROSS = 4

#: More segments than this no file of labels holds.
_COUNT = options.count_or_auto(1, options.MAX_COLORS - 1)


def _edge_weight(text: str | float) -> float | str:
    """Parse a weight of edges."""
    if text == "auto":
        return text
    with suppress(ValueError):
        if 0 <= float(text) < math.inf:
            return float(text)
    raise typer.BadParameter(f"{str(text)!r} must be auto or a number >= 0")


def _weights(text: str) -> list[float]:
    """Parse weights with commas between them."""
    with suppress(ValueError):
        weights = [float(word) for word in text.split(",")]
        if all(0 < weight < math.inf for weight in weights):
            return weights
    raise typer.BadParameter(f"{text!r} must be numbers > 0 with commas between them")


def _number(text: str | float) -> float:
    """Parse a finite number."""
    with suppress(ValueError):
        if math.isfinite(float(text)):
            return float(text)
    raise typer.BadParameter(f"{str(text)!r} must be a number")


def _radius(text: str | float) -> float:
    """Parse the radius of an average."""
    with suppress(ValueError):
        if 0 < float(text) <= _LARGEST_RADIUS:
            return float(text)
    raise typer.BadParameter(f"{str(text)!r} must be a number > 0 and at most {_LARGEST_RADIUS}")


Versions = Annotated[
    list[str], typer.Argument(metavar="VERSION", help="Versions of one picture: files, folders, or patterns.")
]
Segments = Annotated[
    Any,
    Option(
        "--segments",
        "-k",
        metavar="N|auto",
        parser=_COUNT,
        help="Segments, auto for the elbow; with --detail kinds of patches, as 96.",
    ),
]
Output = Annotated[Path, Option("--output", "-o", metavar="FILE", help="The restored picture.")]
Masks = Annotated[
    list[Path] | None,
    Option("--mask", metavar="FILE", help="What a version knows, black where nothing; once for each, in their order."),
]
Nodata = Annotated[
    float | None, Option("--nodata", metavar="V", parser=_number, help="Pixels of this value in all bands are missing.")
]
Weights = Annotated[
    str | None, Option("--weights", metavar="W,W,..", parser=_weights, help="How much each counts; else by its noise.")
]
EdgeWeight = Annotated[
    str,
    Option("--edge-weight", metavar="L|auto", parser=_edge_weight, help="What edges cost: 0 nothing, auto by noise."),
]
Averages = Annotated[str, Option("--averaging", metavar="NAME", help="Average against noise: none, before or after.")]
Radius = Annotated[
    float, Option("--radius", metavar="R", parser=_radius, help="Standard deviation of that average, in pixels.")
]
Renormalize = Annotated[
    str,
    Option(
        metavar="NAME", help="How colors get back their contrast where parts are painted over: range, median or none."
    ),
]
Space = Annotated[str, Option(metavar="NAME", help=f"Where distances are measured: {options.SPACE_NAMES}.")]
Align = Annotated[bool, Option("--align", help="Move each version to the place of the first.")]
Channels = Annotated[bool, Option("--channels", help="Versions share segments but no colors; the first is restored.")]
Detail = Annotated[bool, Option("--detail", help="For photographs: restore what is not flat too, patch by patch.")]
Labels = Annotated[
    Path | None, Option(metavar="FILE", help="Write the segment of each pixel, from 1: .png, .tif or .npy.")
]
Sheet = Annotated[Path | None, Option(metavar="FILE", help="Draw the versions, and below them the restored picture.")]


@dataclass(frozen=True, slots=True)
class _Read:
    """Versions and masks as they were read, and their names."""

    images: list[NDArray[Any]]
    masks: list[NDArray[np.bool_]] | None
    names: list[str]
    mask_names: list[str]


@with_running("report_file", "max_pixels")
def restore(
    versions: Versions,
    segments: Segments,
    output: Output,
    mask: Masks = None,
    nodata: Nodata = None,
    weights: Weights = None,
    align: Align = False,
    channels: Channels = False,
    detail: Detail = False,
    renormalize: Renormalize = "range",
    averaging: Averages = "none",
    radius: Radius = 2,
    edge_weight: EdgeWeight = "auto",
    volume_power: options.VolumePower = 0,
    space: Space = "rgb",
    effort: options.Effort = "balanced",
    seed: options.Seed = 0,
    labels: Labels = None,
    sheet: Sheet = None,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
    *,
    running: Running,
) -> None:
    """Put one picture together from noisy, incomplete versions of it.

    Transparent pixels are missing. What is painted over in one version and not in the others comes back, and what no
    version knows is filled from around it. Pictures of few colors come out in N flat colors; photographs need
    --detail. All versions have one size.
    """
    from cvtimg import find_images
    from cvtimg.colors import SPACES
    from cvtimg.engine import EFFORTS
    from cvtimg.pictures.files import lossless_suffixes
    from cvtimg.pictures.formats.opening import pixels_limited
    from cvtimg.restoration import RENORMALIZATIONS
    from cvtimg.segmentation import Averaging

    check_choice("--effort", effort, EFFORTS)
    check_choice("--space", space, SPACES)
    check_choice("--renormalize", renormalize, RENORMALIZATIONS)
    check_choice("--averaging", averaging, ("none", "before", "after"))
    check_choice("-o", output.suffix.lower(), lossless_suffixes())
    if labels:
        check_choice("--labels", labels.suffix.lower(), (".png", ".tif", ".tiff", ".npy"))
    report = Report(COLUMNS, as_json=as_json, quiet=quiet)
    found, missing = find(versions, find_images)
    sources = list(found)
    files = {"picture": output, "labels": labels, "sheet": sheet}
    outputs = {kind: path for kind, path in files.items() if path}
    _check_apart([*outputs.values(), *([running.file] if running.file else [])], [*sources, *(mask or [])])
    if mask and len(mask) != len(sources) + len(missing):
        raise WrongUsageError(f"--mask is given {len(mask)} times, for {len(sources) + len(missing)} versions")
    start = perf_counter()
    with pixels_limited(running.max_pixels):
        read = _read(sources, mask, missing)
    seconds = perf_counter() - start
    how = {
        "n_generators": segments,
        "nodata": nodata,
        "weights": weights,
        "align": align,
        "channels": channels,
        "detail": detail,
        "renormalize": renormalize,
        "averaging": None if averaging == "none" else Averaging(averaging, radius=radius),
        "edge_weight": edge_weight,
        "volume_power": volume_power,
        "space": space,
        "effort": effort,
        "rng": seed,
    }

    def work(task: Task) -> Row:
        return _restore(task, read, how, seconds, overwrite)

    tasks = [] if missing else [Task(sources[0], outputs)]
    raise typer.Exit(run(tasks, missing, work, report, overwrite=overwrite, running=running))


def _check_apart(outputs: Any, inputs: Sequence[Path]) -> None:
    for path in outputs:
        if any(path.exists() and source.exists() and path.samefile(source) for source in inputs):
            raise WrongUsageError(f"{path} is an input, which is never replaced; choose another output")


def _read(sources: Sequence[Path], masks: Sequence[Path] | None, missing: Missing) -> _Read:
    """Read all versions and masks; those that cannot be read join the missing."""
    from cvtimg import read_image

    def read(paths: Sequence[Path]) -> list[NDArray[Any]]:
        found = []
        for path in paths:
            try:
                found.append(read_image(path))
            except OSError as error:
                missing.append((str(path), error))
        return found

    images, known = read(sources), [_known(mask) for mask in read(masks or [])]
    return _Read(images, known or None, [str(path) for path in sources], [str(path) for path in masks or []])


def _known(mask: NDArray[Any]) -> NDArray[np.bool_]:
    """(H, W) where a mask is not black, whatever its alpha says."""
    import numpy as np

    from cvtimg.colors.places import has_alpha

    bands = mask.reshape(*mask.shape[:2], -1)
    return np.asarray((bands[:, :, :-1] if has_alpha(bands.shape[2]) else bands).any(axis=2))


def _restore(task: Task, read: _Read, how: Mapping[str, Any], seconds: float, overwrite: bool) -> Row:
    from cvtimg import restore

    start = perf_counter()
    try:
        result = restore(read.images, masks=read.masks, **how)
    except ValueError as error:
        raise ValueError(_with_names(str(error), read)) from error
    clustered = perf_counter()
    _write(task.outputs, result, read, how, overwrite)
    written = perf_counter()
    return {
        "input": str(task.source),
        "inputs": read.names,
        "output": str(task.outputs["picture"]),
        "width": result.labels.shape[1],
        "height": result.labels.shape[0],
        "channels": result.image.shape[2] if result.image.ndim == 3 else 1,
        "versions": len(read.images),
        "k": len(result.colors),
        "unknown": float((result.coverage == 0).mean()),
        "noise": [noise if math.isfinite(noise) else None for noise in result.noise.tolist()],
        "weights": result.weights.tolist(),
        "shifts": result.shifts.tolist(),
        "edge_weight": result.edge_weight,
        "energy": result.energy,
        "n_iter": len(result.energies) - 1,
        "converged": result.converged,
        "seconds": {"read": seconds, "cluster": clustered - start, "write": written - clustered},
    }


def _with_names(message: str, read: _Read) -> str:
    """Name files where a message tells of arguments."""
    message = re.sub(r"images\[(\d+)\]", lambda match: read.names[int(match[1])], message)
    return re.sub(r"masks\[(\d+)\]", lambda match: read.mask_names[int(match[1])], message)


def _write(
    outputs: Mapping[str, Path], result: Restoration, read: _Read, how: Mapping[str, Any], overwrite: bool
) -> None:
    import numpy as np

    from cvtimg import write_image

    write_image(outputs["picture"], result.image, overwrite=overwrite)
    if "labels" in outputs:
        kind = np.uint8 if len(result.colors) < 256 else np.uint16
        write_image(outputs["labels"], result.labels.astype(kind), overwrite=overwrite)
    if "sheet" in outputs:
        from cvtimg.plotting.sheets import contact_sheet

        write_image(outputs["sheet"], contact_sheet(_panels(result, read, how)), overwrite=overwrite)


def _panels(result: Restoration, read: _Read, how: Mapping[str, Any]) -> list[list[Panel]]:
    """Lay out the versions in rows, and below them what came of them."""
    import numpy as np

    from cvtimg.colors.spaces import peak
    from cvtimg.plotting.sheets import Panel
    from cvtimg.restoration.versions import stack_versions

    stack = stack_versions(read.images, read.masks, how["nodata"], channels=how["channels"])
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
    shares = result.coverage / len(panels)
    covered = Panel(np.rint(255 * shares).astype(np.uint8), ("known in how many", "white in all, black in none"))
    return [*rows, [Panel(result.image, (f"restored: {count}", unknown)), covered]]
