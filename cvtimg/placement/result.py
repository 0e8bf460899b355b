"""What a placement comes to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvtimg._shared.extras import shapely
from cvtimg._shared.notebooks import drawn
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.types import Floats
from cvtimg.labels.contours import Polygon
from cvtimg.placement.cells import CellMeasures, measure_cells, oriented_pieces, voronoi_cells
from cvtimg.placement.descent import Descent
from cvtimg.placement.polygons import PictureRegion
from cvtimg.placement.regions import Box, Region


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Placement(ReadOnly):
    """Generators in a region, and what is known of their cells.

    Attributes
    ----------
    points : (K, D) float64 array
        The generators.
    masses : (K,) float64 array
        Integral of the density over each cell.
    centroids : (K, D) float64 array
        Center of mass of each cell; the generators are there, as nearly as the descent came.
    energy : float
        Integral of the density times the squared distance to the own generator.
    energies : tuple of float
        The energy at the start of the last level and after each of its moves.
    n_iter : int
        How many moves that were.
    converged : bool
        Whether the energy had come to rest when the descent stopped.
    region : Region
        Where they were placed.
    """

    points: Floats
    masses: Floats
    centroids: Floats
    energy: float
    energies: tuple[float, ...]
    n_iter: int
    converged: bool
    region: Region

    def _claims(self) -> Claims:
        yield "masses are not negative", self.masses >= 0
        inward = self.points + 1e-6 * (self.centroids - self.points)  # those on the boundary are there but for rounding
        yield "generators are in the region", self.region.contains(self.points) | self.region.contains(inward)

    def _repr_png_(self) -> bytes | None:
        """Draw the generators, with y down in images and in each pair of axes if there are more than two."""
        return drawn(repr(self), self.points, y_down=isinstance(self.region, PictureRegion))

    def __repr__(self) -> str:
        n, n_dims = self.points.shape
        rest = "converged" if self.converged else "not converged"
        return f"<Placement of {n} generators in {n_dims} dimensions, energy {self.energy:g}, {rest}>"

    def cells(self) -> tuple[Polygon, ...]:
        """Cut the region into the Voronoi cells of the points, as polygons.

        Returns
        -------
        tuple of cvtimg.labels.Polygon
            By label, which is the index of the point plus 1; a cell that its region cuts apart has several.

        Notes
        -----
        Cells of the Euclidean metric, for regions of the plane.

        Examples
        --------
        >>> from cvtimg import place_generators
        >>> from cvtimg.placement import Box
        >>> [cell.area for cell in place_generators(Box([0, 0], [2, 2]), 1).cells()]
        [4.0]
        """
        pieces, labels = oriented_pieces(voronoi_cells(self.points, self.region))
        rings = (map(shapely.get_coordinates, shapely.get_rings(piece)) for piece in pieces)
        return tuple(Polygon(int(label) + 1, tuple(each)) for label, each in zip(labels, rings, strict=True))

    def measures(self) -> CellMeasures:
        """Measure how regular the Voronoi cells are: exactly where they are polygons, else by samples."""
        return measure_cells(self.points, self.region)

    @classmethod
    def of(cls, descent: Descent, region: Region) -> Placement:
        """Make it of the end of a descent."""
        moments = descent.moments
        points, centroids = descent.generators, moments.centroids
        if isinstance(region, Box) and any(region.periodic):
            wrapped = region.project(points)
            points, centroids = wrapped, centroids + (wrapped - points)
        return cls(
            points=np.array(points),
            masses=np.array(moments.masses),
            centroids=np.array(centroids),
            energy=moments.energy,
            energies=descent.energies,
            n_iter=len(descent.energies) - 1,
            converged=descent.converged,
            region=region,
        )
