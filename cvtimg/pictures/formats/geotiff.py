"""Georeferencing of TIFF files: read GeoTIFF tags, and copy them from file to file."""

from collections.abc import Mapping
from contextlib import suppress
from enum import IntEnum
from typing import Any, NamedTuple, Self, TypeAlias

from PIL.ExifTags import Base

#: Tags of a TIFF by their code.
Tags = Mapping[int, Any]
#: Tags in `GEO_TYPES`, which georeference an upright image; empty if a file has no georeferencing.
GeoTags: TypeAlias = Mapping[int, Any]


class GeoTag(IntEnum):
    """Tags of GeoTIFF, and that of GDAL for missing pixels."""

    PIXEL_SCALE, TIEPOINT, MATRIX, KEYS = 33550, 33922, 34264, 34735
    DOUBLES, TEXT = 34736, 34737  # values of keys
    NODATA = 42113


class _GeoKey(IntEnum):
    """Keys in `GeoTag.KEYS`, and some of their values."""

    MODEL_TYPE, RASTER_TYPE, GEOGRAPHIC, PROJECTED, LINEAR_UNITS = 1024, 1025, 2048, 3072, 3076
    PIXEL_IS_POINT, USER_DEFINED, IS_PROJECTED, METER = 2, 32767, 1, 9001


#: Types of the values of these tags, as in Python's struct.
GEO_TYPES: dict[int, str] = dict.fromkeys(map(int, GeoTag), "d")
GEO_TYPES |= {GeoTag.KEYS: "H", GeoTag.TEXT: "s", GeoTag.NODATA: "s"}


class Place(NamedTuple):
    """Georeferencing of an image, from GeoTIFF tags, as `ImageInfo` has it; None for what the file does not state."""

    geo_transform: tuple[float, float, float, float, float, float] | None
    epsg: int | None
    nodata: float | None

    @classmethod
    def of(cls, tags: Tags) -> Self:
        """Read the tags of a page; damaged tags are ignored."""
        keys = _keys(tags)
        transform = epsg = nodata = None
        code = keys.get(_GeoKey.PROJECTED, keys.get(_GeoKey.GEOGRAPHIC, 0))
        epsg = code if 0 < code < _GeoKey.USER_DEFINED else None
        with suppress(TypeError, ValueError, IndexError):
            # Rotated maps are rare, and the transform in the file does not apply to the upright image.
            if tags.get(Base.Orientation, 1) == 1:
                transform = _transform(tags, point=keys.get(_GeoKey.RASTER_TYPE) == _GeoKey.PIXEL_IS_POINT)
        with suppress(TypeError, ValueError):
            nodata = float(str(tags[GeoTag.NODATA]).strip("\0 ")) if GeoTag.NODATA in tags else None
        return cls(transform, epsg, nodata)


def _keys(tags: Tags) -> dict[int, int]:
    """Return the keys whose values are numbers in the tag of keys; none if that is damaged."""
    with suppress(TypeError, ValueError, IndexError):
        flat = [int(value) for value in tags.get(GeoTag.KEYS, ())]
        return {flat[at]: flat[at + 3] for at in range(4, len(flat) - 3, 4) if flat[at + 1] == 0}
    return {}


def is_in_meters(tags: Tags) -> bool:
    """Whether map coordinates are meters of a projection: where the file says so, and in UTM."""
    keys = _keys(tags)
    in_utm = keys.get(_GeoKey.PROJECTED, 0) // 100 in (326, 327)
    unit = keys.get(_GeoKey.LINEAR_UNITS, _GeoKey.METER if in_utm else 0)
    return keys.get(_GeoKey.MODEL_TYPE) == _GeoKey.IS_PROJECTED and unit == _GeoKey.METER


def geo_tags(tags: Tags) -> dict[int, Any]:
    """Return the georeferencing tags of an upright image; empty if they are incomplete."""
    if Place.of(tags).geo_transform is None:
        return {}
    given = {code: tags[code] for code in GEO_TYPES if code in tags and code != GeoTag.NODATA}
    # A single value, other than text, becomes a tuple.
    return {code: value if isinstance(value, (tuple, str)) else (value,) for code, value in given.items()}


def extra_tags(geo: GeoTags, nodata: float | None = None) -> list[tuple[int, str, int, Any, bool]]:
    """Format tags for tifffile."""
    given = dict(geo)
    if nodata is not None:
        given[GeoTag.NODATA] = f"{nodata:.17g}"
    counts = {code: 0 if isinstance(value, str) else len(value) for code, value in given.items()}
    return [(code, GEO_TYPES[code], counts[code], value, True) for code, value in given.items()]


def _transform(tags: Tags, *, point: bool) -> tuple[float, float, float, float, float, float] | None:
    if GeoTag.MATRIX in tags:
        matrix = [float(value) for value in tags[GeoTag.MATRIX]]
        a, b, c, d, e, f = (matrix[at] for at in (0, 1, 3, 4, 5, 7))
    elif GeoTag.PIXEL_SCALE in tags and GeoTag.TIEPOINT in tags:
        column, row, _, x, y, _ = (float(value) for value in tags[GeoTag.TIEPOINT][:6])
        a, b, d = float(tags[GeoTag.PIXEL_SCALE][0]), 0.0, 0.0
        e = -float(tags[GeoTag.PIXEL_SCALE][1])
        c, f = x - a * column, y - e * row
    else:
        return None
    half = 0.5 if point else 0.0  # the coordinates in the file are those of pixel centers
    return a, b, c - half * (a + b), d, e, f - half * (d + e)
