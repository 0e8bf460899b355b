"""Segments on disk: labels, tables, COCO annotations, and contours as SVG and GeoJSON; whole or not at all."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from io import StringIO
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_labels
from cvtimg.files.whole import StrPath, whole_file
from cvtimg.labels.contours import Polygon
from cvtimg.labels.figures import run_lengths
from cvtimg.pictures.files import write_image

#: Suffixes of files of labels.
LABEL_SUFFIXES = (".png", ".tif", ".tiff", ".npy")
#: Decimal places of a pixel that places are written with; half of the last is far below the clearance of borders.
PLACE_DIGITS = 4


def write_labels(path: StrPath, labels: ArrayLike, *, overwrite: bool = False) -> None:
    """Write the label of each pixel.

    Parameters
    ----------
    path : str or path-like
        Ends in .png, for labels up to 65535, in .tif or .tiff, or in .npy for an array of int32. A PNG or TIFF has 8
        bits a pixel if the labels are at most 255, else 16, and a TIFF 32 for more than 65535.
    labels : (H, W) integer array
        0 or higher.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_labels(f"{folder}/labels.npy", [[1, 1, 2]])
    ...     np.load(f"{folder}/labels.npy").tolist()
    [[1, 1, 2]]
    """
    numbers = check_labels("labels", labels)
    suffix = check_choice("suffix", Path(path).suffix.lower(), LABEL_SUFFIXES)
    n_bytes = next(size for size in (1, 2, 4) if numbers.max() < 256**size)
    if suffix == ".png" and n_bytes == 4:
        raise ValueError(f"{path}: has labels up to {numbers.max()}, and .png holds 65535; use .tif or .npy")
    write_image(path, numbers if suffix == ".npy" else numbers.astype(f"u{n_bytes}"), overwrite=overwrite)


def write_table(path: StrPath, table: Mapping[str, NDArray[Any]], *, overwrite: bool = False) -> None:
    """Write columns of numbers, as `region_table` returns them, as CSV with a line of names.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_table(f"{folder}/table.csv", {"label": np.array([1, 2]), "area": np.array([12.5, 3.0])})
    ...     print(Path(folder, "table.csv").read_text(), end="")
    label,area
    1,12.5
    2,3
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(zip(*(map(_number, column.tolist()) for column in table.values()), strict=True))
    _write_text(path, [text.getvalue()], overwrite)


def write_coco(path: StrPath, labels: ArrayLike, name: str, *, overwrite: bool = False) -> None:
    """Write a data set of one picture in the format of COCO, which pycocotools reads.

    Parameters
    ----------
    path : str or path-like
        Ends in .json.
    labels : (H, W) integer array
        Region of each pixel; 0 is none.
    name : str
        File name of the picture.
    overwrite : bool
        Replace an existing file.

    Notes
    -----
    Every region is an annotation: its label is the id, its mask the uncompressed run lengths. All are in the one
    category "segment", and none is marked as a crowd, for tools leave crowds out.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_coco(f"{folder}/coco.json", [[1, 1, 2]], "photo.png")
    ...     annotation = json.loads(Path(folder, "coco.json").read_text())["annotations"][1]
    >>> annotation["segmentation"], annotation["bbox"]
    ({'size': [1, 3], 'counts': [2, 1]}, [2, 0, 1, 1])
    """
    numbers = check_labels("labels", labels)
    height, width = numbers.shape
    annotations = [
        {
            "id": label,
            "image_id": 1,
            "category_id": 1,
            "segmentation": {"size": [height, width], "counts": counts},
            "area": sum(counts[1::2]),
            "bbox": _box(counts, height),
            "iscrowd": 0,
        }
        for label, counts in run_lengths(numbers).items()
    ]
    picture = {"id": 1, "file_name": name, "width": width, "height": height}
    categories = [{"id": 1, "name": "segment", "supercategory": "segment"}]
    whole = {"images": [picture], "annotations": annotations, "categories": categories}
    _write_text(path, [json.dumps(whole, separators=(",", ":")), "\n"], overwrite)


def _box(counts: Sequence[int], height: int) -> list[int]:
    """Left, top, width and height of the box around runs down the columns."""
    ends = np.cumsum(counts)
    first, last = ends[: len(counts) // 2 * 2 : 2], ends[1::2] - 1
    left, right = first[0] // height, last[-1] // height
    if (first // height < last // height).any():  # a run that goes on in the next column
        top, bottom = 0, height - 1
    else:
        top, bottom = (first % height).min(), (last % height).max()
    return [int(left), int(top), int(right - left + 1), int(bottom - top + 1)]


def write_svg(
    path: StrPath,
    polygons: Iterable[Polygon],
    colors: NDArray[np.uint8],
    *,
    size: tuple[int, int],
    overwrite: bool = False,
) -> None:
    """Write polygons as a drawing: one path for each label, with its holes left out.

    Parameters
    ----------
    path : str or path-like
        Ends in .svg.
    polygons : iterable of Polygon
        Those of `Contours`, by label.
    colors : (max label + 1, 3) uint8 array
        Color of each label.
    size : (int, int)
        Height and width of the picture.
    overwrite : bool
        Replace an existing file.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg import find_contours
    >>> polygons = find_contours([[1, 1], [1, 1]]).polygons
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_svg(f"{folder}/a.svg", polygons, np.array([[0, 0, 0], [255, 128, 0]], np.uint8), size=(2, 2))
    ...     print(Path(folder, "a.svg").read_text().splitlines()[2])
    <path id="segment-1" fill="#ff8000" stroke="#ff8000" d="M0,0 2,0 2,2 0,2Z"/>
    """
    height, width = size
    # Where polygons share a border, renderers let the background shine through; a thin stroke covers it.
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}">\n'
        '<g fill-rule="evenodd" stroke-width="0.3" stroke-linejoin="round">\n'
    )
    _write_text(path, [head, *_svg_paths(polygons, colors), "</g>\n</svg>\n"], overwrite)


