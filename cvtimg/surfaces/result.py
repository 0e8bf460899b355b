"""Points on a surface as a value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.drawings import draw_solid
from cvtimg._shared.records import ReadOnly
from cvtimg.files.whole import StrPath
from cvtimg.halfedges import measure_triangles
from cvtimg.meshes.files import MeshContent, write_mesh
from cvtimg.surfaces.measures import SurfaceMeasures, measure_surface


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

    points: NDArray[np.float64]
    triangles: NDArray[np.int32]
    masses: NDArray[np.float64]
    energy: float
    offset: float
    n_iter: int

    @property
    def qualities(self) -> NDArray[np.float64]:
        """2 r / R of each triangle (T,), for the radii of its incircle and circumcircle; 1 if it is equilateral."""
        return measure_triangles(self.points, self.triangles).qualities

    def measures(self) -> SurfaceMeasures:
        """Measure how good the triangles are."""
        return measure_surface(self.points, self.triangles)

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write points and triangles to a file; the suffix picks the format.

        Parameters
        ----------
        path : str or path-like
            .vtu (with the qualities of triangles), .obj, .ply, .stl or .msh; other formats need meshio.
        overwrite : bool
            Replace an existing file.

        Raises
        ------
        ValueError
            If the suffix is unknown.
        OSError
            If the file cannot be written.
        """
        tags = np.ones(len(self.triangles), np.int32)
        no_edges = np.empty((0, 2), np.int32)
        write_mesh(path, MeshContent(self.points, self.triangles, tags, no_edges, self.qualities), overwrite)

    def _repr_html_(self) -> str:
        """Draw the triangles that face a viewer in front of the surface, to its right and above."""
        return draw_solid(repr(self), self.points, self.triangles, (0.5, -1.0, 0.6))

    def __repr__(self) -> str:
        return f"SurfacePoints({len(self.points)} points, {len(self.triangles)} triangles)"
