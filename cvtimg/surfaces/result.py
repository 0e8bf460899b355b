"""Points on a surface as a value, and how good they are."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_places, check_triangles
from cvtimg._shared.choices import Row
from cvtimg._shared.notebooks import drawn
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.types import Floats, Ints
from cvtimg.files.whole import StrPath
from cvtimg.halfedges import connected_parts, edges_around, measure_triangles, unique_edges
from cvtimg.meshes.files import MeshContent, write_mesh


@dataclass(frozen=True, slots=True)
class SurfaceMeasures:
    """Measures of triangles on a surface.

    Attributes
    ----------
    least_angle, largest_angle : float
        In degrees; 60 for equilateral triangles.
    n_obtuse : int
        Triangles with an angle above 90 degrees.
    least_quality, mean_quality, below_30 : float
        2 r / R of triangles, for the radii of incircle and circumcircle; and the share with an angle below 30 degrees.
    euler_characteristic, is_closed : int, bool
        Vertices minus edges plus triangles, 2 for a sphere and 0 for a torus; and whether there is no boundary.
    n_components, n_borders : int
        Parts that share no vertex, and closed curves that bound them: the rim of a sheet, and each hole of a scan.
    """

    least_angle: float
    largest_angle: float
    n_obtuse: int
    least_quality: float
    mean_quality: float
    below_30: float
    euler_characteristic: int
    is_closed: bool
    n_components: int
    n_borders: int


def measure_surface(points: ArrayLike, triangles: ArrayLike) -> SurfaceMeasures:
    """Measure any triangulation of a surface.

    Parameters
    ----------
    points : (N, 3) array
    triangles : (T, 3) integer array
        Indices of points.

    Examples
    --------
    >>> from cvtimg.surfaces import measure_surface
    >>> tetrahedron = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    >>> measures = measure_surface(tetrahedron, [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    >>> round(measures.least_angle, 9), measures.euler_characteristic, measures.is_closed
    (60.0, 2, True)
    """
    places = check_places("points", points, 3)
    corners = check_triangles("triangles", triangles, len(places))
    each = measure_triangles(places, corners)
    edges, _, counts = unique_edges(edges_around(corners))
    used = np.unique(corners)
    return SurfaceMeasures(
        least_angle=float(each.least_angles.min()),
        largest_angle=float(each.largest_angles.max()),
        n_obtuse=int((each.largest_angles > 90 + 1e-9).sum()),
        least_quality=float(each.qualities.min()),
        mean_quality=float(each.qualities.mean()),
        below_30=float((each.least_angles < 30).mean()),
        euler_characteristic=len(used) - len(edges) + len(corners),
        is_closed=bool((counts == 2).all()),
        n_components=_n_connected(edges, used),
        n_borders=_n_connected(edges[counts == 1], np.unique(edges[counts == 1])),
    )


def _n_connected(edges: NDArray[np.integer], points: NDArray[np.integer]) -> int:
    """Count the parts of some points (P,) that edges (E, 2) connect."""
    start, end = np.searchsorted(points, edges).T
    return connected_parts((start, end), len(points))[0] if len(points) else 0


@dataclass(frozen=True, slots=True, eq=False)
class SurfacePoints(ReadOnly):
    """Points on a surface that are generators of a centroidal Voronoi tessellation, constrained to it.

    Attributes
    ----------
    points : (N, 3) float64 array
    triangles : (T, 3) int32 array
        Triples of points whose cells meet, counterclockwise from outside; they close where the surface does.
    masses : (N,) float64 array
        Integral of the density over each cell.
    energy : float
        Integral of the density times the squared distance to the nearest point.
    offset : float
        Root mean square of the distances from points to where their centers of mass are on the surface, by the sizes of
        the cells.
    n_iter : int
        Moves that were made.
    """

    points: Floats
    triangles: Ints
    masses: Floats
    energy: float
    offset: float
    n_iter: int

    def _claims(self) -> Claims:
        yield "masses are not negative", self.masses >= 0

    @property
    def qualities(self) -> Floats:
        """2 r / R of each triangle (T,), for the radii of its incircle and circumcircle; 1 if it is equilateral."""
        return measure_triangles(self.points, self.triangles).qualities

    def measures(self) -> SurfaceMeasures:
        """Measure how good the triangles are."""
        return measure_surface(self.points, self.triangles)

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write points and triangles to a file, which may replace one.

        That is .vtu (with the qualities of triangles), .obj, or .ply, .stl, .msh and others by meshio.
        """
        tags = np.ones(len(self.triangles), np.int32)
        no_edges = np.empty((0, 2), np.int32)
        write_mesh(path, MeshContent(self.points, self.triangles, tags, no_edges, self.qualities), overwrite)

    def _repr_png_(self) -> bytes | None:
        """Draw the triangles, as seen from in front of the surface, to its right and above."""
        return drawn(repr(self), self.points, self.triangles)

    def summary(self) -> Row:
        """Return what a table says of the result, by column."""
        measures = asdict(self.measures())
        return {
            "n": len(self.points),
            "triangles": len(self.triangles),
            "energy": self.energy,
            "offset": self.offset,
            "n_iter": self.n_iter,
            "components": measures.pop("n_components"),
            "borders": measures.pop("n_borders"),
            **measures,
        }

    def __repr__(self) -> str:
        return f"SurfacePoints({len(self.points)} points, {len(self.triangles)} triangles)"
