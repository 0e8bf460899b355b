"""What can be taken for a region."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvtimg._shared.checks import refuse_type
from cvtimg.regions.base import Region
from cvtimg.regions.pictures import PictureRegion
from cvtimg.regions.polygons import PolygonRegion


def as_region(region: Any) -> Region:
    """Make a region of what stands for one.

    Parameters
    ----------
    region : Region, bool array, coordinates, GeoJSON or shapely geometry
        A Region as it is; a bool array (H, W) or (L, H, W) for the pixels of a mask; (N, 2) coordinates of a polygon,
        or a sequence of such rings, the outer one first; a GeoJSON mapping; a shapely Polygon or MultiPolygon.

    Returns
    -------
    Region

    Raises
    ------
    TypeError, ValueError
        If it is none of these, or is empty.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.regions import as_region
    >>> as_region(np.ones((2, 3), bool))
    <PictureRegion of 6 pixels in 2 x 3>
    >>> as_region([[0, 0], [2, 0], [0, 2]])
    <PolygonRegion of 1 polygon, area 2>
    """
    if isinstance(region, Region):
        return region
    if isinstance(region, Mapping) or hasattr(region, "geom_type"):
        return PolygonRegion(region)
    if isinstance(region, np.ndarray) and region.dtype == np.bool_:
        return PictureRegion(region)
    if not isinstance(region, (list, tuple, np.ndarray)) or not len(region):
        allowed = "a Region, a bool array, polygon coordinates, GeoJSON or a shapely geometry"
        refuse_type("region", type(region).__name__, allowed)
    return PolygonRegion(region)
