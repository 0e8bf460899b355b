"""The estimator is what scikit-learn expects, over the same engine."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reference import squared_distances
from sklearn.base import clone
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils.estimator_checks import parametrize_with_checks

from cvtimg import CVT, tessellate
from cvtimg.engine import EFFORTS, METHODS, SEEDINGS

RNG = np.random.default_rng(8)
SAMPLES = RNG.normal(size=(300, 4)) @ RNG.normal(size=(4, 4)) + 100
WEIGHTS = RNG.integers(0, 4, 300)


# Some checks ask for 8 clusters of 4 distinct samples, of which CVT warns as KMeans does; scikit-learn's own tests
# ignore that warning too. All others are errors here.
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:n_clusters=8 is more than:sklearn.exceptions.ConvergenceWarning")
@parametrize_with_checks([CVT(), CVT(effort="best"), CVT(n_clusters=3, method="transfer", init="random")])
def test_every_check_of_scikit_learn_passes(estimator: CVT, check: Callable[[CVT], None]) -> None:
    check(estimator)


# The engine's results under scikit-learn's names


# One at a time; optimal1d takes one dimension.
@pytest.mark.parametrize(
    ("init", "method", "effort"),
    [
        *(("split", "lloyd", effort) for effort in EFFORTS),
        *(("random", method, "fast") for method in METHODS if method != "optimal1d"),
        *((init, "lloyd", "fast") for init in SEEDINGS),
        pytest.param(SAMPLES[:6], "transfer", "balanced", id="given"),
    ],
)
def test_it_finds_what_tessellate_finds(init: Any, method: str, effort: str) -> None:
    options: dict[str, Any] = {"init": init, "method": method, "effort": effort}
    cvt = CVT(6, random_state=5, **options).fit(SAMPLES, sample_weight=WEIGHTS)
    result = tessellate(SAMPLES, 6, density=WEIGHTS, rng=5, **options)
    order = np.lexsort(result.generators.T[::-1]) if isinstance(init, str) else np.arange(6)
    assert cvt.inertia_ <= result.energy * (1 + 1e-6)
    if method == "lloyd":  # others may stop while a sample is not in the cell of its nearest generator
        assert cvt.inertia_ == pytest.approx(result.energy, rel=1e-6)
        np.testing.assert_array_equal(order[cvt.labels_], result.labels)
    assert cvt.energies_[-1] == pytest.approx(result.energies[-1], rel=1e-6)
    np.testing.assert_allclose(cvt.cluster_centers_, result.generators[order], rtol=1e-6)


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.uint8])
@pytest.mark.parametrize("offset", [0, 1e4])
def test_prediction_on_the_training_data_gives_its_labels(dtype: Any, offset: float) -> None:
    grid = np.stack(np.meshgrid(*[np.arange(12)] * 2), axis=-1).reshape(-1, 2)  # full of ties
    samples = (grid if dtype == np.uint8 else grid / 7 + offset).astype(dtype)
    cvt = CVT(7).fit(samples)
    np.testing.assert_array_equal(cvt.predict(samples), cvt.labels_)
    np.testing.assert_array_equal(CVT(7).fit_predict(samples), cvt.labels_)
    np.testing.assert_array_equal(CVT(7).fit_transform(samples), cvt.transform(samples))


@pytest.mark.slow
def test_a_sample_has_one_label_in_any_company() -> None:
    cvt = CVT(30).fit(RNG.normal(size=(30, 2)))
    centers = cvt.cluster_centers_
    middles = ((centers[:, None] + centers[None]) / 2).reshape(-1, 2)  # rounding alone decides their labels
    alone = np.concatenate([cvt.predict(row[None]) for row in middles])
    np.testing.assert_array_equal(cvt.predict(middles), alone)
    np.testing.assert_array_equal(cvt.predict(np.concatenate([middles, middles[:1] + 1000]))[:-1], alone)


# Randomness


def test_the_same_seed_gives_the_same_bits_and_no_seed_others() -> None:
    def centers(state: Any) -> bytes:
        fitted = CVT(20, init="random", effort="fast", random_state=state).fit(SAMPLES)
        return bytes(fitted.cluster_centers_.tobytes())

    assert centers(1) == centers(1) != centers(2)
    assert centers(np.random.RandomState(1)) == centers(np.random.RandomState(1))
    state = np.random.RandomState(1)
    assert centers(state) != centers(state)
    assert centers(None) != centers(None)


# Too few samples


def test_fewer_distinct_samples_than_clusters_are_fewer_clusters_and_a_warning() -> None:
    samples = np.repeat([[3.0, 1], [0, 4], [0, 0]], 5, axis=0)
    with pytest.warns(ConvergenceWarning, match="n_clusters=5 is more than the 3 distinct samples") as caught:
        cvt = CVT(5).fit(samples)
    assert caught[0].filename == __file__
    assert cvt.cluster_centers_.tolist() == [[0, 0], [0, 4], [3, 1]]
    assert (cvt.labels_.tolist(), cvt.inertia_) == ([2] * 5 + [1] * 5 + [0] * 5, 0)
    assert cvt.get_feature_names_out().tolist() == ["cvt0", "cvt1", "cvt2"]
    with pytest.warns(ConvergenceWarning, match="2 distinct samples of positive weight"):
        cvt.fit(samples, sample_weight=[1] * 10 + [0] * 5)
    assert len(cvt.labels_) == 15


# Errors


@pytest.mark.parametrize(
    ("parameters", "weights", "message"),
    [
        ({"n_clusters": 0}, None, "n_clusters=0 must be in 1..300, for n_samples=300"),
        ({"n_clusters": 301}, None, "n_clusters=301 must be in 1..300, for n_samples=300"),
        ({"init": SAMPLES[:3]}, None, r"init of shape \(3, 4\) must be \(8, 4\)"),
        ({"random_state": -1}, None, "non-negative"),
        ({"random_state": "x"}, None, "cannot be used to seed"),
        ({}, np.ones(299), r"sample_weight of shape \(299,\) must be \(300,\)"),
        ({}, np.ones((300, 1)), r"sample_weight of shape \(300, 1\) must be"),
        ({}, -np.ones(300), "sample_weight must be >= 0"),
        ({}, np.zeros(300), "not zero for all samples"),
        ({}, np.full(300, np.nan), "sample_weight contains NaN"),
    ],
)
def test_wrong_parameters_and_weights_are_named(parameters: dict[str, Any], weights: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        CVT(**parameters).fit(SAMPLES, sample_weight=weights)
    if weights is not None:
        with pytest.raises(ValueError, match=message):
            CVT().fit(SAMPLES).score(SAMPLES, sample_weight=weights)


# Samples in blocks


def in_blocks(array: Any, length: int = 70) -> Any:
    da = pytest.importorskip("dask.array")
    return da.from_array(array, chunks=(length, *array.shape[1:]))


def test_blocks_are_fitted_as_in_memory() -> None:
    whole = CVT(6, init=SAMPLES[:6]).fit(SAMPLES, sample_weight=WEIGHTS)
    cvt = CVT(6, init=SAMPLES[:6]).fit(in_blocks(SAMPLES), sample_weight=in_blocks(WEIGHTS))
    np.testing.assert_allclose(cvt.cluster_centers_, whole.cluster_centers_, atol=1e-6)
    np.testing.assert_allclose(cvt.masses_, whole.masses_)
    assert cvt.inertia_ == pytest.approx(whole.inertia_, rel=1e-6)
    assert cvt.labels_.chunks == cvt.predict(in_blocks(SAMPLES)).chunks == ((70, 70, 70, 70, 20),)
    np.testing.assert_array_equal(cvt.labels_.compute(), cvt.predict(SAMPLES))
    assert clone(cvt).get_params()["n_clusters"] == 6


def test_blocks_are_labelled_measured_and_scored_one_by_one() -> None:
    cvt = CVT(6).fit(SAMPLES)
    np.testing.assert_array_equal(cvt.predict(in_blocks(SAMPLES)).compute(), cvt.labels_)
    distances = cvt.transform(in_blocks(SAMPLES))
    np.testing.assert_allclose(cvt.transform(SAMPLES), np.sqrt(squared_distances(SAMPLES, cvt.cluster_centers_)))
    assert distances.shape == (300, 6)
    np.testing.assert_array_equal(distances.compute(), cvt.transform(SAMPLES))
    score = cvt.score(in_blocks(SAMPLES), sample_weight=in_blocks(WEIGHTS))
    assert score == pytest.approx(cvt.score(SAMPLES, sample_weight=WEIGHTS), rel=1e-9)
    with pytest.raises(ValueError, match=r"X of shape \(300, 3\) must be \(N, 4\), as the samples of fit"):
        cvt.predict(in_blocks(SAMPLES[:, :3]))


def test_a_long_fit_keeps_its_state(tmp_path: Path) -> None:
    cvt = CVT(6, checkpoint=tmp_path / "state.npz").fit(in_blocks(SAMPLES))
    assert (tmp_path / "state.npz").exists()
    again = clone(cvt).fit(in_blocks(SAMPLES))
    np.testing.assert_array_equal(again.cluster_centers_, cvt.cluster_centers_)
    with pytest.raises(ValueError, match="checkpoint needs samples in blocks"):
        cvt.fit(SAMPLES)


# Online: MacQueen's method


def test_each_generator_is_the_mean_of_what_it_has_met() -> None:
    rng = np.random.default_rng(2)
    cvt = CVT(3).partial_fit(SAMPLES[:20])
    centers, masses = cvt.cluster_centers_.copy(), cvt.masses_.copy()
    weights = rng.integers(0, 3, 280)
    cvt.partial_fit(SAMPLES[20:], sample_weight=weights)
    for row, weight in zip(SAMPLES[20:], weights, strict=True):
        near = squared_distances(row[None], centers)[0].argmin()
        centers[near] = (masses[near] * centers[near] + weight * row) / max(masses[near] + weight, 1)
        masses[near] += weight
    np.testing.assert_allclose(cvt.cluster_centers_, centers, rtol=1e-6)
    np.testing.assert_allclose(cvt.masses_, masses)
