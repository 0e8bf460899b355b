"""``cvtimg segment``: images divided into segments, with their edges, contours and tables."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Row, Stopwatch, Task, WrongUsageError, plan_each
from cvtimg.cli.running import run_plan
from cvtimg.cli.segment_outputs import Style, check_room, kind_of, outputs_of, write_outputs
from cvtimg.options.record import Given

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.segmentation.averaging import Averaging
    from cvtimg.segmentation.result import Segmentation

EXAMPLES = """\
  cvtimg segment bone.png -k 2 --edges edges.png --overlay overlay.png
  cvtimg segment nuclei.tif --objects --overlay outlines.png --table nuclei.csv
  cvtimg segment stack.tif --objects --volume -o labels.tif --table cells.csv
  cvtimg segment cells.tif -k 2 --smallest-detail 2 --objects --min-size 30 --table cells.csv
  cvtimg segment scene.tif -k 5 --nodata 0 --contours scene.geojson
  cvtimg segment photo.jpg -k 6 --averaging before --subpixel --contours poster.svg
  cvtimg segment photo.jpg -k auto --edges edges.png
  cvtimg segment photo.jpg -k 400 --superpixels --overlay cells.png
  cvtimg segment photo.jpg --hierarchy --overlay regions.png --strengths edges.png --tree photo.npz
  cvtimg segment slides/ -k 3 --out-dir out --write labels,overlay,table,contours.geojson
