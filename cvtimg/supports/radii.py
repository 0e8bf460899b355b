"""Radii of the supports of meshless methods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_in_range,
    check_places,
    check_shape,
    check_that,
    hints_at_keywords,
)
from cvtimg._shared.records import ReadOnly
from cvtimg.files.whole import StrPath, write_whole
from cvtimg.placement import Box, ImplicitRegion, Region, as_region
from cvtimg.supports.boxes import radii_by_boxes
from cvtimg.supports.plane import radii_in_plane
from cvtimg.supports.sight import Sight, lies_in, overlaps, sight_in

_Floats = NDArray[np.float64]

#: Points may lie outside of the region by this share of its size: those on its boundary are rounded.
_OUTSIDE = 1e-9
#: Places around the end of a barrier where supports may meet: how far from it, as a share of the size, and where.
_AROUND = 1e-6
_ANGLES = (np.arange(32) + 0.25) * np.pi / 16
_DIRECTIONS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Supports(ReadOnly):
    """Balls around points that cover a region.

    Attributes
    ----------
    points : (n, d) float64 array
        Their centers.
    radii : (n,) float64 array
    overlap : (n, n) scipy.sparse.csr_array of bool
        Which supports meet, each itself among them: the entries of a meshless method's matrix that are not zero.
    cover : int
        Each place of the region lies in so many supports whose points see it.
    proved : bool
        Whether that is proved, up to rounding, and not only tested by samples.
    region : Region
    visible : callable or (S, 2, 2) float64 array or None
        What blocks sight, as it was given.
    """

    points: _Floats
    radii: _Floats
    overlap: Any
    cover: int
    proved: bool
    region: Region
    visible: Any

    def __repr__(self) -> str:
        n, n_dims = self.points.shape
        how = "proved" if self.proved else "by samples"
        share = self.overlap.nnz / n**2
        return f"<{n} supports in {n_dims} dimensions, {self.cover}-fold cover {how}, overlap {share:.2%}>"

    def distances(self, places: ArrayLike) -> Any:
        """Compute the distances of places to the points whose supports hold them, as shares of the radii.

        Parameters
        ----------
        places : (m, d) array

        Returns
        -------
        (m, n) scipy.sparse.csr_array of float64
            Distance over radius, less than 1; no entry where the place lies outside of the support, or is not seen
            from its point. A place that is a point has an entry that is 0.

        Examples
        --------
        >>> import numpy as np
        >>> from cvtimg.placement import Box
        >>> supports = support_radii([[0.25, 0.5], [0.75, 0.5]], Box([0, 0], [1, 1]))
        >>> np.round(supports.distances([[0.25, 0.5], [0.5, 0.5]]).toarray(), 2).tolist()
        [[0.0, 0.89], [0.45, 0.45]]
        """
        from scipy.sparse import csr_array
        from scipy.spatial import cKDTree

        where = check_places("places", places, self.points.shape[1])
        found = cKDTree(where).query_ball_point(self.points, self.radii * (1 - 1e-12))
        own = np.repeat(np.arange(len(found)), [len(row) for row in found])
        rows = np.concatenate([np.asarray(row, np.intp) for row in found])
        seen = self._seen(own, where[rows])
        own, rows = own[seen], rows[seen]
        shares = np.linalg.norm(where[rows] - self.points[own], axis=1) / self.radii[own]
        return csr_array((shares, (rows, own)), shape=(len(where), len(found)))

    def plot(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Draw the disks, and the slits, to a .png or .svg file, whole or not at all; in the plane.

        Raises
        ------
        ValueError
            If the suffix is another, or the supports are not in the plane.
        OSError
            If the file cannot be written, or exists and `overwrite` is false.
        ImportError
            If matplotlib is not installed.
        """
        from cvtimg.plotting.charts import PLOT_SUFFIXES, draw_supports

        suffix = check_choice("suffix", Path(path).suffix.lower(), PLOT_SUFFIXES)
        check_shape("points", self.points.shape, self.points.shape[1] == 2, "(n, 2) to be drawn")
        sight = sight_in(self.region, None if callable(self.visible) else self.visible)
        lines = () if sight is None else sight.barriers.reshape(-1, 2, 2)
        write_whole(path, draw_supports(self.points, self.radii, suffix, list(lines)), overwrite=overwrite)

    def _seen(self, own: NDArray[np.intp], places: _Floats) -> NDArray[np.bool_]:
        if self.visible is None:
            return np.ones(len(own), bool)
        if callable(self.visible):
            return np.asarray(self.visible(places, self.points[own])).astype(bool)
        sight = sight_in(self.region, self.visible)
        assert sight is not None
        return sight.sees(self.points, own, places)


