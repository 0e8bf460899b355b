"""A grid of the sphere as a value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_positive
from cvtimg._shared.drawings import draw_solid
from cvtimg._shared.records import ReadOnly
from cvtimg.files.whole import StrPath
from cvtimg.sphere.formats import GridContent, write_grid
from cvtimg.sphere.measures import GridMeasures, measure_grid
from cvtimg.sphere.triangulation import SphereCells, SphereTriangulation


@dataclass(frozen=True, slots=True, eq=False)
class SphereGrid(ReadOnly):
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

    points: NDArray[np.float64]
    triangles: NDArray[np.int32]
    areas: NDArray[np.float64]
    density: NDArray[np.float64]
    energy: float
    offset: float
    fixed: NDArray[np.bool_]

    @property
    def lon(self) -> NDArray[np.float64]:
        """Longitudes (N,) of the points in degrees, -180..180."""
        return np.degrees(np.arctan2(self.points[:, 1], self.points[:, 0]))

    @property
    def lat(self) -> NDArray[np.float64]:
        """Latitudes (N,) of the points in degrees."""
        return np.degrees(np.arcsin(np.clip(self.points[:, 2], -1, 1)))

    def cells(self) -> SphereCells:
        """Return the Voronoi cells of the points."""
        return SphereTriangulation(self.points, self.triangles).cells()

    def measures(self) -> GridMeasures:
        """Measure how good the grid is."""
        return measure_grid(self.points, self.triangles)

    def save(self, path: StrPath, *, radius: float = 1.0, overwrite: bool = False) -> None:
        """Write the grid to a file; the end of its name picks the format.

        Parameters
        ----------
        path : str or path-like
            .nc (a mesh of MPAS), .ugrid.nc (UGRID), .scrip.nc (SCRIP, for ESMF's tools), .graph.info (the graph of
            cells, for METIS), .vtu and .geojson (cells as polygons) or .csv (a row per point).
        radius : float
            Of the sphere in the file, which lengths and areas follow: 1, as meshes of MPAS-Atmosphere have it, or that
            of the earth in meters, 6371229, as MPAS-Ocean takes it.
        overwrite : bool
            Replace an existing file.

        Raises
        ------
        ValueError
            If the name ends otherwise, or `radius` is not > 0.
        OSError
            If the file cannot be written.
        """
        content = GridContent(self.points, self.triangles, self.density, check_positive("radius", radius))
        write_grid(path, content, overwrite=overwrite)

    def _repr_html_(self) -> str:
        """Draw the triangles of the half that is centered at longitude 0 and latitude 20."""
        return draw_solid(repr(self), self.points, self.triangles, (0.94, 0.0, 0.34))

    def __repr__(self) -> str:
        return f"SphereGrid({len(self.points)} points, {len(self.triangles)} triangles)"
