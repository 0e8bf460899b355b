"""Distances of points on a surface: by a density, growing gradually."""

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


#: Distances where the density is largest that points are apart at most: with more, cells at its zeros are wider.
SPARSEST = 30.0
#: Growth of distances for each unit of length: with more, cells differ more from their neighbors.
_GRADE = 0.3
#: Part of what they should be that distances may have before they are found anew.
_NEARLY = 0.8


class Sizes:
    """Distances of n points by a density, looked at on a mesh."""

    def __init__(self, mesh: SurfaceTriangulation, n: int, density: Density) -> None:
        from scipy.optimize import brentq

        self._n, self.given, self._lower = n, density, None
        values = density(mesh.points)
        self._top = float(values.max())
        check_that("density", self._top > 0, "be > 0 somewhere on the surface")
        if (zeros := float((values <= 0).mean())) > NEAR:
            gap = f"cells there are up to {SPARSEST:g} times as wide as the finest"
            warn(f"the density is 0 on about {zeros:.0%} of the surface: {gap}")
        areas, relative = mesh.vertex_areas(), self.relative(mesh.points)
        self.distance = _scale(areas, relative, n)
        wanted = self.distance * relative
        if (limited_along_edges(mesh, wanted, _GRADE) >= _NEARLY * wanted).all():
            return

        def graded(power: float) -> Floats:
            return limited_along_edges(mesh, np.exp(power) * wanted, _GRADE)

        power = brentq(lambda power: np.log(_scale(areas, graded(power), n)), -1, 20, xtol=NEAR)
        self.distance, sizes = float(self.distance * np.exp(power)), graded(power)
        self._lower = VertexDensity(mesh.points, mesh.triangles, sizes / self.distance)

    def relative(self, places: Points) -> Floats:
        """Return the distances (N,) of points around (N, 3) places, by that where the density is largest."""
        sizes = np.minimum((np.maximum(self.given(places), 0) / self._top + SPARSEST**-4) ** -0.25, SPARSEST)
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
        is_near = factor > _NEARLY
        self.distance *= 1 if is_near else factor
        return is_near


def _scale(areas: Floats, sizes: Floats, n: int) -> float:
    """Return by how much sizes (N,) have to be longer for n points."""
    return float((areas / sizes**2).sum() / (HEXAGON * n)) ** 0.5
