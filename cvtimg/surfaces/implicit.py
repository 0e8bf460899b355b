"""Surfaces where a function is 0, and one with a name."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import MOST_IN_MEMORY
from cvtimg._shared.checks import check_finite, check_in_range, check_places, check_positive, check_shape, check_that
from cvtimg._shared.types import Points, Triangles
from cvtimg.placement import Box
from cvtimg.placement.implicit import ImplicitFunction
from cvtimg.surfaces.surface import Surface
from cvtimg.surfaces.triangulation import SurfaceTriangulation, divided, unit

#: Cubes along the longest side of the bounds, by default.
_CUBES = 64


@dataclass(frozen=True, slots=True, eq=False, repr=False, init=False)
class ImplicitSurface(Surface):
    """Where a function is 0, within bounds.

    Parameters
    ----------
    function : callable
        From (N, 3) points to (N,) values: negative inside, positive outside, with a slope that vanishes nowhere on the
        surface, as a signed distance has.
    lower, upper : (3,) array
        Corners of a box that holds the surface. Where the surface leaves the box it has a boundary.
    gradient : callable, optional
        From (N, 3) points to the (N, 3) gradients of the function; by default from differences.
    spacing : float, optional
        Side of the cubes in which the shape of the surface is found; details that are smaller are missed. By default
        1/64 of the longest side of the box.

    Examples
    --------
    >>> from cvtimg.surfaces import ImplicitSurface
    >>> ball = ImplicitSurface(lambda p: (p**2).sum(axis=1) - 1, [-1.2] * 3, [1.2] * 3)
    >>> ball.triangulation.is_closed, ball.triangulation.euler_characteristic
    (True, 2)
    """

    is_smooth: ClassVar[bool] = True
    function: ImplicitFunction
    box: Box
    _triangulation: SurfaceTriangulation

    def __init__(
        self,
        function: Callable[[Points], Any],
        lower: ArrayLike,
        upper: ArrayLike,
        *,
        gradient: Callable[[Points], Any] | None = None,
        spacing: float | None = None,
    ) -> None:
        object.__setattr__(self, "box", Box(lower, upper))
        check_shape("lower", self.box.bounds[0].shape, self.box.n_dims == 3, "(3,)")
        object.__setattr__(self, "function", ImplicitFunction(function, self.box, gradient))
        step = float(self.box.sides.max()) / _CUBES if spacing is None else check_positive("spacing", spacing)
        object.__setattr__(self, "_triangulation", self._triangulate(step))

    def __repr__(self) -> str:
        return f"<ImplicitSurface in {self.box!r}>"

    @property
    def triangulation(self) -> SurfaceTriangulation:
        """Triangles in cubes, with vertices on the surface."""
        return self._triangulation

    def on_surface(self, places: Points) -> Points:
        """Move places to the surface, along the slope of the function."""
        return self.function.to_zero(check_places("places", places, 3), slide=True)

    def nearest(self, places: Points, faces: Triangles, fine: SurfaceTriangulation) -> tuple[Points, Points, Triangles]:
        """Move places to the surface; which triangles of `fine` are near does not matter."""
        feet = self.on_surface(places)
        return feet, unit(self.function.slopes(feet)), faces

    def _triangulate(self, spacing: float) -> SurfaceTriangulation:
        from skimage.measure import marching_cubes

        lower, sides = self.box.bounds[0], self.box.sides
        counts = np.maximum(np.ceil(sides / spacing).astype(int), 2)
        most = 2 * MOST_IN_MEMORY
        check_that(f"spacing={spacing:g}", np.prod(counts + 1.0) < most, f"give fewer than {most} cubes")
        axes = [low + np.linspace(0, side, n + 1) for low, side, n in zip(lower, sides, counts, strict=True)]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        values = self.function(nodes).reshape(counts + 1)
        check_finite("function", values)
        crosses = values.min() < 0 < values.max()
        check_that("function", crosses, "be negative and positive within lower and upper: it has one sign")
        options: dict[str, Any] = {"spacing": tuple(sides / counts), "allow_degenerate": False}
        marched: Any = marching_cubes(values, 0.0, **options)  # type: ignore[no-untyped-call]
        vertices = self.on_surface(lower + np.asarray(marched[0], np.float64))
        faces = np.ascontiguousarray(marched[1], np.int32)
        return divided(vertices, faces)


def torus(major: float = 1.0, minor: float = 0.4) -> ImplicitSurface:
    """Make a torus around the z axis.

    Its tube has the radius `minor`, and the circle in the middle of it a larger one, `major`.

    Examples
    --------
    >>> from cvtimg.surfaces import torus
    >>> torus().triangulation.euler_characteristic
    0
    """
    major, minor = check_positive("major", major), check_positive("minor", minor)
    check_in_range("minor", minor, minor < major, f"less than major={major}")

    def distance(points: Points) -> Points:
        return np.asarray(np.hypot(np.hypot(points[:, 0], points[:, 1]) - major, points[:, 2]) - minor)

    reach = np.array([major + minor, major + minor, minor]) + 0.1 * minor
    return ImplicitSurface(distance, -reach, reach, spacing=minor / 6)
