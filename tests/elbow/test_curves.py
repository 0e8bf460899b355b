from contextlib import suppress

import kmeans1d
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import energy

from cvtimg import energy_curve, segment, tessellate
from cvtimg._shared.pixels import AlphaArray
from cvtimg._shared.types import Array, Bytes
from cvtimg.colors import color_samples
from cvtimg.elbow import RULES, TargetMissedError
from cvtimg.elbow.curves import EnergyCurve, auto_count
from cvtimg.elbow.rules import Scale


def curve_of(energies: list[float], peak: float | None = None) -> EnergyCurve:
    return EnergyCurve(np.array(energies), (), Scale(100.0, peak))


def flat_picture(n_colors: int, sigma: float, seed: int) -> Bytes:
    """Draw bands of unequal height, in colors on a lattice, with noise."""
    rng = np.random.default_rng(seed)
    lattice = np.stack(np.meshgrid(*[[30, 90, 160, 225]] * 3), axis=-1).reshape(-1, 3)
    colors = rng.permutation(lattice)[:n_colors]
    heights = 4 + rng.multinomial(96, rng.dirichlet(np.ones(n_colors)))
    bands = colors.repeat(heights, axis=0)[:, None].repeat(64, axis=1)
    return np.clip(np.rint(bands + sigma * rng.standard_normal(bands.shape)), 0, 255).astype(np.uint8)


@settings(max_examples=15)
@given(st.integers(0, 2**32), st.integers(1, 40), st.integers(2, 5))
def test_the_curve_is_the_energy_of_its_generators(seed: int, n_rows: int, n_dims: int) -> None:
    rng = np.random.default_rng(seed)
    rows, density = rng.integers(0, 9, (n_rows, n_dims)).astype(float), rng.random(n_rows) + 0.1
    curve = energy_curve(rows, 12, density=density)
    for k, generators in enumerate(curve.generators, 1):
        assert generators.shape == (k, n_dims)
        assert curve.energies[k - 1] == pytest.approx(energy(rows, density, generators), rel=1e-4, abs=1e-6)


def test_energies_of_a_photograph_are_those_of_generators_and_about_those_of_tessellations(photograph: Array) -> None:
    samples = color_samples(photograph)
    curve = energy_curve(samples, 24)
    for k in (1, 2, 3, 5, 8, 13, 24):
        measured = energy(samples.colors, samples.density, curve.generators[k - 1])
        assert curve.energies[k - 1] == pytest.approx(measured, rel=1e-6)
        assert measured <= 1.03 * tessellate(samples, k).energy


def test_with_effort_no_energy_is_above_that_of_a_single_tessellation(photograph: Array) -> None:
    curve = energy_curve(photograph, 12, effort="balanced")
    samples = color_samples(photograph)
    alone = np.array([tessellate(samples, k).energy for k in range(1, 13)])
    assert (curve.energies <= alone * (1 + 1e-9)).all()
    assert (curve.energies <= energy_curve(photograph, 12).energies).all()


def test_a_grey_curve_is_the_optimum_at_every_k() -> None:
    levels = np.random.default_rng(3).normal(120, 40, (30, 30)).clip(0, 255).astype(np.uint8)
    curve = energy_curve(levels, 20)
    values = levels.ravel().astype(float)
    for k in range(1, 21):
        clustered = kmeans1d.cluster(values, k)
        best = ((values - np.array(clustered.centroids)[clustered.clusters]) ** 2).sum()
        assert curve.energies[k - 1] == pytest.approx(best, rel=1e-9)


@pytest.mark.parametrize("n_dims", [1, 3, 40])
def test_rows_that_are_all_equal_are_one_cluster(n_dims: int) -> None:
    curve = energy_curve(np.full((40, n_dims), 0.1), 4)
    assert curve.energies.tolist() == [0]
    assert curve.elbow() == 1


def test_weighted_energies_are_about_those_of_tessellations() -> None:
    rows = np.random.default_rng(0).lognormal(0, 1, (300, 2))
    for power in (1, 2):
        curve = energy_curve(rows, 12, volume_power=power)
        assert curve.energies[5] <= 1.1 * tessellate(rows, 6, volume_power=power).weighted_energy


@pytest.mark.parametrize("n_colors", [1, 2, 3, 6, 12])
def test_an_exact_number_of_colors_is_found(n_colors: int) -> None:
    assert energy_curve(flat_picture(n_colors, 0, n_colors)).elbow() == n_colors


@pytest.mark.slow
def test_the_default_rule_finds_the_colors_under_noise() -> None:
    cases = [(n_colors, sigma, seed) for seed, n_colors in enumerate((2, 3, 5, 8, 12)) for sigma in (2, 8)]
    found = [auto_count(flat_picture(*case))[0] == case[0] for case in cases]
    assert all(found)


def test_the_colors_can_lie_in_other_spaces_and_have_alpha() -> None:
    picture = flat_picture(5, 2, 3)
    assert auto_count(picture, space="lab")[0] == 5
    opaque = np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)]).view(AlphaArray)
    assert auto_count(opaque)[0] == 5


