"""Contours as GeoJSON: polygons for GIS programs."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, groupby

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.choices import Json, Options
from cvtimg._shared.geojson import collection, feature
from cvtimg._shared.types import Floats
from cvtimg.files.whole import StrPath, write_text
from cvtimg.labels.contours import Polygon
from cvtimg.labels.formats import PLACE_DIGITS, Drawing


def write(path: StrPath, drawings: Sequence[Drawing], overwrite: bool) -> None:
    """Write a FeatureCollection with a feature for each label or line, in the coordinates of the map if there is one.

    Outer rings run counterclockwise in these coordinates, as RFC 7946 requires. That standard allows only longitude and
    latitude; other systems are named by the member "crs" of the older standard, which GDAL and QGIS read.
    """
    features = (_features(each) if each.chances is None else _lines(each, each.chances) for each in drawings)
    unit = {"unit": drawings[0].unit} if drawings[0].unit else {}
    content = collection(chain.from_iterable(features), drawings[0].epsg, unit)
    write_text(path, content, overwrite=overwrite)


def write_geojson(
    path: StrPath, polygons: Iterable[Polygon], properties: Mapping[int, Options], *, overwrite: bool = False
) -> None:
    """Write polygons with the properties of each label, in pixels."""
    drawing = Drawing(tuple(polygons), (0, 0), np.empty((0, 3), np.uint8), properties)
    write_text(path, collection(_features(drawing)), overwrite=overwrite)


def _features(drawing: Drawing) -> Iterator[Json]:
    matrix, digits = _map_of(drawing.transform)
    for label, pieces in groupby(drawing.polygons, key=lambda polygon: polygon.label):
        yield feature(_placed(pieces, matrix, digits), {"label": label, **drawing.place, **drawing.properties[label]})


def _lines(drawing: Drawing, chances: Floats) -> Iterator[Json]:
    matrix, digits = _map_of(drawing.transform)
    for line, chance in zip(drawing.lines, np.round(chances, 4).tolist(), strict=True):
        places = (line @ matrix[:, :2].T + matrix[:, 2]).round(digits).tolist()
        geometry = {"type": "LineString", "coordinates": places}
        yield {"type": "Feature", "properties": {"chance": chance, **drawing.place}, "geometry": geometry}


def _map_of(transform: ArrayLike | None) -> tuple[Floats, int]:
    """Return the matrix (2, 3) from pixels to coordinates of the file, and how many decimals these have."""
    matrix = np.eye(2, 3) if transform is None else np.asarray(transform, np.float64)
    return matrix, max(PLACE_DIGITS - math.floor(math.log10(np.abs(matrix[:, :2]).max())), 0)


def _placed(pieces: Iterable[Polygon], matrix: Floats, digits: int) -> list[list[list[list[float]]]]:
    """Map rings to the coordinates of the file, and keep their sense there."""
    mirrored = np.linalg.det(matrix[:, :2]) < 0
    placed = [[(ring @ matrix[:, :2].T + matrix[:, 2]).round(digits) for ring in piece.rings] for piece in pieces]
    return [[ring[:: -1 if mirrored else 1].tolist() for ring in rings] for rings in placed]
