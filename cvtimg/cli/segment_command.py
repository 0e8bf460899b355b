"""``cvtimg segment``: images divided into segments, with their edges, contours and tables."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from cvtimg._shared.budgets import MAX_COLORS
from cvtimg.batch.plans import Pattern, check_suffix
from cvtimg.cli.running import Given, Row, Stopwatch, Task, Todo, WrongUsageError, only, plan_of, planned
from cvtimg.options.segment_options import HIERARCHY_KINDS, KINDS, OF_LINES, kind_of

if TYPE_CHECKING:
    from cvtimg.segmentation.result import Segmentation

EXAMPLES = """\
  cvtimg segment photo.jpg --overlay regions.png
  cvtimg segment bone.png -k 2 --edges edges.png --overlay overlay.png
  cvtimg segment nuclei.tif --objects --overlay outlines.png --table nuclei.csv
  cvtimg segment stack.tif --objects --volume -o labels.tif --table cells.csv
  cvtimg segment cells.tif -k 2 --smallest-detail 2 --objects --min-size 30 --table cells.csv
  cvtimg segment scene.tif -k 5 --nodata 0 --contours scene.geojson
  cvtimg segment photo.jpg -k 6 --averaging 2 --subpixel --contours poster.svg
  cvtimg segment photo.jpg -k 400 --superpixels --overlay cells.png
  cvtimg segment photo.jpg --hierarchy --overlay regions.png --strengths edges.png --tree photo.npz
  cvtimg segment photo.jpg --hierarchy --strongest 60 --simplify 1 --contours lines.svg
  cvtimg segment slides/ -k 3 --out-dir out --write labels,overlay,table,contours.geojson
"""
#: Arguments of `segment` that do not need the whole image at a time, and options that do.
_IN_TILES = ("space", "smallest_detail", "edge_weight", "edge_radius", "effort", "rng")
_WHOLE = ("superpixels", "hierarchy", "volume_power", "components", "min_size", "shading", "averaging",
          "objects", "edit")  # fmt: skip
#: Options that counting without -k does not take.
_MEASURED = ("smallest_detail", "edge_weight", "averaging", "volume_power", "shading")
COLUMNS = ("input", "k", "edge_weight", "regions", "edge_length", "seconds", "output")
#: Modules that tasks import.
_LATE = ("cvtimg.cli.segment_outputs", "cvtimg.segmentation.segments", "skimage.measure._label", "scipy.optimize")
_OF_PLANES = "objects are those of each plane by itself; --volume finds them in three dimensions"
#: Options that only counting without -k takes.
_COUNTED = ("diameter", "min_contrast", "exclude_edges")
#: Columns where objects are counted: what was measured.
COUNTED = ("input", "k", "dark", "blur", "radius", "least_size", "seconds", "output")


def segment(given: Given) -> Todo:
    """Divide images into N segments of similar color, or into regions.

    With -k N, pixels of similar color are a segment, wherever they are. Without it, a segment is a connected region as
    a person would draw it, as with --hierarchy.

    Labels count from 1, dark to bright. Label 0 is left out: pixels that --mask or --nodata name, transparent ones,
    and the background of --objects. If no output is named, labels of one input go to NAME-labels.png beside it, those
    of a stack to NAME-labels.tif; with --write each input gets the outputs listed. Contours are in pixels from the
    upper left corner, or in the coordinates of a GeoTIFF.

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
        given.hierarchy = given.hierarchy or not given.objects
        of_colors = [name for name, option in given.options.items() if "hierarchy" in option.excludes]
        if given.hierarchy and (settings := given.chosen("volume", *of_colors)):
            raise WrongUsageError(f"{settings[0]} needs -k: a number of segments, or auto")
        if counts and (settings := given.chosen(*_MEASURED)):
            raise WrongUsageError(f"--objects with {settings[0]} needs -k; without, it is measured on the image")
        given.number = None if counts else "auto"
    _check(given, counts)
    outputs = outputs_of(given)
    plan = plan_of(given, more=outputs, joined=("--table",))
    more = (("elbow",) if given.number == "auto" and not given.hierarchy else ()) + (("tracks",) if given.track else ())
    columns = COUNTED if counts else COLUMNS
    columns = (*columns[:2], *more, *columns[2:])
    if given.table:
        from cvtimg.cli.segment_outputs import JointTable

        return planned(plan, _segment, JointTable(given.table, plan, columns, given), given, late=_LATE)
    return planned(plan, _segment, columns, given, late=_LATE)


