"""``cvtimg segment``: pictures to segments, and the edges, contours and tables of these."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

from cvtimg.batch import Report, Row, Running, Task, WrongUsageError, check_choice, check_outputs, find, run
from cvtimg.cli import options
from cvtimg.cli.batch_options import for_many
from cvtimg.cli.segment_outputs import KIND_NAMES, Style, Subject, file_names
from cvtimg.cli.tiled import check_fit, goes_by_tiles, segment_by_tiles

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.elbow.curves import EnergyCurve
    from cvtimg.pictures.files import ImageInfo
    from cvtimg.segmentation.averaging import Averaging
    from cvtimg.segmentation.result import Segmentation

EXAMPLES = """Examples:

\b
  cvtimg segment bone.png -k 2 --edges edges.png --overlay overlay.png
  cvtimg segment cells.tif -k 2 --edge-weight auto --components --min-size 30 --table cells.csv --coco cells.json
  cvtimg segment scene.tif -k 5 --nodata 0 --contours scene.geojson
  cvtimg segment photo.jpg -k 6 --averaging before --subpixel --contours poster.svg
  cvtimg segment photo.jpg -k auto --edges edges.png
  cvtimg segment photo.jpg -k 400 --superpixels --overlay cells.png
  cvtimg segment slides/ -k 3 --out-dir out --write labels,overlay,table,contours.geojson
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "k", "edge_weight", "energy", "seconds", "output")

#: Options that need not the whole picture at a time.
_BY_TILES = ("space", "edge_weight", "edge_radius", "effort", "rng")
_COUNT = options.count_or_auto(1, options.MAX_COLORS)
_SIZE = options.whole_number(0, 2**31 - 1)
_AMOUNT = options.number(0)
_WIDTH = options.whole_number(1, 1000)


def _weight(text: str | float) -> float | str:
    return "auto" if text == "auto" else _AMOUNT(text)


Number = Annotated[Any, Option("-k", metavar="N|auto", parser=_COUNT, help="Number of segments; auto: see elbow.")]
Labels = Annotated[
    Path | None,
    Option("--output", "-o", metavar="FILE", help="Labels of the pixels, .png, .tif, .npy or .zarr; for one input."),
]
OutDir = Annotated[Path | None, Option(metavar="DIR", help="Folder for outputs NAME-labels.png and so on.")]
Write = Annotated[
    str,
    Option(metavar="KIND,...", help=f"What to write by the names of the inputs: {KIND_NAMES}; or KIND.SUFFIX."),
]
Mean = Annotated[Path | None, Option(metavar="FILE", help="Picture in the mean color of each segment.")]
Edges = Annotated[Path | None, Option(metavar="FILE", help="Edges, white on black.")]
Overlay = Annotated[Path | None, Option(metavar="FILE", help="Edges over the picture.")]
ContourFile = Annotated[Path | None, Option("--contours", metavar="FILE", help="Polygons, .svg or .geojson.")]
Table = Annotated[Path | None, Option(metavar="FILE", help="Figures of each segment, .csv.")]
Coco = Annotated[Path | None, Option(metavar="FILE", help="Masks of the segments as COCO has them, .json.")]
EdgeMode = Annotated[str, Option(metavar="NAME", help="Side that --edges are on: inner (bright), outer or thick.")]
LineColor = Annotated[str, Option(metavar="#RRGGBB", parser=options.color, help="Color of the lines of --overlay.")]
LineWidth = Annotated[int, Option(metavar="PIXELS", parser=_WIDTH, help="Width of the lines of --overlay.")]
Subpixel = Annotated[bool, Option("--subpixel", help="Let --contours run between pixels, as the picture tells.")]
Simplify = Annotated[
    float, Option(metavar="PIXELS", parser=_AMOUNT, help="How far --contours may be off, to be shorter.")
]
AveragingName = Annotated[
    str, Option("--averaging", metavar="WHEN", help="Average near pixels, for noise: none, before or after.")
]
Kernel = Annotated[str, Option(metavar="NAME", help="Weights of --averaging: gaussian or box.")]
Radius = Annotated[float, Option(metavar="PIXELS", parser=_AMOUNT, help="Radius of --averaging.")]
EdgeWeight = Annotated[
    Any, Option(metavar="L", parser=_weight, help="What edges cost, >= 0, so that they are few; auto: by the noise.")
]
EdgeRadius = Annotated[
    int, Option(metavar="PIXELS", parser=options.whole_number(1, 30), help="How far --edge-weight looks.")
]
Components = Annotated[bool, Option("--components", help="Make each connected piece a segment of its own.")]
MinSize = Annotated[
    int, Option(metavar="PIXELS", parser=_SIZE, help="Let neighbors take pieces that are smaller than this.")
]
BorderPrice = Annotated[
    float,
    Option(metavar="P", parser=_AMOUNT, help="With --components: join neighbors if that costs less a pixel of border."),
]
Mask = Annotated[Path | None, Option(metavar="FILE", help="Picture of what to leave out: black there.")]
NoData = Annotated[
    float | None, Option("--nodata", metavar="V", help="Leave out pixels with V in all bands; a GeoTIFF tells its own.")
]
Superpixels = Annotated[bool, Option("--superpixels", help="Divide into about N connected cells of like size.")]
Space = Annotated[str, Option(metavar="NAME", help=f"Where distances are measured: {options.SPACE_NAMES}.")]
Seed = Annotated[int, Option("--seed", metavar="N", parser=options.SEED, help="Seed of what is drawn.")]
Compactness = Annotated[
    float | None, Option(metavar="C", parser=_AMOUNT, help="How round the cells of --superpixels are.")
]


