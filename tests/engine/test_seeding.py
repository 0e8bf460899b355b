import tracemalloc

import numpy as np
import pytest
import reference

from cvtimg import tessellate
from cvtimg._shared.types import Array, Floats
from cvtimg.colors import color_samples
from cvtimg.engine import SEEDINGS
from cvtimg.engine.points import Points, pack
from cvtimg.engine.seeding import TooFewSamplesError


@pytest.fixture
def points(photograph: Array) -> Points:
    samples = color_samples(photograph[::4, ::4])
    return pack(samples.colors, samples.density)


def seeds(name: str, points: Points, n_generators: int, seed: int = 0) -> Floats:
    return SEEDINGS[name](points, n_generators, np.random.default_rng(seed))


@pytest.mark.parametrize("name", SEEDINGS)
@pytest.mark.parametrize("n_generators", [1, 2, 17])
def test_there_are_as_many_different_generators_as_asked(name: str, points: Points, n_generators: int) -> None:
    generators = seeds(name, points, n_generators)
    assert len(np.unique(generators, axis=0)) == n_generators


@pytest.mark.parametrize("name", SEEDINGS)
def test_as_many_generators_as_samples_are_the_samples(name: str) -> None:
    rows = np.array([[0, 0], [5, 1], [9, 9], [2, 7], [2, 8]], np.uint8)
    points = pack(rows, np.array([1.0, 2, 3, 4, 5]))
    generators = seeds(name, points, 5) + points.frame.center
    np.testing.assert_allclose(np.sort(generators, axis=0), np.sort(rows, axis=0), atol=1e-5)


@pytest.mark.parametrize("name", ["k-means++", "random"])
def test_samples_of_no_density_are_never_taken(name: str) -> None:
    rows = np.arange(100, dtype=np.float64)[:, None]
    density = (np.arange(100) % 10 == 0).astype(float)
    points = pack(rows, density)
    taken = seeds(name, points, 10) + points.frame.center
    np.testing.assert_allclose(np.sort(taken[:, 0]), np.arange(0, 100, 10), atol=1e-4)


@pytest.mark.parametrize("name", SEEDINGS)
def test_too_few_distinct_samples_are_an_error(name: str) -> None:
    points = pack(np.array([[1.0], [1.0], [2.0]]), np.array([1.0, 1.0, 0.0]) if name == "random" else np.ones(3))
    with pytest.raises(TooFewSamplesError, match=r"n_generators=3 must be in 1\.\.2"):
        seeds(name, points, 3)


def test_split_divides_at_the_mean_across_the_main_axis() -> None:
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(500, 3)) * [5, 1, 1] @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    density = rng.random(500)
    mean = np.average(rows, axis=0, weights=density)
    axis = np.linalg.eigh(np.cov(rows.T, aweights=density))[1][:, -1]
    above = (rows - mean) @ axis > 0
    expected = [np.average(rows[side], axis=0, weights=density[side]) for side in (above, ~above)]
    points = pack(rows, density)
    np.testing.assert_allclose(
        np.sort(seeds("split", points, 2) + points.frame.center, axis=0), np.sort(expected, axis=0), atol=1e-5
    )


@pytest.mark.parametrize(("name", "factor"), [("split", 1.5), ("k-means++", 1.5), ("random", 3)])
def test_seeds_are_within_a_factor_of_a_converged_energy(name: str, factor: float, points: Points) -> None:
    rows, density = points.rows(), points.density[: points.n_points]
    generators = seeds(name, points, 16)
    converged = generators
    for _ in range(50):
        converged = reference.lloyd_step(rows, density, converged)
    assert reference.energy(rows, density, generators) < factor * reference.energy(rows, density, converged)


@pytest.mark.parametrize("n_generators", [2, 3, 40])
def test_split_ends_where_rounding_alone_tells_points_apart(n_generators: int) -> None:
    rows = np.full((3000, 3), 0.1)
    rows[:2] = 0.1 + np.array([[1e-16, 0, 0], [0, 3e-16, 0]])
    rows[-1] = 5.0
    points = pack(rows, np.random.default_rng(0).random(3000))
    try:
        assert len(seeds("split", points, n_generators)) == n_generators
    except TooFewSamplesError as error:
        assert n_generators > 2, error  # noqa: PT017


def test_samples_of_many_dimensions_are_divided_without_covariances_of_all_of_them() -> None:
    rng = np.random.default_rng(0)
    centers = rng.normal(size=(12, 1000)) * 5
    labels = np.repeat(np.arange(12), 20)
    rows = (centers[labels] + rng.normal(size=(240, 1000))).astype(np.float32)
    tracemalloc.start()
    found = tessellate(rows, 12, init="split")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len({(one, other) for one, other in zip(found.labels.tolist(), labels.tolist(), strict=True)}) == 12
    assert peak < 12 * rows.nbytes  # covariances would be 12 * 1001^2 * 8 bytes, 100 times the rows
