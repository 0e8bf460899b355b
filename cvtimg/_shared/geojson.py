"""Polygons as features of GeoJSON (RFC 7946)."""

import json
from collections.abc import Iterable, Iterator
from types import MappingProxyType

from cvtimg._shared.choices import Json, Options

_Place = list[float]


def feature(polygons: list[list[list[_Place]]], properties: Options, **members: object) -> Json:
    """Return a feature of one or several polygons, each a list of closed rings, the outer one first."""
    kind, places = ("Polygon", polygons[0]) if len(polygons) == 1 else ("MultiPolygon", polygons)
    return {"type": "Feature", **members, "properties": properties, "geometry": {"type": kind, "coordinates": places}}


def collection(
    features: Iterable[Options], epsg: int | None = None, members: Options = MappingProxyType({})
) -> Iterator[str]:
    """Yield the text of features, a line each; `epsg` names coordinates other than longitude and latitude."""
    system = {"crs": {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{epsg}"}}} if epsg else {}
    head = json.dumps({"type": "FeatureCollection", **system, **members}, separators=(",", ":"))
    yield f'{head[:-1]},"features":[\n'
    for number, content in enumerate(features):
        text = json.dumps(content, separators=(",", ":"), allow_nan=False)
        yield f",\n{text}" if number else text
    yield "\n]}\n"
