"""Georeferencing of TIFF files: read GeoTIFF tags, and copy them from file to file."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeAlias

from PIL.ExifTags import Base

#: Tags of a TIFF by their code.
Tags = Mapping[int, Any]
#: Tags in `GEO_TYPES`, which georeference an upright image; empty if a file has no georeferencing.
GeoTags: TypeAlias = Mapping[int, Any]

NODATA = 42113
_PIXEL_SCALE, _TIEPOINT, _MATRIX, _GEO_KEYS = 33550, 33922, 34264, 34735
#: Georeferencing tags, with the types of their values in TIFF and in Python's struct.
GEO_TYPES = {
    _PIXEL_SCALE: (12, "d"),
    _TIEPOINT: (12, "d"),
    _MATRIX: (12, "d"),
    _GEO_KEYS: (3, "H"),
    34736: (12, "d"),
    34737: (2, "s"),
}
_RASTER_TYPE, _GEOGRAPHIC, _PROJECTED = 1025, 2048, 3072
_PIXEL_IS_POINT = 2
_USER_DEFINED = 32767


@dataclass(frozen=True, slots=True)
class Place:
    """Georeferencing of an image, from GeoTIFF tags, as `ImageInfo` has it; None for what the file does not state."""

    geo_transform: tuple[float, float, float, float, float, float] | None
    epsg: int | None
    nodata: float | None

    @classmethod
    def of(cls, tags: Tags) -> Place:
        """Read the tags of a page; damaged tags are ignored."""
        keys: dict[int, int] = {}
        transform = epsg = nodata = None
        with suppress(TypeError, ValueError, IndexError):
            flat = [int(value) for value in tags.get(_GEO_KEYS, ())]
            keys = {flat[at]: flat[at + 3] for at in range(4, len(flat) - 3, 4) if flat[at + 1] == 0}
        code = keys.get(_PROJECTED, keys.get(_GEOGRAPHIC, _USER_DEFINED))
        epsg = code if 0 < code < _USER_DEFINED else None
        with suppress(TypeError, ValueError, IndexError):
            # Rotated maps are rare, and the transform in the file does not apply to the upright image.
            if tags.get(Base.Orientation, 1) == 1:
                transform = _transform(tags, point=keys.get(_RASTER_TYPE) == _PIXEL_IS_POINT)
        with suppress(TypeError, ValueError):
            nodata = float(str(tags[NODATA]).strip("\0 ")) if NODATA in tags else None
        return cls(transform, epsg, nodata)


def geo_tags(tags: Tags) -> dict[int, Any]:
    """Return the georeferencing tags of an upright image; empty if they are incomplete."""
    if Place.of(tags).geo_transform is None:
        return {}
    given = {code: tags[code] for code in GEO_TYPES if code in tags}
    # A single value, other than text, becomes a tuple.
    return {code: value if isinstance(value, (tuple, str)) else (value,) for code, value in given.items()}


def extra_tags(geo: GeoTags, nodata: float | None = None) -> list[tuple[int, str, int, Any, bool]]:
    """Format tags for tifffile."""
    tags = [
        (code, GEO_TYPES[code][1], 0 if isinstance(value, str) else len(value), value, True)
        for code, value in geo.items()
    ]
    return tags if nodata is None else [*tags, (NODATA, "s", 0, f"{nodata:.17g}", True)]


def _transform(tags: Tags, *, point: bool) -> tuple[float, float, float, float, float, float] | None:
    if _MATRIX in tags:
        matrix = [float(value) for value in tags[_MATRIX]]
        a, b, c, d, e, f = (matrix[at] for at in (0, 1, 3, 4, 5, 7))
    elif _PIXEL_SCALE in tags and _TIEPOINT in tags:
        column, row, _, x, y, _ = (float(value) for value in tags[_TIEPOINT][:6])
        a, b, d = float(tags[_PIXEL_SCALE][0]), 0.0, 0.0
        e = -float(tags[_PIXEL_SCALE][1])
        c, f = x - a * column, y - e * row
    else:
        return None
    half = 0.5 if point else 0.0  # the coordinates in the file are those of pixel centers
    return a, b, c - half * (a + b), d, e, f - half * (d + e)
