"""No verb is worse than what anybody would do without it: blocks, random points, Pillow's palettes, one start."""

from collections.abc import Callable
from typing import Any

import numpy as np
import PIL.Image
import trimesh
from reference import of_three_threads
from relations.relation import not_above, quick_and_wide
from relations.remembering import beside
from relations.test_pictures import color_picture
from scipy.spatial import cKDTree
from scipy.stats import qmc

import cvtimg
from cvtimg._shared.types import Array, Floats, Indices

Points = Floats


def squared_error(image: Array, other: Array) -> float:
    return float(np.square(image.astype(float) - other).mean())


def of_pillow(method: PIL.Image.Quantize) -> Callable[[Array], float]:
    def error(image: Array) -> float:
        few = PIL.Image.fromarray(image).quantize(8, method=method, dither=PIL.Image.Dither.NONE)
        return squared_error(image, np.asarray(few.convert("RGB")))

    return error


def of_parts(labels: Callable[[Array], Array]) -> Callable[[Array], float]:
    """Return the error of a picture whose parts have their mean colors."""

    def error(image: Array) -> float:
        parts, colors = labels(image).ravel(), image.reshape(-1, 3)
        sums = np.stack([np.bincount(parts, band) for band in colors.T], axis=1)
        return squared_error(colors, (sums / np.maximum(np.bincount(parts), 1)[:, None])[parts])

    return error


def blocks(image: Array) -> Indices:
    """Return 88 squares of 4 x 4 pixels, of a picture of 32 x 44."""
    rows, columns = np.indices(image.shape[:2]) // 4
    return np.asarray(11 * rows + columns)


def distance_to(points: Points, samples: Points) -> float:
    """Return the mean squared distance of samples to their nearest point: the energy of points."""
    return float(np.square(cKDTree(points).query(samples)[0]).mean())


def cube(rng: np.random.Generator) -> tuple[int, int, int]:
    """Return a number of points, of dimensions and a seed."""
    return int(rng.integers(8, 80)), int(rng.integers(2, 6)), int(rng.integers(1 << 31))


def energy_in_cube(points: Callable[[int, int, int], Points]) -> Callable[[tuple[int, int, int]], float]:
    def energy(given: tuple[int, int, int]) -> float:
        n_dims, seed = given[1:]
        return distance_to(points(*given), np.random.default_rng(seed).random((4000, n_dims)))

    return energy


def energy_on_sphere(points: Callable[[int], Points]) -> Callable[[tuple[int, int, int]], float]:
    def energy(given: tuple[int, int, int]) -> float:
        directions = np.random.default_rng(given[2]).normal(size=(20000, 3))
        return distance_to(points(given[0]), directions / np.linalg.norm(directions, axis=1, keepdims=True))

    return energy


def spiral(n: int) -> Points:
    """Return the points of a Fibonacci lattice on the sphere."""
    heights, turns = 1 - (2 * np.arange(n) + 1) / n, np.pi * (1 + 5**0.5) * np.arange(n)
    radii = np.sqrt(1 - heights**2)
    return np.stack([radii * np.cos(turns), radii * np.sin(turns), heights], axis=1)


TORUS = trimesh.creation.torus(1, 0.4)


def energy_on_torus(points: Callable[[int, int], Points]) -> Callable[[tuple[int, int, int]], float]:
    samples = trimesh.sample.sample_surface(TORUS, 10000, seed=1)[0]
    return lambda given: distance_to(points(given[0], given[2]), samples)


def random_on_torus(n: int, seed: int) -> Points:
    return np.asarray(trimesh.sample.sample_surface(TORUS, n, seed=seed)[0])


_BLOCKS = of_parts(blocks)
_RIVALS: list[tuple[str, str, Any, Any, Any]] = [
    (
        "quantize",
        f"Pillow's {method.name.lower()}",
        color_picture,
        lambda image: squared_error(image, cvtimg.quantize(image, 8).image),
        of_pillow(method),
    )
    for method in (PIL.Image.Quantize.MEDIANCUT, PIL.Image.Quantize.FASTOCTREE)
] + [
    ("superpixels", "blocks", color_picture, of_parts(lambda image: cvtimg.superpixels(image, 88).labels), _BLOCKS),
    ("mosaic", "blocks", color_picture, of_parts(lambda image: cvtimg.mosaic(image, 88).labels), _BLOCKS),
    (
        "design",
        "a Latin hypercube",
        cube,
        energy_in_cube(lambda n, n_dims, seed: cvtimg.design(n, n_dims, rng=seed).unit_points),
        energy_in_cube(lambda n, n_dims, seed: qmc.LatinHypercube(n_dims, rng=seed).random(n)),
    ),
    (
        "sphere_grid",
        "a Fibonacci lattice",
        cube,
        energy_on_sphere(lambda n: cvtimg.sphere_grid(n).points),
        energy_on_sphere(spiral),
    ),
    (
        "surface_points",
        "random points",
        cube,
        energy_on_torus(lambda n, _: cvtimg.surface_points((TORUS.vertices, TORUS.faces), n).points),
        energy_on_torus(random_on_torus),
    ),
]
RELATIONS = [beside(*row, not_above()) for row in _RIVALS]
RELATIONS += [
    beside(verb, "three threads", cube, result, of_three_threads(result))
    for verb, _, inputs, result, _ in _RIVALS
    if inputs is cube
]
test_a_verb_is_not_worse_than_the_trivial_way, test_a_verb_is_never_worse_than_the_trivial_way = quick_and_wide(
    RELATIONS
)