def test_rules_on_curves_made_by_hand() -> None:
    bent = [1000.0, 400, 100, 95, 92, 90, 88, 87]
    assert curve_of(bent).elbows() == {"chord": 3}
    assert curve_of([1000.0, 400, 100, 40, 20, 10]).elbow("variance") == 4
    assert curve_of([1000.0, 400, 100, 40, 20, 10]).elbow("variance", 0.5) == 2
    assert curve_of([65025.0, 650.25, 65.025], 255.0).elbow("psnr", 40.0) == 2
    assert Scale(6, 255.0).floor(np.ones(1)) == pytest.approx(6 / 12)  # of samples that are rounded to whole levels
    assert Scale(1, None).floor(np.array([8.0, 1.0])) == pytest.approx(8e-3)  # of tables, that are not
    numbers = np.arange(1.0, 17)  # the energy falls by a power of them that is so much greater up to four
    bends = [np.maximum(numbers**-power, 4 ** (1 - power) / numbers) for power in (1.4, 3.0)]
    assert [curve_of((1e4 * bend).tolist()).is_clear for bend in bends] == [False, True]


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_copes_with_the_shortest_curves(rule: str) -> None:
    for energies in ([0.0], [5.0], [5.0, 0.0], [5.0, 2.0], [5.0, 5.0, 5.0], [3.0, 2.0, 1.0], [4.0, 1.0, 0.0]):
        with suppress(TargetMissedError):
            assert 1 <= curve_of(energies, 255.0).elbow(rule) <= len(energies)
    assert curve_of([0.0], 255.0).elbow(rule) == 1


def test_a_target_that_is_missed_is_said() -> None:
    curve = curve_of([100.0, 50.0, 10.0], 255.0)
    with pytest.raises(TargetMissedError, match=r"target=0.95 is not reached by n_max=3 generators: 0\.9 of the var"):
        curve.elbow("variance")
    with pytest.raises(TargetMissedError, match=r"target=90 is not reached by n_max=3 generators: \d+\.\d+ dB"):
        curve.elbow("psnr", 90)
    assert curve.elbow("variance", 0.9) == 3
    assert "variance" not in curve.elbows()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_as_many_generators_as_samples_are_exact_whatever_the_weights(dtype: type) -> None:
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(5, 3)).astype(dtype)[rng.integers(0, 5, 300)]
    curve = energy_curve(rows, 8, density=rng.random(300))
    assert curve.n_max == 5
    assert curve.energies[-1] == 0
    assert (curve.energies[:-1] > 0).all()


def test_a_curve_is_shown_in_one_line_and_drawn_in_a_notebook() -> None:
    curve = curve_of([100.0, 50.0, 10.0, 9.0], 255.0)
    assert len(repr(curve).splitlines()) == 1
    assert "k=1..4" in repr(curve)
    assert all((each._repr_png_() or b"").startswith(b"\x89PNG") for each in (curve, curve_of([0.0])))


def test_what_rules_do_not_know_is_refused() -> None:
    curve = curve_of([5.0, 2.0, 1.0])
    with pytest.raises(ValueError, match="rule='knee' must be one of chord"):
        curve.elbow("knee")
    with pytest.raises(ValueError, match="rule='chord' does not support a target; variance or psnr does"):
        curve.elbow("chord", 3)
    with pytest.raises(ValueError, match="needs colors"):
        curve.elbow("psnr")
    with pytest.raises(ValueError, match="n_max=0"):
        energy_curve([[1.0]], 0)


def test_a_callback_ends_the_curve() -> None:
    rows = np.random.default_rng(0).random((500, 3))
    curve = energy_curve(rows, 20, callback=lambda step, energy: step > 30)
    assert 1 <= curve.n_max < 20


def test_a_longer_curve_does_not_move_the_elbow() -> None:
    energies = 1000.0 / np.arange(1, 201) ** 1.2
    picks = {EnergyCurve(energies[:n].copy(), (), Scale(1e4, 255.0)).elbow() for n in (32, 64, 200)}
    assert len(picks) == 1


def blocks(sigma: float) -> Bytes:
    """Draw four squares of 24 x 24 pixels with noise."""
    means = np.array([[30, 90], [150, 210]]).repeat(24, axis=0).repeat(24, axis=1)
    noise = sigma * np.random.default_rng(0).standard_normal(means.shape)
    return np.clip(np.rint(means + noise), 0, 255).astype(np.uint8)


def test_edge_weight_finds_the_number_that_noise_hides() -> None:
    noisy = blocks(40)
    assert auto_count(noisy)[0] != 4
    result = segment(noisy, "auto", edge_weight="auto")
    assert result.curve is not None
    assert result.n_segments == result.curve.elbow() == 4


@pytest.mark.parametrize("n_dims", [1, 2, pytest.param(10, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", ["normal", "uniform", "exponential"])
def test_rows_without_clusters_have_no_elbow(kind: str, n_dims: int) -> None:
    rows = getattr(np.random.default_rng(n_dims), kind)(size=(1500, n_dims))
    curve = energy_curve(rows, 32)
    assert (curve.elbow(), curve.is_clear, curve.verdict) == (1, False, "no elbow: one cluster or a continuum")
    assert auto_count(rows)[0] == 1


@pytest.mark.parametrize("k", [2, 5, 12])
@pytest.mark.parametrize("n_dims", [1, 3, 20])
def test_separated_clusters_have_a_clear_elbow(k: int, n_dims: int) -> None:
    rng = np.random.default_rng(k)
    centers = 14 * np.arange(k)[:, None] * np.eye(1, n_dims) + rng.normal(size=(k, n_dims))
    curve = energy_curve(centers[np.arange(1200) % k] + rng.normal(size=(1200, n_dims)), 32)
    assert (curve.elbow(), curve.is_clear, curve.verdict) == (k, True, f"elbow at k={k}")


def test_overlapping_clusters_keep_their_number_which_is_not_clear() -> None:
    from sklearn.datasets import load_iris

    curve = energy_curve(load_iris().data, 32)
    assert (curve.elbow(), curve.verdict) == (3, "elbow at k=3, not clear")
