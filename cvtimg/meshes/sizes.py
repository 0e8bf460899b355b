"""What can be taken for the size of edges."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import SAMPLES_OF_FIGURE
from cvtimg._shared.checks import (
    check_have_area,
    check_numbers,
    check_places,
    check_positive,
    check_returned,
    check_shape,
    check_that,
    check_triangles,
)
from cvtimg._shared.types import Array, Bools, Floats, Points
from cvtimg.meshes.fields import Field, PictureField
from cvtimg.meshes.outlines import Outline, cross
from cvtimg.meshes.trees import Sizes, TreeField
from cvtimg.meshes.triangulation import PlaneTriangulation

#: What `mesh_region` takes for `size`.
SizeLike: TypeAlias = float | ArrayLike | Callable[[Points], ArrayLike]

#: The size of pixels that are not meshed, whose square is a number still.
_HUGE = np.sqrt(np.finfo(np.float32).max)
_ALLOWED = "be finite and > 0 in the region"


class MeshValues:
    """Values (N,) or (N, C) at the vertices of a mesh, interpolated on its triangles."""

    def __init__(self, points: ArrayLike, triangles: ArrayLike, name: str, values: ArrayLike) -> None:
        from scipy.spatial import cKDTree

        places = check_places("points", points, 2)
        corners = check_triangles("triangles", triangles, len(places))
        self.values = np.asarray(values, np.float64)
        check_shape(name, self.values.shape, self.values.shape == (len(places),), f"({len(places)},), as the points")
        a, b, c = places[corners].transpose(1, 0, 2)
        turn = cross(b - a, c - a)
        check_have_area("triangles", turn)
        self.mesh = PlaneTriangulation(places, np.where(turn[:, None] < 0, corners[:, ::-1], corners))
        self._used = np.unique(corners).astype(np.int32)
        self._tree = cKDTree(places[self._used])

    def __call__(self, points: Points) -> Floats:
        """Return values (M,) or (M, C) at (M, 2) points; outside of the mesh, those of the nearest vertex."""
        near = self._used[self._tree.query(points)[1]]
        triangles, shares = self.mesh.locate(points, near)
        outside = shares.min(axis=1) < -1e-9
        values: Floats = np.einsum("mk...,mk->m...", self.values[self.mesh.triangles[triangles]], shares)
        values[outside] = self.values[near[outside]]
        return values


class MeshSize(MeshValues):
    """Sizes at the vertices of a mesh, interpolated on its triangles: a size field for an adaptive loop.

    Parameters
    ----------
    points : (N, 2) array
        Vertices.
    triangles : (T, 3) integer array
        Indices of points.
    sizes : (N,) array
        Wanted edge lengths, finite and > 0.

    Examples
    --------
    >>> from cvtimg.meshes import MeshSize
    >>> size = MeshSize([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], [0.1, 0.2, 0.3])
    >>> size(np.array([[0.5, 0.0], [0.0, 5.0]])).round(3).tolist()
    [0.15, 0.3]
    """

    def __init__(self, points: ArrayLike, triangles: ArrayLike, sizes: ArrayLike) -> None:
        super().__init__(points, triangles, "sizes", sizes)
        check_that("sizes", ((self.values > 0) & (self.values < np.inf)).all(), "be finite and > 0")


def size_field(outline: Outline, size: SizeLike, n: int | None, least: float, probes: Points) -> Field:
    """Make a field of sizes, scaled to about `n` vertices; at probes (P, 2) they may be lower than around.

    Where the least size is > 0, sizes of 0 are allowed, too.
    """
    if callable(size):

        def sizes(points: Points) -> Floats:  # checked at each call; outside of the region they may be anything
            values = np.array(size(points), np.float64)
            check_returned("size", values, len(points))
            right = (values > 0 if least == 0 else values >= 0) & (values < np.inf)
            outline.check_inside("size", points, values, right, _ALLOWED)
            return np.maximum(np.where(right, values, float(_HUGE)), least)

        return _function_field(sizes, outline, n, probes)
    values = np.asarray(size)
    check_numbers("size", values.dtype)
    if values.ndim == 0:
        value = check_positive("size", float(values))
        if outline.mask is None:
            return _function_field(lambda points: np.full(len(points), value), outline, n, probes)
        values = np.full(outline.mask.shape, value, np.float32)
    inside = outline.mask if outline.mask is not None else _pixels_inside(outline, values)
    return _scaled(_picture_field(values, inside, least), n)


def _picture_field(values: Array, inside: Bools, least: float) -> PictureField:
    check_shape("size", values.shape, values.shape == inside.shape, f"{inside.shape}, as the region")
    values_inside = values[inside].astype(np.float32)
    wrong = ~((values_inside > 0 if least == 0 else values_inside >= 0) & (values_inside < np.inf))
    if wrong.any():
        y, x = np.argwhere(inside)[wrong][0].tolist()
        check_that(f"size is {values_inside[wrong][0]:g} at x={x}, y={y} and", False, _ALLOWED)
    sizes = np.full(values.shape, _HUGE)
    sizes[inside] = np.maximum(values_inside, np.float32(least))
    return PictureField(sizes, inside)


def _pixels_inside(outline: Outline, values: Array) -> Bools:
    check_shape("size", values.shape, values.ndim == 2 and 0 not in values.shape, "(H, W), a function or a number")
    height, width = values.shape
    low, high = outline.bounds
    fits = (low >= -1).all() and (high <= [width + 1, height + 1]).all()
    check_that(f"the region from {low.tolist()} to {high.tolist()}", fits, f"lie in the {width} x {height} size image")
    y, x = np.mgrid[:height, :width] + 0.5
    inside = outline.contains(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(height, width)
    check_that("the region", inside.any(), "hold the center of a pixel of the size image")
    return inside


def _function_field(sizes: Sizes, outline: Outline, n: int | None, probes: Points) -> Field:
    factor = 1.0 if n is None else estimated_factor(sizes, outline, n, probes)
    return _scaled(TreeField.of(lambda points: factor * sizes(points), outline, probes), n)


def estimated_factor(sizes: Sizes, outline: Outline, n: int, probes: Points) -> float:
    """Return by what sizes have to be multiplied for about `n` vertices, from a grid or, in thin regions, probes."""
    (low, high), n_cells = outline.bounds, int(SAMPLES_OF_FIGURE**0.5)
    x, y = np.meshgrid(*(low + (np.arange(n_cells)[:, None] + 0.5) / n_cells * (high - low)).T)
    grid = np.stack([x.ravel(), y.ravel()], axis=1)
    inside = grid[outline.contains(grid)]
    places = inside if len(inside) else probes
    area = float((high - low).prod()) * len(places) / len(grid)
    return (float((sizes(places) ** -2).mean()) * area / n) ** 0.5


def _scaled(field: Field, n: int | None) -> Field:
    if n is None:
        return field
    if not field.count > 0:
        raise ValueError("the region is so narrow that the border leaves no room for a mesh")
    return field.scaled((field.count / n) ** 0.5)
