"""What ``cvtimg mesh`` does when it runs: it reads masks, labels, voxels and polygons, and divides them."""

import json
import re
from dataclasses import asdict
from itertools import compress
from pathlib import Path
from typing import Any
from warnings import warn

import numpy as np
import shapely

import cvtimg
from cvtimg._shared.choices import Options
from cvtimg._shared.types import Array
from cvtimg.cli.running import Given, Row, Stopwatch, Task, plot
from cvtimg.labels.files import one_band, read_labels
from cvtimg.meshes import Mesh, mesh_volume
from cvtimg.meshes.projection import looks_like_degrees
from cvtimg.pictures import image_info, read_pages
from cvtimg.placement import PolygonRegion

POLYGON_SUFFIXES = (".geojson", ".json", ".wkt", ".wkb", ".csv")


def meshed(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    """Divide the input of a task into triangles or tetrahedra, and write what its options name."""
    is_polygon = task.source.suffix.lower() in POLYGON_SUFFIXES
    making = given.arguments
    if is_polygon and given.label is not None:
        raise ValueError("has polygons; --label is for images of labels")
    outlines = {"keep_points": given.keep_points, "snap": given.snap, "simplify": given.simplify}
    outlines["project"] = given.project
    if not is_polygon and (unfit := given.chosen(*outlines)):
        raise ValueError(f"has pixels; {' and '.join(unfit)} is for polygons")
    region = read_region(task.source, given.name_by) if is_polygon else None
    labels, is_mask = (None, False) if is_polygon else read_segments(task.source, given.label)
    if labels is not None and labels.ndim == 3:
        stopwatch.lap("read")
        return _fill(task, stopwatch, labels, is_mask, given)
    sizes = None if given.size is None else read_size(given.size)
    stopwatch.lap("read")
    if labels is None:
        result = cvtimg.mesh_region(region, size=sizes, **outlines, **making)
    elif is_mask:
        result = cvtimg.mesh_region(labels > 0, size=sizes, **making)
    else:
        result = cvtimg.mesh_labels(labels, size=sizes, **making)
    stopwatch.lap("mesh")
    if given.name:
        result = named(result, given.name)
    result.save(task.output, overwrite=given.overwrite)
    image = None if given.over is None else cvtimg.read_image(given.over)
    drawn = result.points, result.triangles, result.qualities, result.edges
    below = {"image": image, "y_down": not is_polygon or image is not None}
    plot(task.outputs.get("--plot"), given, "draw_mesh", *drawn, **below)
    stopwatch.lap("write")
    in_degrees = is_polygon and result.projection is None and task.source.suffix.lower() in (".geojson", ".json")
    if in_degrees and looks_like_degrees(result.points):
        warn("degrees are taken as lengths; --project auto meshes in km", stacklevel=1)
    return {**result.summary(), **(asdict(result.measures()) if given.measures else {})}


def _fill(task: Task, stopwatch: Stopwatch, voxels: Array, is_mask: bool, given: Given) -> Row:
    if unfit := given.chosen("size", "plot", "grade", "min_size", "order", "periodic", "name"):
        raise ValueError(f"has voxels, to which {' and '.join(unfit)} cannot be applied")
    result = mesh_volume(voxels > 0 if is_mask else voxels, n=given.n, edge_length=given.edge_length)
    stopwatch.lap("mesh")
    result.save(task.output, overwrite=given.overwrite)
    stopwatch.lap("write")
    if not given.measures:
        return result.summary()
    labels = {tag: asdict(measures) for tag, measures in result.measures_by_label().items()}
    return {**result.summary(), **asdict(result.measures()), "labels": labels}


def read_region(path: Path, name_by: str) -> Any:
    """Read polygons: GeoJSON, well-known text or binary, or a ring as a table with columns x and y.

    Features of GeoJSON with a property `name_by` are joined by its value, as a word.
    """
    suffix = path.suffix.lower()
    try:
        if suffix == ".wkb":
            return shapely.from_wkb(path.read_bytes(), on_invalid="fix")
        text = path.read_text(encoding="utf-8-sig")
        if suffix == ".wkt":
            return shapely.from_wkt(text, on_invalid="fix")
        if suffix == ".csv":
            lines = [line for line in text.splitlines() if line.strip()]
            has_names = any(letter.isalpha() for letter in lines[0].replace("e", ""))
            return np.loadtxt(lines[has_names:], delimiter=",", usecols=(0, 1), ndmin=2)
        return _parts(json.loads(text), name_by)
    except (ValueError, UnicodeDecodeError, IndexError, shapely.errors.ShapelyError) as error:
        raise ValueError(f"is not a {suffix} file of polygons: {error}") from error


def _parts(shape: object, name_by: str) -> Any:
    """Return GeoJSON as it is, or, if all features have names, a dict of these and of polygons."""
    features = shape.get("features", [shape]) if isinstance(shape, dict) else []
    properties = [feature.get("properties") or {} for feature in features]
    names = [_named(name_by, each) for each in properties]
    if not names or None in names:
        known = sorted({key for each in properties for key in each})
        if known and (len(names) > 1 or name_by != "name"):
            n_named = len(names) - names.count(None)
            word = f"only {n_named} of {len(names)} features have the property {name_by}"
            warn(f"{word}: they are one region; --name-by takes {', '.join(known)}", stacklevel=1)
        return shape
    words = [re.sub(r"[^\w-]+", "_", str(name)) for name in names]
    words = [word if word[:1].isalpha() else f"_{word}" for word in words]
    return {
        word: PolygonRegion({"type": "FeatureCollection", "features": [*compress(features, map(word.__eq__, words))]})
        for word in dict.fromkeys(words)
    }


def _named(name_by: str, properties: Options) -> Any:
    """Return the property of this name, or of one that differs in capitals only; None if there is none."""
    alike = {key.lower(): value for key, value in properties.items()}
    return properties.get(name_by, alike.get(name_by.lower()))


def read_segments(path: Path, label: int | None) -> tuple[Array, bool]:
    """Read labels, and tell whether they are a mask: no other values than 0 and one more, or those of one label."""
    no_labels = f"is no mask and no labels; divide it first: cvtimg segment {path} -o labels.png"
    try:
        labels = voxels if (voxels := _voxels(path)) is not None else read_labels(path)
    except TypeError as error:  # floating point
        raise ValueError(no_labels) from error
    if label is not None:
        if not (labels == label).any():
            raise ValueError(f"holds no label {label}")
        return labels == label, True
    # Labels in pieces of three pixels across differ as often; a photograph with noise does so more often.
    if np.count_nonzero(labels[..., 1:] != labels[..., :-1]) > labels.size / 3:
        raise ValueError(no_labels)
    values = np.unique(labels)
    return labels, len(values) <= 2 and values[0] == 0


def _voxels(path: Path) -> Array | None:
    """Read a stack of labels (D, H, W): a file of several pages, or an array of three dimensions; None of others."""
    is_array = path.suffix.lower() == ".npy"
    if not is_array and image_info(path).kind != "pages":
        return None
    values: Array = np.load(path) if is_array else np.stack(read_pages(path).images)
    if is_array and values.ndim != 3:
        return None
    values = one_band(values) if values.ndim == 4 else values
    if values.ndim != 3 or values.dtype.kind not in "bui":
        raise ValueError(f"has voxels of shape {values.shape} and type {values.dtype}, neither a mask nor labels")
    return values


def read_size(path: Path) -> Array:
    """Read a gray image of sizes, with the values that the file has."""
    size = cvtimg.read_image(path)
    if size.ndim == 3 and (size[..., :3] != size[..., :1]).any():
        raise ValueError(f"--size {path} must be a gray image; this one has colors")
    return size[..., 0] if size.ndim == 3 else size


def named(mesh: Mesh, names: list[tuple[str, list[float]]]) -> Mesh:
    """Name regions by their labels, and the edges of borders whose middles are in boxes."""
    slack = 1e-9 * float(np.ptp(mesh.points, axis=0).max())
    regions = {int(numbers[0]): name for name, numbers in names if len(numbers) == 1}
    boxes = {name: np.sort(np.reshape(numbers, (2, 2)), axis=0) for name, numbers in names if len(numbers) == 4}
    borders = {
        name: lambda places, box=box: ((places >= box[0] - slack) & (places <= box[1] + slack)).all(axis=1)
        for name, box in boxes.items()
    }
    if len(regions) + len(borders) < len(names):
        raise ValueError("--name must have each name and each label once")
    known = {tag: name for (of, tag), name in mesh.names.items() if of == 2}
    return mesh.named(regions=known | regions, borders=borders)