"""
#: Arguments of `segment` that do not need the whole image at a time.
_IN_TILES = ("space", "smallest_detail", "edge_weight", "edge_radius", "effort", "rng")
COLUMNS = ("input", "k", "edge_weight", "energy", "seconds", "output")
_OF_PLANES = "objects are those of each plane by itself; --volume finds them in three dimensions"
#: Columns where objects are counted: what was measured.
COUNTED = ("input", "k", "dark", "blur", "radius", "least_size", "seconds", "output")


def segment(given: Given) -> int:
    """Divide images into N segments of similar color.

    Labels count from 1, dark to bright. Label 0 is left out: pixels that --mask or --nodata name, transparent ones,
    and the background of --objects. If no output is named, the labels of one input go to NAME-labels.png beside it;
    with --write each input gets the outputs listed. Contours are in pixels from the upper left corner, or in the
    coordinates of a GeoTIFF.

    --objects without -k counts objects without settings: noise, uneven light, brightness and size are measured on the
    image, and what was found is in the table that is printed. With --volume, objects are those of the volume, which
    needs the distance of planes: in the file, or by --pixel-size.

    Edges are few and short: details smaller than --smallest-detail are left out. --edge-weight 0 gives each pixel the
    segment of the nearest color.

    Pages of a stack are segmented separately, or together with --volume, which averaging, superpixels and hierarchies
    do not know; outputs in .tif are stacks, too.

    Labels of TIFF files of over 2^26 pixels with -o FILE.tif, and of Zarr arrays, are computed in tiles.
    """
    counts = given.objects and given.number is None
    if given.number is None:
        if not (given.hierarchy or given.objects):
            raise WrongUsageError("-k is needed without --hierarchy and --objects: a number of segments, or auto")
        if counts and (settings := _settings(given)):
            raise WrongUsageError(f"--objects with {settings[0]} needs -k; without, it is measured on the image")
        given.number = None if counts else "auto"
    if given.volume and given.objects and not counts:
        raise WrongUsageError("--objects with --volume takes no -k: what it needs is measured on the volume")
    if given.volume and given.objects and given.properties:
        raise WrongUsageError("--properties are those of images, not of --objects with --volume")
    if given.threshold is not None and given.number != "auto":
        raise WrongUsageError("--threshold and -k N exclude each other")
    given.averaging = _averaging(given)
    given.style = Style.of(given)
    plan = plan_each(given.inputs, outputs_of(given), out_dir=given.out_dir, also_read=[given.mask])
    more = (("elbow",) if given.number == "auto" and not given.hierarchy else ()) + (("tracks",) if given.track else ())
    columns = COUNTED if counts else COLUMNS
    return run_plan(plan, _segment, (*columns[:2], *more, *columns[2:]), given)


def _settings(given: Given) -> list[str]:
    """Return the options that counting without -k does not take, by their names on the command line."""
    usual = {"neck_depth": 0.5, "object_border": "segment", "smallest_detail": 1, "edge_weight": "auto"}
    usual |= {"averaging": "none", "volume_power": 0, "shading": False}
    return [f"--{name.replace('_', '-')}" for name, value in usual.items() if getattr(given, name) != value]


def _averaging(given: Given) -> Averaging | None:
    from cvtimg.segmentation.averaging import Averaging

    try:
        return None if given.averaging == "none" else Averaging(given.averaging, given.kernel, given.radius)
    except ValueError as error:
        raise WrongUsageError(f"--radius: {error}") from error


def _segment(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from cvtimg.segmentation.files import divide_file

    counts = given.number is None
    if _needs_tiles(task):
        return _segment_in_tiles(task, stopwatch, given)
    found = divide_file(
        task.source,
        partial(_divide, given=given),
        mask=given.mask,
        nodata=given.nodata,
        volume=partial(_count_in_volume, given=given) if given.volume and given.objects else given.volume,
        track=given.track,
        apart=given.edge_radius,
        on_pages=partial(check_room, task.outputs),
        on_stage=stopwatch.lap,
    )
    results, first, labels, image = found.results, found.results[0], found.labels, found.images[0]
    axes = found.pages.axes if found.pages else ""
    in_volume = given.volume and given.objects and found.pages is not None
    write_outputs(task, found, given.style, in_volume=in_volume, overwrite=given.overwrite)
    stopwatch.lap("write")
    return {
        "width": image.shape[1],
        "height": image.shape[0],
        "channels": image.shape[2] if image.ndim == 3 else 1,
        **({} if found.pages is None else {"pages": len(found.pages.images)}),
        "left_out": int((labels == 0).sum()),
        "k": (sum if counts else max)(result.n_segments for result in results),
        "elbow": first.curve.elbows() if first.curve and found.pages is None else None,
        **({"tracks": int(labels.max())} if given.track else {}),
        **(asdict(first.counting) if first.counting else {}),
        "edge_weight": first.edge_weight,
        **_shape_of(labels),
        "energy": sum(result.energy for result in results),
        "n_iter": max(len(result.energies) - 1 for result in results),
        "converged": all(result.converged for result in results),
        **({"warning": _OF_PLANES} if given.objects and not in_volume and len(results) > 1 and "Z" in axes else {}),
    }


def _shape_of(labels: NDArray[np.int32]) -> dict[str, int]:
    """Count the connected regions of all pages, and the pixel sides that part them."""
    import numpy as np

    from cvtimg.labels.components import connected_pieces

    regions = sum(int(connected_pieces(page).max()) for page in labels)
    sides = sum(int(np.count_nonzero(np.diff(labels, axis=axis))) for axis in (1, 2))
    return {"regions": regions, "edge_length": sides}


def _divide(image: NDArray[Any], known: NDArray[np.bool_], *, given: Given) -> Segmentation:
    """Segment an image, and change its labels by hand."""
    import cvtimg
    from cvtimg.segmentation import edit_labels
    from cvtimg.segmentation.result import measured

    result = _found(image, known, given)
    if not given.edit:
        return result
    tree = partial(cvtimg.segment_hierarchy, image, mask=known) if result.hierarchy is None else result.hierarchy
    return measured(edit_labels(result.labels, given.edit, hierarchy=tree), image, hierarchy=result.hierarchy)


def _found(image: NDArray[Any], known: NDArray[np.bool_], given: Given) -> Segmentation:
    """Segment an image."""
    import cvtimg
    from cvtimg.segmentation import count_objects
    from cvtimg.segmentation.result import from_cut
    from cvtimg.segmentation.touching import Objects

    if not known.any():
        raise ValueError("has no pixel that counts: all are transparent, without data or left out by the mask")
    options = given.arguments
    if given.hierarchy:
        space = {} if given.space is None else {"space": given.space}
        tree = cvtimg.segment_hierarchy(image, mask=known, **space)
        return from_cut(tree, image, None if given.number == "auto" else given.number, given.threshold)
    if given.superpixels:
        options = {name: value for name, value in options.items() if name in ("space", "compactness")}
        return cvtimg.superpixels(image, given.number, mask=known, **options)
    if given.number is None:
        least = given.min_size or None
        return count_objects(image, background=given.background, min_size=least, mask=known)
    objects = Objects(given.background, given.neck_depth, given.object_border) if given.objects else False
    return cvtimg.segment(image, given.number, mask=known, averaging=given.averaging, objects=objects, **options)


def _count_in_volume(
    volume: NDArray[Any], known: NDArray[np.bool_], spacing: tuple[float, float, float], *, given: Given
) -> Segmentation:
    """Count the objects of a volume."""
    from cvtimg.segmentation import count_objects

    least = given.min_size or None
    return count_objects(volume, spacing=spacing, background=given.background, min_size=least, mask=known)


def _segment_in_tiles(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from cvtimg.pictures.tiles import open_bands
    from cvtimg.segmentation import segment_file

    for option in _needing_memory(given):
        raise ValueError(f"is read in tiles, and {option} needs the whole image in memory")
    if given.max_pixels is not None and open_bands(task.source).form.n_pixels > given.max_pixels:
        raise ValueError(f"has over {given.max_pixels} pixels, the limit that --max-pixels sets")
    options = {name: value for name, value in given.arguments.items() if name in _IN_TILES}
    options |= {"mask": given.mask, "nodata": given.nodata, "overwrite": given.overwrite}
    result = segment_file(task.source, task.output, given.number, **options)
    stopwatch.lap("all")
    return {
        "width": result.shape[1],
        "height": result.shape[0],
        "channels": result.generators.shape[1],
        "left_out": result.shape[0] * result.shape[1] - int(result.masses.sum()),
        "exact": result.exact,
        "k": result.n_segments,
        "edge_weight": result.edge_weight,
        "energy": result.energy,
        "n_iter": len(result.energies) - 1,
        "converged": result.converged,
    }


def _needing_memory(given: Given) -> list[str]:
    """Return the options that need the whole image, by their names on the command line."""
    ways = (
        "superpixels",
        "hierarchy",
        "volume_power",
        "components",
        "min_size",
        "border_price",
        "shading",
        "averaging",
        "objects",
        "edit",
    )
    flags = [f"--{name.replace('_', '-')}" for name in ways if getattr(given, name)]
    return ["-k auto", *flags] if given.number == "auto" else flags


def _needs_tiles(task: Task) -> bool:
    """Return whether to segment in tiles: labels alone of a large image, or any output of a Zarr array."""
    from cvtimg.pictures.formats.stored import is_ngff

    targets = list(task.outputs.values())
    zarr = [path for path in (task.source, *targets) if path.suffix.lower() == ".zarr" and not is_ngff(path)]
    if [kind_of(option) for option in task.outputs] != ["labels"]:
        if zarr:
            raise ValueError(
                f"{zarr[0].name} is read and written in tiles, and only labels can be: leave out the other outputs"
            )
        return False
    from cvtimg.pictures.tiles import needs_tiles

    return needs_tiles(task.source, targets[0])