@for_many
def segment(
    inputs: options.Pictures,
    number: Number,
    output: Labels = None,
    out_dir: OutDir = None,
    write: Write = "",
    mean: Mean = None,
    edges: Edges = None,
    overlay: Overlay = None,
    contours: ContourFile = None,
    table: Table = None,
    coco: Coco = None,
    edge_mode: EdgeMode = "inner",
    line_color: LineColor = "#ffff00",
    line_width: LineWidth = 1,
    subpixel: Subpixel = False,
    simplify: Simplify = 0,
    space: Space = "rgb",
    averaging: AveragingName = "none",
    kernel: Kernel = "gaussian",
    radius: Radius = 2,
    edge_weight: EdgeWeight = 0,
    edge_radius: EdgeRadius = 3,
    components: Components = False,
    min_size: MinSize = 0,
    border_price: BorderPrice = 0,
    superpixels: Superpixels = False,
    compactness: Compactness = None,
    mask: Mask = None,
    nodata: NoData = None,
    volume_power: options.VolumePower = 0,
    effort: options.Effort = "balanced",
    seed: Seed = 0,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
    *,
    running: Running,
) -> None:
    """Divide pictures into N segments, each of the pixels that are nearest to its mean color.

    Labels count from 1, dark to bright; 0 is what is left out: what --mask and --nodata say, and transparent pixels.
    Without any output named, one input gives NAME-labels.png beside it; with --write all inputs give the files that
    it lists. Contours are in pixels from the upper left corner, or where a GeoTIFF lies, in its coordinates.
    Labels alone, from TIFF to .tif, of a picture of over 2^26 pixels are made by tiles, as are those of Zarr.
    """
    import cvtimg
    from cvtimg.labels.edges import EDGE_MODES

    check_choice("--effort", effort, cvtimg.engine.EFFORTS)
    check_choice("--space", space, cvtimg.colors.SPACES)
    check_choice("--edge-mode", edge_mode, EDGE_MODES)
    if superpixels:
        _exclude("--superpixels", averaging=averaging != "none", edge_weight=edge_weight, volume_power=volume_power)
        _exclude("--superpixels", components=components, min_size=min_size, border_price=border_price)
        if number == "auto":
            raise WrongUsageError("-k auto and --superpixels exclude each other")
        how: dict[str, Any] = {} if compactness is None else {"compactness": compactness}
        find_segments = partial(cvtimg.superpixels, space=space, **how)
    elif compactness is not None:
        raise WrongUsageError("--compactness needs --superpixels")
    elif border_price and not components:
        raise WrongUsageError("--border-price needs --components")
    else:
        how = {"volume_power": volume_power, "effort": effort, "rng": seed, "space": space}
        how |= {"edge_weight": edge_weight, "edge_radius": edge_radius}
        how |= {"components": components, "min_size": min_size, "border_price": border_price}
        find_segments = partial(cvtimg.segment, averaging=_averaging(averaging, kernel, radius), **how)
    style = Style(edge_mode, tuple(bytes.fromhex(line_color)[:3]), line_width, subpixel, simplify)
    columns = (*COLUMNS[:2], "elbow", *COLUMNS[2:]) if number == "auto" else COLUMNS
    report = Report(columns, as_json=as_json, quiet=quiet)
    sources, missing = find(inputs, cvtimg.find_images, out_dir)
    files = {"labels": output, "mean": mean, "edges": edges, "overlay": overlay, "contours": contours}
    files |= {"table": table, "coco": coco}
    flags = {"-o" if kind == "labels" else f"--{kind}": path for kind, path in files.items()}
    check_outputs(len(sources) + len(missing), out_dir, flags)
    names = file_names(write, files)
    tasks = [Task(source, _outputs(names, source, folder)) for source, folder in sources.items()]
    work = partial(_segment, number=number, find_segments=find_segments, mask=mask, nodata=nodata)
    work = partial(work, style=style, overwrite=overwrite, max_pixels=running.max_pixels)
    raise typer.Exit(run(tasks, missing, work, report, out_dir=out_dir, overwrite=overwrite, running=running))


def _exclude(option: str, **others: Any) -> None:
    """Refuse options that would do nothing beside another."""
    for name, given in others.items():
        if given:
            raise WrongUsageError(f"--{name.replace('_', '-')} and {option} exclude each other")


