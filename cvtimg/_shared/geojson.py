"""Polygons as features of GeoJSON (RFC 7946)."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

_Place = list[float]


def feature(polygons: list[list[list[_Place]]], properties: Mapping[str, Any], **members: Any) -> dict[str, Any]:
    """Return a feature of one or several polygons, each a list of closed rings, the outer one first."""
    kind, places = ("Polygon", polygons[0]) if len(polygons) == 1 else ("MultiPolygon", polygons)
    return {"type": "Feature", **members, "properties": properties, "geometry": {"type": kind, "coordinates": places}}


def collection(
    features: Iterable[Mapping[str, Any]], epsg: int | None = None, members: Mapping[str, Any] = MappingProxyType({})
) -> Iterator[str]:
    """Yield the text of features, a line each; `epsg` names coordinates other than longitude and latitude."""
    system = {"crs": {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{epsg}"}}} if epsg else {}
    head = json.dumps({"type": "FeatureCollection", **system, **members}, separators=(",", ":"))
    yield f'{head[:-1]},"features":[\n'
    for number, content in enumerate(features):
        text = json.dumps(content, separators=(",", ":"), allow_nan=False)
        yield f",\n{text}" if number else text
    yield "\n]}\n"