@hints_at_keywords
def support_radii(
    points: ArrayLike,
    region: Any,
    cover: int = 1,
    *,
    tighten: bool = True,
    visible: ArrayLike | Callable[[_Floats, _Floats], ArrayLike] | None = None,
) -> Supports:
    """Find radii of balls around points that cover a region, each place so many times, and of which few meet.

    Parameters
    ----------
    points : (n, d) array
        Centers, in the region; no two may be equal.
    region : Region, bool array, polygon coordinates, GeoJSON or shapely geometry
        What `cvtimg.placement.as_region` takes. It may have holes and need not be convex.
    cover : int
        How many supports hold each place p, at most n: as many as a meshless method of its order needs.
    tighten : bool
        Let balls shrink, and take over places from each other, so that fewer meet. Without it, each ball has the
        greatest distance at which its point is among the p nearest.
    visible : (S, 2, 2) array or callable, optional
        What a point sees belongs to its support: by default all within its radius. An array gives the ends of slits,
        which block sight in the plane, as the boundary of the region then does; with none, of shape (0, 2, 2), only
        the boundary does. Or a function from (m, d) places and (m, d) points to (m,) booleans.

    Returns
    -------
    Supports

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it.

    See Also
    --------
    cvtimg.place_generators

    Notes
    -----
    In the plane, for boxes, polygons and masks, radii are exact: the greatest distance at which a point is among the
    p nearest that see a place occurs where two of its bisectors, the boundary, slits and edges of shadows cross. The
    cover is proved at the crossings of circles with these, and stays one while disks shrink. Disks that hold the end
    of a slit or a reflex corner where that casts a shadow, and their neighbors, are not tightened. Otherwise the
    region is cut into boxes, each of which enough balls hold as a whole: radii are larger by about 2 %, and by more
    in many dimensions. For an `ImplicitRegion`, or with a function, `proved` is false: whether a box meets the
    region, or a place in it is seen, is then known at samples only.

    References
    ----------
    Q. Du, M. Gunzburger, L. Ju, Comput. Methods Appl. Mech. Engrg. 191 (2002) 1349-1366,
    doi 10.1016/S0045-7825(01)00327-9 (supports of meshless methods by centroidal Voronoi tessellations).

    Examples
    --------
    >>> from cvtimg import place_generators, support_radii
    >>> from cvtimg.placement import Box
    >>> square = Box([0, 0], [1, 1])
    >>> support_radii(place_generators(square, 9).points, square)
    <9 supports in 2 dimensions, 1-fold cover proved, overlap 53.09%>
    """
    where = as_region(region)
    centers = check_places("points", points, where.n_dims).copy()
    order = check_count("cover", cover, len(centers), "the number of points")
    _check_points(centers, where)
    sight = None if callable(visible) else sight_in(where, visible)
    if sight is not None:
        radii, proved = radii_in_plane(centers, sight, order, tighten)
    else:
        function = visible is None or callable(visible)
        check_that("visible", function, f"be a function for region={where!r}: slits block sight in polygons and boxes")
        radii = radii_by_boxes(centers, where, order, tighten, visible)  # type: ignore[arg-type]
        proved = visible is None and not isinstance(where, ImplicitRegion)
    blocks = visible if visible is None or callable(visible) else np.array(visible, np.float64).reshape(-1, 2, 2)
    return Supports(centers, radii, _overlap(centers, radii, sight), order, proved, where, blocks)


def _check_points(points: _Floats, region: Region) -> None:
    periodic = isinstance(region, Box) and any(region.periodic)
    check_in_range("region", region, not periodic, "not periodic")
    size = float(np.linalg.norm(np.ptp(region.bounds, axis=0)))
    outside = np.flatnonzero(~lies_in(region, points, _OUTSIDE * size))
    if len(outside):
        number = outside[0]
        raise ValueError(f"points must lie in the region: number {number}, {points[number].tolist()}, does not")
    first = np.unique(points, axis=0, return_index=True)[1]
    again = np.setdiff1d(np.arange(len(points)), first)
    if len(again):
        twice = again[0]
        raise ValueError(f"points must differ from each other: number {twice}, {points[twice].tolist()}, occurs twice")


def _overlap(points: _Floats, radii: _Floats, sight: Sight | None) -> Any:
    """Balls that meet; where sight is blocked, those whose points see each other or the same place around a tip."""
    from scipy.sparse import csr_array

    meets = overlaps(points, radii)
    own, other = meets.spread(np.arange(len(points)))
    if sight is not None and sight.blocking:
        meet = sight.sees(points, own, points[other]) & sight.sees(points, other, points[own])
        for tip in sight.tips:
            holds = np.flatnonzero(np.linalg.norm(points - tip, axis=1) < radii)
            around = tip + _AROUND * sight.size * _DIRECTIONS
            looks, targets = np.repeat(holds, len(around)), np.tile(around, (len(holds), 1))
            seen = np.zeros((len(points), len(around)), bool)
            seen[holds] = sight.sees(points, looks, targets).reshape(len(holds), -1)
            meet |= (seen[own] & seen[other]).any(axis=1)
        own, other = own[meet], other[meet]
    shape = (len(points), len(points))
    return csr_array((np.ones(len(own), bool), (own, other)), shape=shape)