def outputs_of(given: Given) -> dict[str, Path | Pattern]:
    """Name the outputs of each image, by option."""
    kinds = KINDS | HIERARCHY_KINDS if given.hierarchy else KINDS
    outputs: dict[str, Path | Pattern] = {}
    for item in given.write or ():
        kind, dot, end = item.partition(".")
        if kind not in kinds:
            needs = " without --hierarchy" if kind in HIERARCHY_KINDS else ""
            raise WrongUsageError(f"--write: {kind!r} must be one of {', '.join(kinds)}{needs}")
        suffix = dot + end.lower() if dot else kinds[kind][0]
        check_suffix(f"--write {kind}", Path(f"{kind}{suffix}"), kinds[kind])
        outputs[f"--write {kind}{suffix}"] = f"{{}}-{kind}{suffix}"
    for kind in kinds:
        if path := given.output if kind == "labels" else getattr(given, kind):
            outputs["-o" if kind == "labels" else f"--{kind}"] = path
    return outputs or {"-o": _name_of_labels}


def _name_of_labels(source: Path) -> str:
    """Return the pattern of an output that is not named: one file for all pages."""
    from cvtimg.pictures import image_info

    with suppress(OSError):  # which is told when the file is read
        if source.suffix.lower() in (".tif", ".tiff") and image_info(source).kind == "pages":
            return "{}-labels.tif"
    return "{}-labels.png"


def _check(given: Given, counts: bool) -> None:
    """Refuse what no option can tell by itself; `counts` is whether objects are counted."""
    if not counts and (settings := given.chosen(*_COUNTED)):
        raise WrongUsageError(f"{settings[0]} takes no -k: objects are counted without")
    if given.volume and given.objects and not counts:
        raise WrongUsageError("--objects with --volume takes no -k: what it needs is measured on the volume")
    if given.volume and given.objects and given.properties:
        raise WrongUsageError("--properties are those of images, not of --objects with --volume")
    if given.threshold is not None and given.number != "auto":
        raise WrongUsageError("--threshold and -k N exclude each other")
    if given.number != "auto" and (given.number or 0) > MAX_COLORS and not given.superpixels:
        raise WrongUsageError(f"-k: '{given.number}' must be auto or a whole number in 1..{MAX_COLORS}")
    contours = [str(path) for option, path in outputs_of(given).items() if kind_of(option) == "contours"]
    if (of_lines := given.chosen(*OF_LINES)) and not (contours and all(not path.endswith(".zip") for path in contours)):
        raise WrongUsageError(f"{of_lines[0]} needs --contours as .svg or .geojson")


