"""Distances of points on a surface: by a density, growing gradually."""

from dataclasses import dataclass

import numpy as np

from cvtimg._shared.checks import check_that
from cvtimg._shared.messages import warn
from cvtimg._shared.types import Floats, Points
from cvtimg.meshes.planning import NEAR
from cvtimg.meshes.trees import limited_along_edges
from cvtimg.placement.densities import Density
from cvtimg.surfaces.surface import VertexDensity
from cvtimg.surfaces.triangulation import SurfaceTriangulation

#: Area of a regular hexagon whose neighbors are at distance 1.
HEXAGON = 0.75**0.5


@dataclass(frozen=True, slots=True)
class Grading:
    """How distances of points grow, and how they are found."""

    sparsest: float = 30.0  # largest distance of points, in distances where the density is largest
    most_zeros: float = 0.01  # a density that is 0 at more places is warned of
    grade: float = 0.3  # largest growth of distances for each unit of length,
    too_steep: float = 1.25  # unless they are by less than this factor too long
    most: float = 20.0  # logarithm of what is beyond those with which there are as many points as wanted
    missed: float = 0.8  # on a finer mesh they are made shorter where they come out less by this factor


_GRADING = Grading()


class Sizes:
    """Distances of n points by a density, looked at on a mesh."""

    def __init__(self, mesh: SurfaceTriangulation, n: int, density: Density) -> None:
        from scipy.optimize import brentq

        self._n, self.given, self._lower = n, density, None
        values = density(mesh.points)
        self._top = float(values.max())
        check_that("density", self._top > 0, "be > 0 somewhere on the surface")
        if (zeros := float((values <= 0).mean())) > _GRADING.most_zeros:
            gap = f"cells there are up to {_GRADING.sparsest:g} times as wide as the finest"
            warn(f"the density is 0 on about {zeros:.0%} of the surface: {gap}")
        areas, relative = mesh.vertex_areas(), self.relative(mesh.points)
        self.distance = _scale(areas, relative, n)
        wanted = self.distance * relative
        if (limited_along_edges(mesh, wanted, _GRADING.grade) * _GRADING.too_steep >= wanted).all():
            return

        def graded(power: float) -> Floats:
            return limited_along_edges(mesh, np.exp(power) * wanted, _GRADING.grade)

        power = brentq(lambda power: np.log(_scale(areas, graded(power), n)), -1, _GRADING.most, xtol=NEAR)
        self.distance, sizes = float(self.distance * np.exp(power)), graded(power)
        self._lower = VertexDensity(mesh.points, mesh.triangles, sizes / self.distance)

    def relative(self, places: Points) -> Floats:
        """Return the distances (N,) of points around (N, 3) places, by that where the density is largest."""
        sizes = np.minimum(
            (np.maximum(self.given(places), 0) / self._top + _GRADING.sparsest**-4) ** -0.25, _GRADING.sparsest
        )
        return sizes if self._lower is None else np.minimum(sizes, self._lower(places))

    def __call__(self, places: Points) -> Floats:
        """Return the distances (N,) of points around (N, 3) places."""
        return self.distance * self.relative(places)

    def density(self, places: Points) -> Floats:
        """Return the density (N,) by which points have these distances."""
        return self.given(places) if self._lower is None else self.relative(places) ** -4

    def fits(self, mesh: SurfaceTriangulation) -> bool:
        """Tell whether distances come to the number of points on a finer mesh, too; make them shorter otherwise."""
        factor = _scale(mesh.vertex_areas(), self(mesh.points), self._n)
        is_near = factor > _GRADING.missed
        self.distance *= 1 if is_near else factor
        return is_near


def _scale(areas: Floats, sizes: Floats, n: int) -> float:
    """Return by how much sizes (N,) have to be longer for n points."""
    return float((areas / sizes**2).sum() / (HEXAGON * n)) ** 0.5
