"""Features of GeoJSON (RFC 7946): polygons as these, and shapes of those that are read."""

import json
from collections.abc import Iterable, Iterator
from types import MappingProxyType

from cvtimg._shared.choices import Json, Options
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Array

_Place = list[float]


def feature(polygons: list[list[list[_Place]]], properties: Options, **members: object) -> Json:
    """Return a feature of one or several polygons, each a list of closed rings, the outer one first."""
    kind, places = ("Polygon", polygons[0]) if len(polygons) == 1 else ("MultiPolygon", polygons)
    return {"type": "Feature", **members, "properties": properties, "geometry": {"type": kind, "coordinates": places}}


def shapes_of(content: Options) -> Array:
    """Return the points, lines and polygons (S,) of GeoJSON, each by itself, in the plane; features may have none."""
    features = [feature.get("geometry", feature) for feature in content.get("features", [content])]
    # Reading them one by one closes rings that rounding or their writer left open.
    shapes = [shapely.geometry.shape(feature) for feature in features if feature]
    return shapely.force_2d(shapely.get_parts(shapely.get_parts(shapes)))


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