def _averaging(when: str, kernel: str, radius: float) -> Averaging | None:
    from cvtimg.segmentation.averaging import KERNELS, WHEN, Averaging

    check_choice("--averaging", when, ["none", *WHEN])
    check_choice("--kernel", kernel, KERNELS)
    try:
        return None if when == "none" else Averaging(when, kernel, radius)
    except ValueError as error:
        raise WrongUsageError(f"--radius: {error}") from error


def _outputs(names: Mapping[str, Path | str], source: Path, folder: Path) -> dict[str, Path]:
    """Name the files that shall come of an input."""
    return {kind: name if isinstance(name, Path) else folder / f"{source.stem}{name}" for kind, name in names.items()}


def _segment(
    task: Task,
    *,
    number: Any,
    find_segments: partial[Segmentation],
    mask: Path | None,
    nodata: float | None,
    style: Style,
    overwrite: bool,
    max_pixels: int | None,
) -> Row:
    from cvtimg import read_image
    from cvtimg.pictures import image_info

    if _goes_by_tiles(task):
        unfit = {"-k auto": number == "auto", "--mask": mask, **_unfit(find_segments)}
        check_fit(task.source, unfit, max_pixels)
        options = {name: find_segments.keywords[name] for name in _BY_TILES}
        return segment_by_tiles(task, number, nodata, {**options, "overwrite": overwrite})
    start = perf_counter()
    header = image_info(task.source)
    image, known = _known(read_image(task.source), header, nodata)
    if mask:
        known = known & _read_mask(mask, known.shape)
    read = perf_counter()
    curve = _energy_curve(image, known, find_segments.keywords) if number == "auto" else None
    result = find_segments(image, curve.elbow() if curve else number, mask=known)
    clustered = perf_counter()
    Subject(task.source, image, result.labels, header, style, overwrite).write(task.outputs)
    written = perf_counter()
    return {
        "input": str(task.source),
        "output": str(next(iter(task.outputs.values()))),
        "width": image.shape[1],
        "height": image.shape[0],
        "channels": image.shape[2] if image.ndim == 3 else 1,
        "left_out": int((result.labels == 0).sum()),
        "k": result.n_segments,
        "elbow": curve.elbows() if curve else None,
        "edge_weight": result.edge_weight,
        "energy": result.energy,
        "n_iter": len(result.energies) - 1,
        "converged": result.converged,
        "seconds": {"read": read - start, "cluster": clustered - read, "write": written - clustered},
    }


def _goes_by_tiles(task: Task) -> bool:
    """Whether only labels are asked for, of a picture that is large enough, or anything of a Zarr array."""
    targets = list(task.outputs.values())
    zarr = [path for path in (task.source, *targets) if path.suffix.lower() == ".zarr"]
    if len(targets) > 1 or not next(iter(task.outputs)).startswith("labels"):
        if zarr:
            raise ValueError(f"only labels are made by tiles, and {zarr[0]} is not otherwise read and written")
        return False
    return goes_by_tiles(task.source, targets[0])


def _unfit(find_segments: partial[Segmentation]) -> dict[str, Any]:
    """Return which options that need the whole picture are given."""
    import cvtimg

    how = find_segments.keywords
    given = {f"--{name.replace('_', '-')}": value or None for name, value in how.items() if name not in _BY_TILES}
    return {"--superpixels": find_segments.func is cvtimg.superpixels, **given}


def _energy_curve(image: NDArray[Any], known: NDArray[np.bool_], how: Mapping[str, Any]) -> EnergyCurve:
    """Compute the energies of the pixels that are known, by the number of their segments."""
    from cvtimg.colors import color_samples
    from cvtimg.elbow.curves import auto_count

    options = {name: how[name] for name in ("space", "volume_power", "rng")}
    return auto_count(color_samples(image[known][None]), **options)[1]


def _known(image: NDArray[Any], header: ImageInfo, nodata: float | None) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Split a picture into the bands to segment and where they are known: not NaN, not transparent, and not nodata."""
    import numpy as np

    known = np.ones(image.shape[:2], np.bool_)
    if header.has_alpha and image.shape[2:] == (4,):
        image, known = image[:, :, :3], image[:, :, 3] > 0
    bands = image.reshape(*known.shape, -1)
    if bands.dtype.kind == "f":
        known &= np.isfinite(bands).min(axis=2)
    missing = header.nodata if nodata is None else nodata
    if missing is not None:
        known &= (bands != missing).max(axis=2)
    return image, known


def _read_mask(path: Path, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Read which pixels are not black."""
    from cvtimg import read_image

    picture = read_image(path)
    if picture.shape[:2] != shape:
        height, width = picture.shape[:2]
        raise ValueError(f"has {shape[1]} x {shape[0]} pixels, but the mask {path} has {width} x {height}")
    kept: NDArray[np.bool_] = picture.reshape(*shape, -1)[:, :, :3].max(axis=2) > 0
    return kept
