"""The land of the earth, for grids without a map of their own: Natural Earth, 1:110 million, in the public domain."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from cvtimg._shared.types import Floats


@cache
def _land() -> dict[str, Any]:
    outlines: dict[str, Any] = json.loads((files("cvtimg.sphere") / "land.geojson").read_text())
    return outlines


def earth_land() -> dict[str, Any]:
    """Return the land of the earth as polygons of longitudes and latitudes in degrees.

    They are those of Natural Earth at a scale of 1:110 million, right to some 20 km: for cells from about 50 km on.
    Eurasia goes on beyond 180 degrees.

    Returns
    -------
    dict
        A GeoJSON MultiPolygon.

    Examples
    --------
    >>> from cvtimg import sphere_grid
    >>> from cvtimg.sphere import cull_land, earth_land
    >>> sea = cull_land(sphere_grid(642), earth_land())
    >>> bool(0.65 < sea.areas.sum() / sea.whole.areas.sum() < 0.75)
    True
    """
    return {**_land()}


def earth_coasts() -> list[Floats]:
    """Return the coasts of the earth as lines of longitudes and latitudes in degrees, for charts.

    Returns
    -------
    list of (M, 2) arrays
        The boundaries of `earth_land`, which are closed but for that around the south pole.
    """
    rings = [np.array(ring) for polygon in _land()["coordinates"] for ring in polygon]
    return [np.split(ring, np.flatnonzero(ring[:, 1] == -90))[0] for ring in rings]
