"""A grid of the sphere as a value, and how good it is."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np

from cvtimg._shared.checks import check_positive
from cvtimg._shared.choices import Row
from cvtimg._shared.notebooks import drawn
from cvtimg._shared.records import Claims, ReadOnly, equals
from cvtimg._shared.types import Bools, Floats, Ints, Points
from cvtimg.files.whole import StrPath
from cvtimg.halfedges import measure_triangles
from cvtimg.sphere.formats import GridContent, write_grid
from cvtimg.sphere.triangulation import SphereCells, SphereTriangulation
from cvtimg.sphere.widths import EARTH_RADIUS


@dataclass(frozen=True, slots=True)
class GridMeasures:
    """Measures of a triangulation of the sphere. Angles are those between chords, as on a map of each triangle.

    Attributes
    ----------
    least_angle, largest_angle : float
        In degrees; 60 for equilateral triangles.
    n_obtuse : int
        Triangles with an angle above 90 degrees, whose circumcenter is outside.
    least_quality, mean_quality : float
        2 r / R of triangles, for the radii of the incircle and the circumcircle; 1 if they are equilateral.
    uniformity : float
        The least of the distances from a point to its nearest neighbor by that to its farthest one.
    shortest_edge, longest_edge : float
        Distances of neighbors, as angles in radians.
    n_pentagons, n_hexagons, n_heptagons, n_others : int
        Cells by their number of sides.
    """

    least_angle: float
    largest_angle: float
    n_obtuse: int
    least_quality: float
    mean_quality: float
    uniformity: float
    shortest_edge: float
    longest_edge: float
    n_pentagons: int
    n_hexagons: int
    n_heptagons: int
    n_others: int


def measure_grid(points: Points, triangles: Ints) -> GridMeasures:
    """Measure a grid.

    Parameters
    ----------
    points : (N, 3) array
        Unit vectors.
    triangles : (T, 3) integer array
        Indices of points; they cover the sphere.

    Returns
    -------
    GridMeasures

    Examples
    --------
    >>> from cvtimg.sphere import measure_grid, triangulate
    >>> octahedron = np.concatenate([np.eye(3), -np.eye(3)])
    >>> measures = measure_grid(octahedron, triangulate(octahedron))
    >>> round(measures.least_angle, 9), measures.n_obtuse, measures.n_others
    (60.0, 0, 6)
    """
    each = measure_triangles(points, triangles)
    nearest, farthest = np.full(len(points), np.inf), np.zeros(len(points))
    for k in range(3):  # the side from each corner to the next; the surface is closed, so that these are all
        length = np.linalg.norm(points[triangles[:, k]] - points[triangles[:, k - 2]], axis=1)
        np.minimum.at(nearest, triangles[:, k], length)
        np.maximum.at(farthest, triangles[:, k], length)
    degrees = np.bincount(np.bincount(triangles.ravel(), minlength=len(points)), minlength=8)
    return GridMeasures(
        least_angle=float(each.least_angles.min()),
        largest_angle=float(each.largest_angles.max()),
        n_obtuse=int((each.largest_angles > 90 + 1e-9).sum()),
        least_quality=float(each.qualities.min()),
        mean_quality=float(each.qualities.mean()),
        uniformity=float((nearest / farthest).min()),
        shortest_edge=float(2 * np.arcsin(nearest.min() / 2)),
        longest_edge=float(2 * np.arcsin(farthest.max() / 2)),
        n_pentagons=int(degrees[5]),
        n_hexagons=int(degrees[6]),
        n_heptagons=int(degrees[7]),
        n_others=len(points) - int(degrees[5:8].sum()),
    )


class SavedGrid(ReadOnly):
    """Cells of the sphere that are written to files."""

    __slots__ = ()

    def save(
        self,
        path: StrPath,
        *,
        radius: float = 1.0,
        attributes: Mapping[str, str] | None = None,
        overwrite: bool = False,
    ) -> None:
        """Write the cells to a file; the end of its name picks the format.

        Parameters
        ----------
        path : str or path-like
            .nc (a mesh of MPAS), .ugrid.nc (UGRID), .scrip.nc (SCRIP, for ESMF's tools), .graph.info (the graph of
            cells, for METIS), .vtu and .geojson (cells as polygons) or .csv (a row per point).
        radius : float
            Of the sphere in the file, which lengths and areas follow: 1, as meshes of MPAS-Atmosphere have it, or that
            of the earth in meters: 6371229 in MPAS and WRF, 6371220 in CESM and E3SM.
        attributes : mapping of str to str, optional
            Global attributes of .nc files, such as history, or parent_id in meshes of MPAS.
        overwrite : bool
            Replace an existing file.

        Raises
        ------
        ValueError
            If the name ends otherwise, or `radius` is not > 0.
        OSError
            If the file cannot be written.
        """
        write_grid(path, self._content(check_positive("radius", radius), attributes), overwrite=overwrite)

    def _content(self, radius: float = 1.0, attributes: Mapping[str, str] | None = None) -> GridContent:
        raise NotImplementedError


@dataclass(frozen=True, slots=True, eq=False)
class SphereGrid(SavedGrid):
    """Points on the unit sphere that are generators of a centroidal Voronoi tessellation.

    Attributes
    ----------
    points : (N, 3) float64 array
        Unit vectors.
    triangles : (T, 3) int32 array
        Their Delaunay triangulation: T = 2 N - 4 triples of indices, counterclockwise from outside.
    areas : (N,) float64 array
        Of their Voronoi cells; together 4 pi.
    density : (N,) float64 array
        The density at the points.
    energy : float
        Integral of the density times the squared distance to the nearest point.
    offset : float
        Root mean square of the distances from points to the centers of mass of their cells, by the sizes of the cells.
    fixed : (N,) bool array
        Points that were given and stayed.
    """

    points: Floats
    triangles: Ints
    areas: Floats
    density: Floats
    energy: float
    offset: float
    fixed: Bools

    def _claims(self) -> Claims:
        yield "areas add up to the sphere", equals(self.areas.sum(), 4 * np.pi)
        yield "points are on the sphere", np.isclose(np.square(self.points).sum(axis=1), 1)
        yield "triangles close", len(self.triangles) == 2 * len(self.points) - 4

    @property
    def lon(self) -> Floats:
        """Longitudes (N,) of the points in degrees, -180..180."""
        return np.degrees(np.arctan2(self.points[:, 1], self.points[:, 0]))

    @property
    def lat(self) -> Floats:
        """Latitudes (N,) of the points in degrees."""
        return np.degrees(np.arcsin(np.clip(self.points[:, 2], -1, 1)))

    def cells(self) -> SphereCells:
        """Return the Voronoi cells of the points."""
        return SphereTriangulation(self.points, self.triangles).cells()

    def widths(self, *, radius: float = EARTH_RADIUS) -> Floats:
        """Return the widths (N,) of cells: means of the distances to their neighbors, in km on the earth by default."""
        starts, ends = self.triangles.ravel(), np.roll(self.triangles, -1, axis=1).ravel()
        distances = 2 * np.arcsin(np.linalg.norm(self.points[starts] - self.points[ends], axis=1) / 2)
        n = len(self.points)
        return radius * np.bincount(starts, distances, n) / np.bincount(starts, minlength=n)

    def measures(self) -> GridMeasures:
        """Measure how good the grid is."""
        return measure_grid(self.points, self.triangles)

    def _content(self, radius: float = 1.0, attributes: Mapping[str, str] | None = None) -> GridContent:
        return GridContent(self.points, self.triangles, self.density, radius, self._flags(), attributes or {})

    def _flags(self) -> dict[str, Ints]:
        return {}

    def _repr_png_(self) -> bytes | None:
        return drawn(repr(self), self.points, self.triangles)

    def summary(self) -> Row:
        """Return what a table says of the result, by column."""
        return {
            "n": len(self.points),
            "triangles": len(self.triangles),
            "fixed": int(self.fixed.sum()),
            "energy": self.energy,
            "offset": self.offset,
            **asdict(self.measures()),
        }

    def __repr__(self) -> str:
        return f"SphereGrid({len(self.points)} points, {len(self.triangles)} triangles)"
