"""Plain NumPy oracles: slow, short and obviously right."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from scipy.optimize import linear_sum_assignment

from cvtimg._shared.threads import limit_threads, n_threads
from cvtimg._shared.types import Array, Bools, Floats, Indices


def squared_distances(samples: Array, generators: Array) -> Floats:
    """(M, K) squared distance of each sample to each generator."""
    return ((samples[:, None].astype(float) - generators[None]) ** 2).sum(axis=2)


def energy(samples: Array, density: Array, generators: Array) -> float:
    """Sum of density times squared distance to the nearest generator."""
    return float(density @ squared_distances(samples, generators).min(axis=1))


def lloyd_step(samples: Array, density: Array, generators: Array) -> Floats:
    """Move every generator to the mean of its Voronoi cell; those of empty cells stay."""
    labels = squared_distances(samples, generators).argmin(axis=1)
    moved = generators.astype(float).copy()
    for k in range(len(generators)):
        if density[labels == k].sum() > 0:
            moved[k] = np.average(samples[labels == k], axis=0, weights=density[labels == k])
    return moved


def composite(image: Array, background: float) -> Floats:
    """(H, W, C - 1) a picture with alpha over a plain grey, in 0..1."""
    peak = np.iinfo(image.dtype).max if image.dtype.kind == "u" else 1
    unit = image / peak
    return unit[..., :-1] * unit[..., -1:] + background * (1 - unit[..., -1:])


def seen_energy(one: Array, other: Array) -> float:
    """Sum of squared differences; with alpha, the mean of what is seen over black and over white."""
    peak = float(np.iinfo(one.dtype).max) if one.dtype.kind == "u" else 1.0
    if one.ndim == 2 or one.shape[2] not in (2, 4):
        return float(((one.astype(float) - other) ** 2).sum())
    return sum(float(((composite(one, b) - composite(other, b)) ** 2).sum()) for b in (0, 1)) / 2 * peak**2


def same_partition(one: Array, other: Array) -> float:
    """Share of the elements that two labelings put into the same part, when parts are matched one to one at best."""
    _, first = np.unique(one, return_inverse=True)
    _, second = np.unique(other, return_inverse=True)
    table = np.zeros((first.max() + 1, second.max() + 1))
    np.add.at(table, (first.ravel(), second.ravel()), 1)
    return float(table[linear_sum_assignment(table, maximize=True)].sum() / table.sum())


def shape_of(polygon: Any) -> Any:
    """Return a polygon of cvtimg as one of Shapely."""
    return shapely.Polygon(polygon.rings[0], polygon.rings[1:])


def covered(polygon: Any, shape: tuple[int, int]) -> Bools:
    """Tell which centers of pixels are in a polygon."""
    return inside_rings(polygon.rings, shape)


def inside_rings(rings: Any, shape: tuple[int, int]) -> Bools:
    """Tell which centers of pixels are inside of rings, by the rule of even and odd."""
    down, right = np.indices(shape) + 0.5
    inside = [shapely.contains_xy(shapely.Polygon(ring), right, down) for ring in rings]
    return np.logical_xor.reduce(inside)


def signed_area(ring: Array) -> float:
    """Return the area in a closed ring of points (x, y), negative for one that runs the other way."""
    x, y = ring.T
    return float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) / 2)


def edge_weighted_energy(
    values: Array,
    labels: Array,
    edge_weight: float,
    radius: int = 3,
    weights: Array | None = None,
    volume_power: float = 0,
) -> float:
    """Sum of squared distances to the means of the segments, and of the pairs of near pixels that they part."""
    values = values.astype(float)
    weights = np.ones_like(values) if weights is None else weights.astype(float)
    inside = weights[labels > 0]
    energy = 0.0
    for segment in np.unique(labels[labels > 0]):
        here, own = values[labels == segment], weights[labels == segment]
        masses = own.sum(axis=0)
        means = (own * here).sum(axis=0) / np.where(masses > 0, masses, 1)
        share = own.sum() / inside.sum() if inside.any() else 0.0
        energy += share**volume_power * float((own * (here - means) ** 2).sum())
    height, width = labels.shape
    padded = np.pad(labels, radius)
    n_pairs = 0
    for down in range(-radius, radius + 1):
        for right in range(-radius, radius + 1):
            if 0 < down**2 + right**2 <= radius**2:
                other = padded[radius + down : radius + down + height, radius + right : radius + right + width]
                n_pairs += int(((labels != other) & (labels > 0) & (other > 0)).sum())
    return energy + edge_weight * n_pairs


def at_threads(make: Callable[[], Any]) -> list[Any]:
    """Make something with one thread, and again with three."""
    before, results = n_threads(), []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cvtimg._shared.threads._TO_HAND_OVER", 1e-6)  # also small parts are handed over
        for number in (1, 3):
            limit_threads(number)
            results.append(make())
        limit_threads(before)
    return results


def of_three_threads(result: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function that computes a result in three threads."""
    return lambda given: at_threads(lambda: result(given))[1]


def shoelace(corners: Array) -> float:
    """Signed area of a polygon (M, 2), by the formula of surveyors."""
    x, y = corners.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def ring(n: int, radius: float = 1.0) -> Floats:
    """Return the corners (n, 2) of a regular polygon around the origin, counterclockwise."""
    turns = 2 * np.pi * np.arange(n) / n
    return radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)


def sets_of(triangles: Array) -> set[tuple[int, ...]]:
    """Return triangles as sets of corners, whichever comes first and however they turn."""
    return set(map(tuple, np.sort(triangles, axis=1).tolist()))


def uniform_cell_moments(mesh: Any) -> Floats:
    """Integrals (N, 3) of x over the cells of a triangulation of the sphere."""
    moments = np.empty_like(mesh.points)
    mesh.fills_uniform(moments)(0, len(moments))
    return moments


def cube() -> tuple[Floats, Indices]:
    """Return the vertices of a cube, from -1 to 1, and its twelve triangles: what computer-aided design gives."""
    corners = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1, 1) for z in (-1, 1)])
    squares = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corners, np.array([[a, b, c] for a, b, c, _ in squares] + [[a, c, d] for a, _, c, d in squares])


def assert_the_guide_tells(page: str, efforts: Mapping[str, tuple[float, ...]]) -> None:
    """A page has a table with these numbers of each effort."""
    lines = (Path(__file__).parents[1] / "docs" / page).read_text(encoding="utf-8").replace(",", "").splitlines()
    for name, numbers in efforts.items():
        (row,) = (line.strip("|").split("|")[1:] for line in lines if line.startswith(f"| `{name}` |"))
        assert tuple(map(float, row)) == numbers
