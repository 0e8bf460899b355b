"""What can be taken for the size of edges."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_places
from cvtimg.meshes.fields import Field, PictureField
from cvtimg.meshes.outlines import Outline
from cvtimg.meshes.trees import TreeField
from cvtimg.meshes.triangulation import Triangulation

Points = NDArray[np.float64]
#: What `mesh_region` takes for `size`.
SizeLike: TypeAlias = float | ArrayLike | Callable[[Points], ArrayLike]

#: The size of pixels that are not meshed.
_HUGE = np.float32(1e30)
#: Cells along each axis by which the number of vertices is estimated first.
_ESTIMATE = 256


class MeshSize:
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
    >>> import numpy as np
    >>> from cvtimg.meshes import MeshSize
    >>> size = MeshSize([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], [0.1, 0.2, 0.3])
    >>> size(np.array([[0.5, 0.0], [0.0, 5.0]])).round(3).tolist()
    [0.15, 0.3]
    """

    def __init__(self, points: ArrayLike, triangles: ArrayLike, sizes: ArrayLike) -> None:
        places, corners = check_places("points", points, 2), np.asarray(triangles)
        if corners.ndim != 2 or corners.shape[1] != 3 or corners.dtype.kind not in "iu":
            raise ValueError(f"triangles of shape {corners.shape} and type {corners.dtype} must be (T, 3) integers")
        values = np.asarray(sizes, np.float64)
        if values.shape != (len(places),) or not ((values > 0) & (values < np.inf)).all():
            raise ValueError(f"sizes of shape {values.shape} must be ({len(places)},), finite and > 0")
        from scipy.spatial import cKDTree

        flat = np.arange(len(places)) < 0
        nothing = np.empty((0, 2), np.int32)
        self._mesh = Triangulation(places, flat, _counter_clockwise(places, corners.astype(np.int32)), nothing)
        self._used = np.unique(self._mesh.triangles).astype(np.int32)
        self._tree = cKDTree(places[self._used])
        self._sizes = values

    def __call__(self, points: Points) -> NDArray[np.float64]:
        """Return sizes (M,) at (M, 2) points; outside of the mesh, that of the nearest vertex."""
        near = self._used[self._tree.query(points)[1]]
        found, shares = self._mesh.locate(points, near)
        outside = shares.min(axis=1) < -1e-9
        values: NDArray[np.float64] = (self._sizes[self._mesh.triangles[found]] * shares).sum(axis=1)
        values[outside] = self._sizes[near[outside]]
        return values


def _counter_clockwise(points: Points, triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    if not turn.all():
        raise ValueError(f"triangles[{int(np.flatnonzero(turn == 0)[0])}] has no area")
    return np.where(turn[:, None] < 0, triangles[:, ::-1], triangles)


def size_field(outline: Outline, size: SizeLike, n: int | None, least: float, probes: Points) -> Field:
    """Make a field of sizes; with `n`, only their ratios count, and they are scaled to about so many vertices.

    Parameters
    ----------
    outline : Outline
    size : float, (H, W) array or callable
    n : int or None
    least : float
        A size > 0 where 0 is allowed, too; or 0.
    probes : (P, 2) array
        Points where sizes may be lower than around.
    """
    if callable(size):
        return _function_field(_Checked(size, outline, least), outline, n, probes)
    values = np.asarray(size)
    if values.ndim == 0:
        value = float(values)
        if not 0 < value < np.inf:
            raise ValueError(f"size={value} must be a finite number > 0, an image or a function")
        if outline.mask is None:
            return _function_field(lambda points: np.full(len(points), value), outline, n, probes)
        values = np.full(outline.mask.shape, value, np.float32)
    inside = outline.mask if outline.mask is not None else _pixels_inside(outline, values)
    return _scaled(_picture_field(values, inside, least), n)


def _picture_field(values: NDArray[Any], inside: NDArray[np.bool_], least: float) -> PictureField:
    if values.ndim != 2 or values.shape != inside.shape:
        raise ValueError(f"size of shape {values.shape} must be {inside.shape}, as the region")
    if values.dtype.kind not in "biuf":
        raise TypeError(f"size of type {values.dtype} must be of integers or of floating point numbers")
    own = values[inside].astype(np.float32)
    wrong = ~((own > 0 if least == 0 else own >= 0) & (own < np.inf))
    if wrong.any():
        y, x = np.argwhere(inside)[wrong][0].tolist()
        raise ValueError(f"size is {own[wrong][0]:g} at x={x}, y={y} and must be finite and > 0 in the region")
    sizes = np.full(values.shape, _HUGE)
    sizes[inside] = np.maximum(own, np.float32(least))
    return PictureField(sizes, inside)


def _pixels_inside(outline: Outline, values: NDArray[Any]) -> NDArray[np.bool_]:
    if values.ndim != 2 or 0 in values.shape:
        raise ValueError(f"size of shape {values.shape} must be (H, W), a function or a number")
    height, width = values.shape
    if (outline.bounds[0] < -1).any() or (outline.bounds[1] > [width + 1, height + 1]).any():
        low, high = outline.bounds.tolist()
        raise ValueError(f"the region from {low} to {high} must lie in the size image of {width} x {height} pixels")
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    inside = outline.contains(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(values.shape)
    if not inside.any():
        raise ValueError(f"no pixel of the size image of {width} x {height} pixels has its center in the region")
    return inside


class _Checked:
    """A function of the user's, checked at each call; outside of the region it may return anything."""

    def __init__(self, function: Callable[[Points], Any], outline: Outline, least: float) -> None:
        self._function, self._outline, self._least = function, outline, least

    def __call__(self, points: Points) -> NDArray[np.float64]:
        values = np.array(self._function(points), np.float64)
        if values.shape != (len(points),):
            raise ValueError(f"size returned shape {values.shape} and must return ({len(points)},), one per point")
        wrong = np.flatnonzero(~((values > 0 if self._least == 0 else values >= 0) & (values < np.inf)))
        if len(wrong):
            inside = self._outline.contains(points[wrong])
            if inside.any():
                place, value = points[wrong][inside][0].tolist(), values[wrong][inside][0]
                raise ValueError(f"size is {value:g} at {place} and must be finite and > 0 in the region")
            values[wrong] = float(_HUGE)
        return np.maximum(values, self._least)


def _function_field(
    sizes: Callable[[Points], NDArray[np.float64]], outline: Outline, n: int | None, probes: Points
) -> Field:
    if n is None:
        return TreeField.of(sizes, outline, probes)
    low, high = outline.bounds
    x, y = np.meshgrid(*(low + (np.arange(_ESTIMATE)[:, None] + 0.5) / _ESTIMATE * (high - low)).T)
    grid = np.stack([x.ravel(), y.ravel()], axis=1)
    grid = grid[outline.contains(grid)]
    if not len(grid):  # very thin
        grid = probes
    mean = float((sizes(grid) ** -2).mean())
    area = float((high - low).prod()) * len(grid) / _ESTIMATE**2
    factor = (mean * area / n) ** 0.5
    return _scaled(TreeField.of(lambda points: factor * sizes(points), outline, probes), n)


def _scaled(field: Field, n: int | None) -> Field:
    return field if n is None else field.scaled((field.count / n) ** 0.5)