def _svg_paths(polygons: Iterable[Polygon], colors: NDArray[np.uint8]) -> Iterator[str]:
    for label, pieces in groupby(polygons, key=lambda polygon: polygon.label):
        color = "#" + colors[label].tobytes().hex()
        rings = "".join(f"M{_svg_places(ring[:-1])}Z" for polygon in pieces for ring in polygon.rings)
        yield f'<path id="segment-{label}" fill="{color}" stroke="{color}" d="{rings}"/>\n'


def _svg_places(places: NDArray[np.float64]) -> str:
    return " ".join(f"{_number(x)},{_number(y)}" for x, y in places.round(PLACE_DIGITS).tolist())


def write_geojson(
    path: StrPath,
    polygons: Iterable[Polygon],
    properties: Mapping[int, Mapping[str, Any]],
    *,
    transform: ArrayLike | None = None,
    epsg: int | None = None,
    overwrite: bool = False,
) -> None:
    """Write polygons as a FeatureCollection of GeoJSON: one feature for each label.

    Parameters
    ----------
    path : str or path-like
        Ends in .geojson or .json.
    polygons : iterable of Polygon
        Those of `Contours`, by label.
    properties : mapping of int to mapping
        Properties of each label, beside the label.
    transform : (2, 3) array, optional
        From (x, y, 1) in pixels to the coordinates of the file; pixels, with y down, by default.
    epsg : int, optional
        Code of the coordinate system that `transform` leads to, if it is known.
    overwrite : bool
        Replace an existing file.

    Notes
    -----
    Outer rings run counterclockwise in the coordinates that are written, as RFC 7946 asks. That standard knows only
    longitude and latitude; another system is named by the member "crs" of the older standard, which GDAL and QGIS
    read.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg import find_contours
    >>> polygons = find_contours([[1]]).polygons
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_geojson(f"{folder}/a.geojson", polygons, {1: {"area": 1}}, transform=[[30, 0, 600], [0, -30, 900]])
    ...     feature = json.loads(Path(folder, "a.geojson").read_text())["features"][0]
    >>> feature["geometry"]["coordinates"]
    [[[600.0, 900.0], [600.0, 870.0], [630.0, 870.0], [630.0, 900.0], [600.0, 900.0]]]
    """
    matrix = np.eye(2, 3) if transform is None else np.asarray(transform, np.float64)
    features = (
        json.dumps(
            {
                "type": "Feature",
                "properties": {"label": label, **properties[label]},
                "geometry": _geometry(list(pieces), matrix),
            },
            separators=(",", ":"),
            allow_nan=False,
        )
        for label, pieces in groupby(polygons, key=lambda polygon: polygon.label)
    )
    system = f'"crs":{{"type":"name","properties":{{"name":"urn:ogc:def:crs:EPSG::{epsg}"}}}},' if epsg else ""
    head = f'{{"type":"FeatureCollection",{system}"features":[\n'
    _write_text(path, [head, ",\n".join(features), "\n]}\n"], overwrite)


def _geometry(pieces: Sequence[Polygon], matrix: NDArray[np.float64]) -> dict[str, Any]:
    mirrored = np.linalg.det(matrix[:, :2]) < 0
    digits = max(PLACE_DIGITS - math.floor(math.log10(np.abs(matrix[:, :2]).max())), 0)
    drawn = []
    for polygon in pieces:
        rings = [(ring @ matrix[:, :2].T + matrix[:, 2]).round(digits) for ring in polygon.rings]
        drawn.append([ring[:: -1 if mirrored else 1].tolist() for ring in rings])
    if len(drawn) == 1:
        return {"type": "Polygon", "coordinates": drawn[0]}
    return {"type": "MultiPolygon", "coordinates": drawn}


def _number(value: float) -> str:
    """Word a number in as few digits as tell it apart."""
    return str(int(value)) if value == int(value) else repr(value)


def _write_text(path: StrPath, parts: Iterable[str], overwrite: bool) -> None:
    with whole_file(path, overwrite=overwrite) as file:
        for part in parts:
            file.write(part.encode())