def _segment(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from cvtimg.cli.segment_outputs import check_room, write_outputs
    from cvtimg.pictures import open_stack
    from cvtimg.segmentation.files import divide_stack

    if not given.table and _needs_tiles(task):
        return _segment_in_tiles(task, stopwatch, given)
    stack = open_stack(task.source, given.mask, given.nodata, frames=False)
    check_room(task.outputs, len(stack.known))
    stopwatch.lap("read")
    in_volume = given.volume and given.objects
    ways = {"together": given.volume, "volumes": in_volume, "track": given.track, "apart": given.edge_radius}
    divided = divide_stack(stack, partial(_way(given), **_detail(task, given)), **ways, edits=given.edit)
    stopwatch.lap("cluster")
    table = write_outputs(task, divided, given, in_volume=in_volume)
    stopwatch.lap("write")
    image, pages = divided.images[0], divided.pages
    by_planes = given.objects and not in_volume and pages is not None and "Z" in pages.axes
    return {
        "width": image.shape[1],
        "height": image.shape[0],
        "channels": image.shape[2] if image.ndim == 3 else 1,
        **({} if pages is None else {"pages": len(pages.images)}),
        **divided.summary(),
        **({"_table": table} if given.table else {}),
        **({} if task.outputs else {"output": str(given.table)}),
        **({"tracks": int(divided.labels.max())} if given.track else {}),
        **({"warning": _OF_PLANES} if by_planes else {}),
    }


def _way(given: Given) -> Callable[..., Segmentation]:
    """Return the function that divides an image, with its options."""
    import cvtimg
    from cvtimg.segmentation import Objects, count_objects
    from cvtimg.segmentation.files import by_tree

    options = given.arguments
    if given.hierarchy:
        space = {} if given.space is None else {"space": given.space}
        number = None if given.number == "auto" else given.number
        return partial(by_tree, n_regions=number, threshold=given.threshold, **space)
    if given.superpixels:
        return partial(cvtimg.superpixels, n_superpixels=given.number, **only(options, ("space", "compactness")))
    if given.number is None:
        chosen_depth = given.neck_depth if given.chosen("neck_depth") else None
        measured = {name: getattr(given, name) for name in ("background", *_COUNTED)}
        depth = math.inf if given.no_split else chosen_depth
        return partial(count_objects, min_size=given.min_size or None, neck_depth=depth, **measured)
    neck_depth = math.inf if given.no_split else given.neck_depth
    objects = Objects(given.background, neck_depth) if given.objects else False
    return partial(cvtimg.segment, n_segments=given.number, objects=objects, **options)


def _detail(task: Task, given: Given) -> dict[str, float]:
    """Return the smallest detail, or the diameter of objects, in pixels if it is given in another unit."""
    from cvtimg.pictures import PixelSize, image_info

    name = "diameter" if given.number is None else "smallest_detail"
    if not isinstance(length := getattr(given, name), PixelSize):
        return {}
    if (size := image_info(task.source).pixel_size) is None:
        raise ValueError(f"does not say the size of its pixels, for --{name.replace('_', '-')}; --pixel-size names it")
    return {name: size.pixels(length)}


def _segment_in_tiles(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from cvtimg.segmentation import segment_file

    for option in (["-k auto"] if given.number == "auto" else []) + given.chosen(*_WHOLE):
        raise ValueError(f"is read in tiles, and {option} needs the whole image in memory")
    options = only(given.arguments, _IN_TILES)
    options |= {"mask": given.mask, "nodata": given.nodata, "overwrite": given.overwrite, **_detail(task, given)}
    result = segment_file(task.source, task.output, given.number, max_pixels=given.max_pixels, **options)
    stopwatch.lap("all")
    size = {"width": result.shape[1], "height": result.shape[0], "channels": result.generators.shape[1]}
    return {**size, **result.summary()}


def _needs_tiles(task: Task) -> bool:
    """Return whether to segment in tiles: labels alone of a large image, or any output of a Zarr array."""
    from cvtimg.pictures.formats.stored import is_stored

    targets = list(task.outputs.values())
    zarr = [path for path in (task.source, *targets) if path.suffix.lower() == ".zarr" and not is_stored(path)]
    if [kind_of(option) for option in task.outputs] != ["labels"]:
        if zarr:
            only_labels = "is read and written in tiles, and only labels can be: leave out the other outputs"
            raise ValueError(f"{zarr[0].name} {only_labels}")
        return False
    from cvtimg.pictures.tiles import needs_tiles

    return needs_tiles(task.source, targets[0])
