"""``cvtimg segment``: images divided into segments, with their edges, contours and tables."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Row, Stopwatch, Task, WrongUsageError, plan_each
from cvtimg.cli import options
from cvtimg.cli import segment_options as own
from cvtimg.cli.frame import run_plan
from cvtimg.cli.pages import segment_pages
from cvtimg.cli.segment_outputs import Style, Subject, kind_of, outputs_of
from cvtimg.cli.tiled import check_fit, segment_in_tiles
from cvtimg.pictures.known import known_in_all, known_pixels

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.pictures.files import ImageInfo
    from cvtimg.segmentation.averaging import Averaging
    from cvtimg.segmentation.result import Segmentation
    from cvtimg.segmentation.touching import Objects as ObjectOptions

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
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "k", "edge_weight", "energy", "seconds", "output")


def segment(
    inputs: options.Images,
    number: own.Number = None,
    output: own.Labels = None,
    out_dir: own.OutDir = None,
    write: own.Write = "",
    mean: own.Mean = None,
    edges: own.Edges = None,
    overlay: own.Overlay = None,
    contours: own.ContourFile = None,
    table: own.Table = None,
    coco: own.Coco = None,
    edge_mode: own.EdgeMode = "inner",
    line_color: own.LineColor = "#ffff00",
    line_width: own.LineWidth = 1,
    subpixel: own.Subpixel = False,
    simplify: own.Simplify = 0,
    space: options.Space = "rgb",
    averaging: options.Averaging = "none",
    kernel: own.Kernel = "gaussian",
    radius: own.Radius = 2,
    edge_weight: own.EdgeWeight = 0,
    edge_radius: own.EdgeRadius = 3,
    components: own.Components = False,
    min_size: own.MinSize = 0,
    border_price: own.BorderPrice = 0,
    objects: own.Objects = False,
    background: own.Background = "largest",
    neck_depth: own.NeckDepth = 0.5,
    object_border: own.ObjectBorder = "segment",
    properties: own.Properties = "",
    hierarchy: own.Hierarchy = False,
    threshold: own.Threshold = None,
    tree: own.Tree = None,
    strengths: own.Strengths = None,
    cuts: own.Cuts = None,
    superpixels: own.Superpixels = False,
    compactness: own.Compactness = None,
    mask: options.Mask = None,
    nodata: options.NoData = None,
    volume: own.Volume = False,
    volume_power: options.VolumePower = 0,
    effort: options.Effort = "balanced",
    seed: options.Seed = 0,
    skip_existing: options.SkipExisting = False,
    max_pixels: options.MaxPixels = None,
    *,
    reading: options.InputOptions,
    common: options.BatchOptions,
) -> int:
    """Divide images into N segments of similar color.

    Labels count from 1, dark to bright. Label 0 is left out: pixels that --mask or --nodata name, transparent ones,
    and the background of --objects. If no output is named, the labels of one input go to NAME-labels.png beside it;
    with --write each input gets the outputs listed. Contours are in pixels from the upper left corner, or in the
    coordinates of a GeoTIFF.

    Pages of a TIFF are segmented separately, or together with --volume; -o FILE.tif takes the labels of all.

    Labels of TIFF files of over 2^26 pixels with -o FILE.tif, and of Zarr arrays, are computed in tiles.
    """
    from cvtimg import find_images

    if volume:
        _exclude(
            "--volume",
            hierarchy=hierarchy,
            superpixels=superpixels,
            components=components,
            min_size=min_size,
            objects=objects,
        )
        _exclude("--volume", edge_weight=edge_weight, averaging=averaging != "none")
    if number is None:
        if not hierarchy:
            raise WrongUsageError("-k is needed without --hierarchy: a number of segments, or auto")
        number = "auto"
    if threshold is not None and not (hierarchy and number == "auto"):
        raise WrongUsageError("--threshold needs --hierarchy, and excludes -k N")
    if hierarchy:
        _exclude("--hierarchy", superpixels=superpixels, components=components, min_size=min_size, objects=objects)
        _exclude("--hierarchy", averaging=averaging != "none", edge_weight=edge_weight, volume_power=volume_power)
        keywords: dict[str, Any] = {}
    elif superpixels:
        _exclude("--superpixels", averaging=averaging != "none", edge_weight=edge_weight, volume_power=volume_power)
        _exclude("--superpixels", components=components, min_size=min_size, border_price=border_price, objects=objects)
        if number == "auto":
            raise WrongUsageError("-k auto and --superpixels exclude each other")
        keywords = {} if compactness is None else {"compactness": compactness}
    elif compactness is not None:
        raise WrongUsageError("--compactness needs --superpixels")
    elif border_price and not components:
        raise WrongUsageError("--border-price needs --components")
    elif objects and components:
        raise WrongUsageError("--objects and --components exclude each other")
    else:
        keywords = {"volume_power": volume_power, "effort": effort, "rng": seed}
        keywords |= {"edge_weight": edge_weight, "edge_radius": edge_radius}
        keywords |= {"components": components, "min_size": min_size, "border_price": border_price}
        keywords["averaging"] = _averaging(averaging, kernel, radius)
        keywords["objects"] = _objects(background, neck_depth, object_border) if objects else False
    if not hierarchy or space != "rgb":  # a hierarchy has a space of its own by default
        keywords["space"] = space
    how = own.SegmentOptions(number, keywords, superpixels, mask, nodata, volume, hierarchy, threshold)
    style = Style(
        edge_mode=edge_mode,
        line_color=tuple(bytes.fromhex(line_color)[:3]),
        line_width=line_width,
        subpixel=subpixel,
        simplify=simplify,
        ignore=None if objects else 0,
        properties=tuple(filter(None, (name.strip() for name in properties.split(",")))),
    )
    files = {"-o": output, "--mean": mean, "--edges": edges, "--overlay": overlay, "--contours": contours}
    files |= {"--table": table, "--coco": coco, "--tree": tree, "--strengths": strengths, "--cuts": cuts}
    outputs = outputs_of(write, files, hierarchy=hierarchy)
    plan = plan_each(inputs, find_images, outputs, out_dir=out_dir, also_read=[mask])
    columns = (*COLUMNS[:2], "elbow", *COLUMNS[2:]) if number == "auto" and not hierarchy else COLUMNS
    work = partial(_segment, how=how, style=style, overwrite=common.overwrite, max_pixels=max_pixels)
    return run_plan(plan, reading.chosen(work), columns, common, skip_existing=skip_existing, max_pixels=max_pixels)


def _exclude(option: str, **others: Any) -> None:
    """Refuse options that would have no effect together with another."""
    for name, given in others.items():
        if given:
            raise WrongUsageError(f"--{name.replace('_', '-')} and {option} exclude each other")


def _averaging(when: str, kernel: str, radius: float) -> Averaging | None:
    from cvtimg.segmentation.averaging import Averaging

    try:
        return None if when == "none" else Averaging(when, kernel, radius)
    except ValueError as error:
        raise WrongUsageError(f"--radius: {error}") from error


def _objects(background: str, neck_depth: float, border: str) -> ObjectOptions:
    from cvtimg.segmentation.touching import Objects

    return Objects(background, neck_depth, border)


def _segment(
    task: Task, stopwatch: Stopwatch, *, how: own.SegmentOptions, style: Style, overwrite: bool, max_pixels: int | None
) -> Row:
    from cvtimg import read_image
    from cvtimg.pictures import image_info

    if _needs_tiles(task):
        check_fit(task.source, how.unfit, max_pixels)
        given = {**how.in_tiles, "mask": how.mask, "overwrite": overwrite}
        return segment_in_tiles(task, stopwatch, int(how.number), how.nodata, given)
    header = image_info(task.source)
    divide = partial(_divide, how=how, header=header)
    if header.has_pages:
        if [kind_of(option) for option in task.outputs] != ["labels"]:
            raise ValueError("has several pages, of which only labels are written")
        find = partial(known_in_all, header=header, mask=how.mask, nodata=how.nodata, noun="page")
        return segment_pages(task, stopwatch, divide, find, volume=how.volume, overwrite=overwrite)
    image = read_image(task.source)
    stopwatch.lap("read")
    image, result = divide(image, known_pixels(image, header, how.mask, how.nodata))
    stopwatch.lap("cluster")
    Subject(task.source, image, result.labels, header, style, overwrite, result.hierarchy).write(task.outputs)
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
    image: NDArray[Any], known: NDArray[np.bool_], *, how: own.SegmentOptions, header: ImageInfo
) -> tuple[NDArray[Any], Segmentation]:
    """Segment an image; return the bands that count, and the result."""
    if header.has_alpha and image.shape[2:] == (4,):
        image, known = image[:, :, :3], known & (image[:, :, 3] > 0)
    if not known.any():
        raise ValueError("has no pixel that counts: all are transparent, without data or left out by the mask")
    return image, how.segments(image, known)


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
