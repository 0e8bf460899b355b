"""Radii of the supports of meshless methods."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import GIVEN, ROUNDING
from cvtimg._shared.checks import check_choice, check_count, check_in_range, check_places, check_shape
from cvtimg._shared.extras import shapely
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.types import Floats, Indices
from cvtimg.files.whole import StrPath, write_whole
from cvtimg.placement import Box, ImplicitRegion, Region, as_region
from cvtimg.supports.boxes import lies_in, radii_by_boxes


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
        Number of supports that each place of the region lies in.
    proved : bool
        Whether that is proved, up to rounding, and not only tested by samples.
    region : Region
    """

    points: Floats
    radii: Floats
    overlap: Any
    cover: int
    proved: bool
    region: Region

    def _claims(self) -> Claims:
        yield "radii are above 0", self.radii > 0
        yield "each support meets itself", self.overlap.diagonal()
        yield "supports meet each other", (self.overlap != self.overlap.T).nnz == 0

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
            Distance over radius, less than 1; no entry where the place lies outside of the support. A place that is a
            point has an entry that is 0.

        Examples
        --------
        >>> from cvtimg.placement import Box
        >>> supports = support_radii([[1.5, 2], [4.5, 2]], Box([0, 0], [6, 4]))  # the radii are about 2.5
        >>> distances = supports.distances([[2.5, 2], [3, 2]]).toarray()
        >>> bool((abs(distances - [[0.4, 0.8], [0.6, 0.6]]) < 0.02).all())
        True
        """
        from scipy.sparse import csr_array

        where = check_places("places", places, self.points.shape[1])
        balls, rows = _held(where, self.points, self.radii * (1 - ROUNDING))
        shares = np.linalg.norm(where[rows] - self.points[balls], axis=1) / self.radii[balls]
        return csr_array((shares, (rows, balls)), shape=(len(where), len(self.points)))

    def plot(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Draw the disks, and the boundary of the region, to a .png or .svg file, whole or not at all; in the plane."""
        from cvtimg.plotting.charts import PLOT_SUFFIXES, draw_supports

        suffix = check_choice("suffix", Path(path).suffix.lower(), PLOT_SUFFIXES)
        check_shape("points", self.points.shape, self.points.shape[1] == 2, "(n, 2) to be drawn")
        rings = shapely.get_rings(shapely.get_parts(self.region.outline()))
        lines = [shapely.get_coordinates(ring) for ring in rings]
        write_whole(path, draw_supports(self.points, self.radii, suffix, lines), overwrite=overwrite)


def support_radii(points: ArrayLike, region: object, cover: int = 1, *, tighten: bool = True) -> Supports:
    """Find radii of balls around points that cover each place of a region `cover` times, and of which few meet.

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

    Returns
    -------
    Supports

    Notes
    -----
    The region is cut into boxes, each of which enough balls hold as a whole, which proves the cover in any number of
    dimensions; radii are larger by about 2 % than they had to be, and by more in many dimensions. For an
    `ImplicitRegion`, `proved` is false: whether a box meets the region is then known at samples only.

    References
    ----------
    Q. Du, M. Gunzburger, L. Ju, Comput. Methods Appl. Mech. Engrg. 191 (2002) 1349-1366,
    doi 10.1016/S0045-7825(01)00327-9 (supports of meshless methods by centroidal Voronoi tessellations).

    Examples
    --------
    >>> from cvtimg import place_generators, support_radii
    >>> from cvtimg.placement import Box
    >>> square = Box([0, 0], [1, 1])
    >>> support_radii(place_generators(square, 9).points, square).proved
    True
    """
    where = as_region(region)
    centers = check_places("points", points, where.n_dims).copy()
    order = check_count("cover", cover, len(centers), "the number of points")
    _check_points(centers, where)
    radii = radii_by_boxes(centers, where, order, tighten)
    proved = not isinstance(where, ImplicitRegion)
    return Supports(centers, radii, _overlap(centers, radii), order, proved, where)


def _check_points(points: Floats, region: Region) -> None:
    periodic = isinstance(region, Box) and any(region.periodic)
    check_in_range("region", region, not periodic, "not periodic")
    size = float(np.linalg.norm(np.ptp(region.bounds, axis=0)))
    outside = np.flatnonzero(~lies_in(region, points, GIVEN * size))
    if len(outside):
        number = outside[0]
        raise ValueError(f"points must lie in the region: number {number}, {points[number].tolist()}, does not")
    first = np.unique(points, axis=0, return_index=True)[1]
    again = np.setdiff1d(np.arange(len(points)), first)
    if len(again):
        twice = again[0]
        raise ValueError(f"points must differ from each other: number {twice}, {points[twice].tolist()}, occurs twice")


def _overlap(points: Floats, radii: Floats) -> Any:
    """Which balls meet, each itself among them."""
    from scipy.sparse import csr_array

    # Of two balls that meet, the center of one lies within twice the radius of the larger one.
    first, second = _held(points, points, 2 * radii)
    meet = (np.linalg.norm(points[first] - points[second], axis=1) < radii[first] + radii[second]) | (first == second)
    one_way = csr_array((np.ones(int(meet.sum()), bool), (first[meet], second[meet])), shape=(len(points), len(points)))
    return (one_way + one_way.T).astype(bool)


def _held(places: Floats, points: Floats, radii: Floats) -> tuple[Indices, Indices]:
    """Return all pairs of a ball and of a place in it."""
    from scipy.spatial import cKDTree

    near = cKDTree(places).query_ball_point(points, radii)
    return np.repeat(np.arange(len(near)), [len(row) for row in near]), np.concatenate(near).astype(np.intp)
