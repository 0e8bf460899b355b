"""``cvtimg segment``: images divided into segments, with their edges, contours and tables."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Row, Stopwatch, Task, WrongUsageError, plan_each
from cvtimg.cli.hierarchies import cut_regions
from cvtimg.cli.pages import segment_pages
from cvtimg.cli.running import run_plan
from cvtimg.cli.segment_outputs import Style, Subject, kind_of, outputs_of
from cvtimg.cli.tiled import check_fit, segment_in_tiles
from cvtimg.options.record import Given

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.pictures.files import ImageInfo
    from cvtimg.segmentation.averaging import Averaging
    from cvtimg.segmentation.result import Segmentation

EXAMPLES = """Examples:

\b
  cvtimg segment bone.png -k 2 --edges edges.png --overlay overlay.png
  cvtimg segment cells.tif -k 2 --edge-weight auto --objects --min-size 30 --table cells.csv --coco cells.json
  cvtimg segment scene.tif -k 5 --nodata 0 --contours scene.geojson
  cvtimg segment photo.jpg -k 6 --averaging before --subpixel --contours poster.svg
  cvtimg segment photo.jpg -k auto --edges edges.png
  cvtimg segment photo.jpg -k 400 --superpixels --overlay cells.png
  cvtimg segment photo.jpg --hierarchy --overlay regions.png --cuts cuts.png --tree photo.npz
  cvtimg segment slides/ -k 3 --out-dir out --write labels,overlay,table,contours.geojson
"""
#: Arguments of `segment` that do not need the whole image at a time.
_IN_TILES = ("space", "edge_weight", "edge_radius", "effort", "rng")
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "k", "edge_weight", "energy", "seconds", "output")


def segment(given: Given) -> int:
    """Divide images into N segments of similar color.

    Labels count from 1, dark to bright. Label 0 is left out: pixels that --mask or --nodata name, transparent ones,
    and the background of --objects. If no output is named, the labels of one input go to NAME-labels.png beside it;
    with --write each input gets the outputs listed. Contours are in pixels from the upper left corner, or in the
    coordinates of a GeoTIFF.

    Pages of a TIFF are segmented separately, or together with --volume; -o FILE.tif takes the labels of all.

    Labels of TIFF files of over 2^26 pixels with -o FILE.tif, and of Zarr arrays, are computed in tiles.
    """
    from cvtimg import find_images

    if given.number is None:
        if not given.hierarchy:
            raise WrongUsageError("-k is needed without --hierarchy: a number of segments, or auto")
        given.number = "auto"
    if given.threshold is not None and given.number != "auto":
        raise WrongUsageError("--threshold and -k N exclude each other")
    given.averaging = _averaging(given)
    given.style = Style.of(given)
    plan = plan_each(given.inputs, find_images, outputs_of(given), out_dir=given.out_dir, also_read=[given.mask])
    columns = (*COLUMNS[:2], "elbow", *COLUMNS[2:]) if given.number == "auto" and not given.hierarchy else COLUMNS
    return run_plan(plan, _segment, columns, given)


def _averaging(given: Given) -> Averaging | None:
    from cvtimg.segmentation.averaging import Averaging

    try:
        return None if given.averaging == "none" else Averaging(given.averaging, given.kernel, given.radius)
    except ValueError as error:
        raise WrongUsageError(f"--radius: {error}") from error


def _segment(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from cvtimg import read_image
    from cvtimg.pictures import image_info
    from cvtimg.pictures.known import known_in_all, known_pixels

    if _needs_tiles(task):
        check_fit(task.source, _needing_memory(given), given.max_pixels)
        options = {name: value for name, value in given.arguments.items() if name in _IN_TILES}
        options |= {"mask": given.mask, "overwrite": given.overwrite}
        return segment_in_tiles(task, stopwatch, given.number, given.nodata, options)
    header = image_info(task.source)
    divide = partial(_divide, given=given, header=header)
    if header.has_pages:
        if [kind_of(option) for option in task.outputs] != ["labels"]:
            raise ValueError("has several pages, of which only labels are written")
        find = partial(known_in_all, header=header, mask=given.mask, nodata=given.nodata, noun="page")
        return segment_pages(task, stopwatch, divide, find, volume=given.volume, overwrite=given.overwrite)
    image = read_image(task.source)
    stopwatch.lap("read")
    image, result = divide(image, known_pixels(image, header, given.mask, given.nodata))
    stopwatch.lap("cluster")
    subject = Subject(task.source, image, result.labels, header, given.style, given.overwrite, result.hierarchy)
    subject.write(task.outputs)
    stopwatch.lap("write")
    return {
        "width": image.shape[1],
        "height": image.shape[0],
        "channels": image.shape[2] if image.ndim == 3 else 1,
        "left_out": int((result.labels == 0).sum()),
        "k": result.n_segments,
        "elbow": result.curve.elbows() if result.curve else None,
        "edge_weight": result.edge_weight,
        "energy": result.energy,
        "n_iter": len(result.energies) - 1,
        "converged": result.converged,
    }


def _divide(
    image: NDArray[Any], known: NDArray[np.bool_], *, given: Given, header: ImageInfo
) -> tuple[NDArray[Any], Segmentation]:
    """Segment an image; return the bands that count, and the result."""
    import cvtimg
    from cvtimg.segmentation.touching import Objects

    if header.has_alpha and image.shape[2:] == (4,):
        image, known = image[:, :, :3], known & (image[:, :, 3] > 0)
    if not known.any():
        raise ValueError("has no pixel that counts: all are transparent, without data or left out by the mask")
    options = given.arguments
    if given.hierarchy:
        space = {} if given.space is None else {"space": given.space}
        return image, cut_regions(image, known, given.number, given.threshold, space)
    if given.superpixels:
        options = {name: value for name, value in options.items() if name in ("space", "compactness")}
        return image, cvtimg.superpixels(image, given.number, mask=known, **options)
    objects = Objects(given.background, given.neck_depth, given.object_border) if given.objects else False
    return image, cvtimg.segment(image, given.number, mask=known, averaging=given.averaging, objects=objects, **options)


def _needing_memory(given: Given) -> dict[str, Any]:
    """Return the options that need the whole image, by their names on the command line."""
    names = (
        "superpixels",
        "hierarchy",
        "volume_power",
        "components",
        "min_size",
        "border_price",
        "averaging",
        "objects",
    )
    options = {f"--{name.replace('_', '-')}": getattr(given, name) for name in names}
    return {name: True for name, value in {"-k auto": given.number == "auto", **options}.items() if value}


def _needs_tiles(task: Task) -> bool:
    """Return whether to segment in tiles: labels alone of a large image, or any output of a Zarr array."""
    targets = list(task.outputs.values())
    zarr = [path for path in (task.source, *targets) if path.suffix.lower() == ".zarr"]
    if [kind_of(option) for option in task.outputs] != ["labels"]:
        if zarr:
            raise ValueError(f"only labels are computed in tiles, and {zarr[0]} is not otherwise read and written")
        return False
    from cvtimg.pictures.tiles import needs_tiles

    return needs_tiles(task.source, targets[0])
