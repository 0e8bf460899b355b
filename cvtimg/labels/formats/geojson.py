"""Contours as GeoJSON: polygons for GIS programs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, groupby
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.geojson import collection, feature
from cvtimg.files.whole import StrPath, write_text
from cvtimg.labels.contours import Polygon
from cvtimg.labels.formats import PLACE_DIGITS, Drawing


def write(path: StrPath, drawings: Sequence[Drawing], overwrite: bool) -> None:
    """Write the polygons of drawings with their properties, in the coordinates of their map if they have one."""
    features = (_features(one.polygons, one.properties, one.transform, one.place) for one in drawings)
    _write(path, chain.from_iterable(features), drawings[0].epsg, drawings[0].unit, overwrite)


def write_geojson(
    path: StrPath,
    polygons: Iterable[Polygon],
    properties: Mapping[int, Mapping[str, Any]],
    *,
    transform: ArrayLike | None = None,
    epsg: int | None = None,
    unit: str = "",
    overwrite: bool = False,
) -> None:
    """Write polygons as a GeoJSON FeatureCollection with one feature per label.

    Parameters
    ----------
    path : str or path-like
        Ends in .geojson or .json.
    polygons : iterable of Polygon
        Polygons of `Contours`, by label.
    properties : mapping of int to mapping
        Properties of each label, in addition to the label itself.
    transform : (2, 3) array, optional
        Maps (x, y, 1) in pixels to the coordinates of the file; by default these are pixels, with y down.
    epsg : int, optional
        Code of the coordinate system of these coordinates, if it is known.
    unit : str
        Unit of these coordinates, such as "um"; it stands as a member "unit" of the collection.
    overwrite : bool
        Replace an existing file.

    Notes
    -----
    Outer rings run counterclockwise in the coordinates of the file, as RFC 7946 requires. That standard allows only
    longitude and latitude; other systems are named by the member "crs" of the older standard, which GDAL and QGIS
    read.

    Examples
    --------
    >>> import json
    >>> import tempfile
    >>> from pathlib import Path
    >>> from cvtimg import find_contours
    >>> polygons = find_contours([[1]]).polygons
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_geojson(f"{folder}/a.geojson", polygons, {1: {"area": 1}}, transform=[[30, 0, 600], [0, -30, 900]])
    ...     feature = json.loads(Path(folder, "a.geojson").read_text())["features"][0]
    >>> feature["geometry"]["coordinates"]
    [[[600.0, 900.0], [600.0, 870.0], [630.0, 870.0], [630.0, 900.0], [600.0, 900.0]]]
    """
    _write(path, _features(polygons, properties, transform), epsg, unit, overwrite)


def _write(path: StrPath, features: Iterable[dict[str, Any]], epsg: int | None, unit: str, overwrite: bool) -> None:
    write_text(path, collection(features, epsg, {"unit": unit} if unit else {}), overwrite=overwrite)


def _features(
    polygons: Iterable[Polygon],
    properties: Mapping[int, Mapping[str, Any]],
    transform: ArrayLike | None,
    place: Mapping[str, int] = MappingProxyType({}),
) -> Iterator[dict[str, Any]]:
    """Yield a feature for each label."""
    matrix = np.eye(2, 3) if transform is None else np.asarray(transform, np.float64)
    for label, pieces in groupby(polygons, key=lambda polygon: polygon.label):
        yield feature(_placed(pieces, matrix), {"label": label, **place, **properties[label]})


def _placed(pieces: Iterable[Polygon], matrix: NDArray[np.float64]) -> list[list[list[list[float]]]]:
    """Map rings to the coordinates of the file, and keep their sense there."""
    mirrored = np.linalg.det(matrix[:, :2]) < 0
    digits = max(PLACE_DIGITS - math.floor(math.log10(np.abs(matrix[:, :2]).max())), 0)
    placed = [[(ring @ matrix[:, :2].T + matrix[:, 2]).round(digits) for ring in piece.rings] for piece in pieces]
    return [[ring[:: -1 if mirrored else 1].tolist() for ring in rings] for rings in placed]
