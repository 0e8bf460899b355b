import os
import subprocess
import sys
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import reference
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from cvtimg import CVT, tessellate
from cvtimg._shared.types import Array, Floats
from cvtimg.colors import color_samples
from cvtimg.engine import EFFORTS, SEEDINGS, search
from cvtimg.engine.methods import Stopping
from cvtimg.engine.samples import line_through
from cvtimg.engine.search import SearchEffort

#: Methods for any dimension that draw nothing; tests/test_methods.py has the others.
DESCENTS = ["lloyd", "transfer"]
ONE_MOVE = SearchEffort(1, (0, 0), Stopping(tolerance=0, max_iterations=1))
TO_THE_END = SearchEffort(2, (1 / 4, 0), Stopping(tolerance=0, max_iterations=1000))


@pytest.fixture
def blobs() -> tuple[Floats, Floats]:
    """Return 300 points of 5 dimensions around 6 centers, and their weights."""
    rng = np.random.default_rng(11)
    rows = rng.normal(size=(300, 5)) + 20 * rng.normal(size=(6, 5))[rng.integers(0, 6, 300)]
    return rows, rng.random(300)


@pytest.mark.parametrize(
    ("n_dims", "dtype"),
    [*((n, np.uint8) for n in (1, 2, 3, 4, 5, 16, 64)), *((3, dtype) for dtype in (np.uint16, np.float32, np.float64))],
)
def test_one_move_agrees_with_the_oracle(n_dims: int, dtype: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(EFFORTS, "fast", ONE_MOVE)
    rng = np.random.default_rng(n_dims)
    rows, density = rng.integers(0, 200, (999, n_dims)).astype(dtype), rng.random(999)
    initial = np.unique(rows, axis=0)[::13][:7].astype(float)
    result = tessellate(rows, 7, density=density, init=initial, effort="fast")
    expected = reference.lloyd_step(rows, density, initial)
    np.testing.assert_allclose(result.generators, expected, rtol=1e-5)
    np.testing.assert_array_equal(result.labels, reference.squared_distances(rows, result.generators).argmin(axis=1))
    np.testing.assert_allclose(result.energy, reference.energy(rows, density, result.generators), rtol=1e-5)


@pytest.mark.parametrize("method", DESCENTS)
def test_the_end_is_a_centroidal_voronoi_tessellation(
    method: str, blobs: tuple[Array, Array], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(EFFORTS, "best", TO_THE_END)
    rows, density = blobs
    result = tessellate(rows, 9, density=density, method=method, effort="best")
    means = reference.lloyd_step(rows, density, result.generators)
    np.testing.assert_allclose(result.generators, means, atol=1e-4)
    np.testing.assert_array_equal(result.labels, reference.squared_distances(rows, result.generators).argmin(axis=1))
    np.testing.assert_allclose(result.masses, np.bincount(result.labels, density))
    np.testing.assert_allclose(result.energy, reference.energy(rows, density, result.generators), rtol=1e-7)


def test_empty_cells_are_refilled_where_the_energy_is_greatest() -> None:
    rows = np.array([[0.0], [1.0], [100.0], [101.0], [200.0], [204.0]])
    result = tessellate(rows, 4, init=[[0.5], [1e4], [100.5], [202]])
    np.testing.assert_allclose(np.sort(result.generators[:, 0]), [0.5, 100.5, 200, 204])


def test_it_stops_when_the_energy_rests_and_says_so(photograph: Array, monkeypatch: pytest.MonkeyPatch) -> None:
    assert Stopping(0.1, 9).converged([2.0, 1.0, 0.95])
    samples = color_samples(photograph)
    initial = samples.colors[::400][:32]
    for effort, tolerance in (("balanced", 1e-4), ("best", 1e-6)):
        result = tessellate(samples, 32, effort=effort, init=initial)
        *_, before, last = result.energies
        assert result.converged
        assert result.n_iter == len(result.energies) - 1 < 1000
        assert before - last <= tolerance * before
    assert 1 <= tessellate(samples, 32, effort="fast", init=initial).n_iter <= 4
    monkeypatch.setitem(EFFORTS, "fast", ONE_MOVE)
    assert not tessellate(samples, 32, effort="fast", init=initial).converged


@pytest.mark.slow
def test_more_effort_finds_less_energy(photograph: Array) -> None:
    samples = color_samples(photograph)
    for n_generators in (8, 32):
        fast, balanced, best = (tessellate(samples, n_generators, effort=effort).energy for effort in EFFORTS)
        assert fast > balanced > best


def test_the_guide_tells_how_much_each_effort_does() -> None:
    guide = " ".join((Path(__file__).parents[2] / "docs/engine.md").read_text(encoding="utf-8").split())
    fast = EFFORTS["fast"].stopping
    assert (
        f"at most {fast.max_iterations} moves, to a tolerance of {fast.tolerance:.0e} |".replace("e-0", "e-") in guide
    )
    for name in ("balanced", "best"):
        of, evolution = EFFORTS[name], EFFORTS[name].evolution
        assert f"to a tolerance of {of.stopping.tolerance:.0e} |".replace("e-0", "e-") in guide
        breaths = ", ".join(f"{share:.2g}" for share in of.breaths)
        numbers = breaths, evolution.n_kept, evolution.n_random, evolution.n_children, evolution.patience
        assert f"| `{name}` | {of.n_starts} | {' | '.join(map(str, numbers))} | {of.stopping.max_iterations} |" in guide
        born = [evolution.most + int((evolution.operations / size) ** evolution.power) for size in (2**22, 2**27)]
        assert (
            f"at least {evolution.most:,} children, {born[0]:,} for" if name == "best" else f"{born[0]} for 2^22"
        ) in guide
        assert name == "best" or f"{('four', 'five', 'six')[born[1] - 4]} for 2^27" in guide
    first = [int(np.log2(EFFORTS[name].evolution.hasty_from)) for name in ("balanced", "best")]
    assert "is at least 2^{}, or 2^{} for `best`".format(*first) in guide
    assert f"({search._STARTS_TIMES_GENERATORS} / K from" in guide
    assert f"end within {search._ABOUT:.2%}".rstrip("%") in guide
    assert f"more than {2 * search._LEAST_ROWS:,} rows, or {2 * search.ROWS_PER_GENERATOR} K if" in guide
    assert f"blocks has {search._FAR_MORE} times as many rows" in guide


def run(code: str, **environment: str) -> str:
    return subprocess.run(
        [sys.executable, "-P", "-c", code], env=os.environ | environment, capture_output=True, text=True, check=True
    ).stdout


@pytest.mark.slow
def test_a_forked_process_has_threads_of_its_own() -> None:
    code = """
import os, numpy as np
from cvtimg import tessellate
rows = np.random.default_rng(0).integers(0, 256, (2_000_000, 3)).astype(np.uint8)
energy = tessellate(rows, 5, effort="fast").energy
child = os.fork()
if child == 0:
    os._exit(0 if tessellate(rows, 5, effort="fast").energy == energy else 1)
print(os.waitpid(child, 0)[1])
"""
    assert run(code, CVTIMG_THREADS="2").strip() == "0"


@pytest.mark.parametrize(
    ("environment", "message"),
    [
        ({"CVTIMG_THREADS": "many"}, "CVTIMG_THREADS='many' must be a whole number >= 1"),
        ({"CVTIMG_SIMD": "mmx"}, "CVTIMG_SIMD='mmx' must be one of baseline, avx2, avx512"),
    ],
)
def test_wrong_values_in_the_environment_are_named(environment: dict[str, str], message: str) -> None:
    with pytest.raises(subprocess.CalledProcessError) as error:
        run("from cvtimg._shared.threads import n_threads; import cvtimg.engine._kernels; n_threads()", **environment)
    assert message in error.value.stderr


def test_inputs_stay_as_they_were(blobs: tuple[Array, Array]) -> None:
    rows, density = blobs
    initial = rows[:4].copy()
    copies = [array.copy() for array in (rows, density, initial)]
    tessellate(rows, 4, density=density, init=initial)
    for array, copy in zip((rows, density, initial), copies, strict=True):
        np.testing.assert_array_equal(array, copy)


COLUMN: dict[str, Any] = {"samples": [[1.0], [1.0], [2.0]], "method": "optimal1d"}
tables = hnp.arrays(np.float64, hnp.array_shapes(min_dims=2, max_dims=2, max_side=80), elements=st.integers(-3, 3))


@settings(max_examples=40)
@given(tables, st.integers(1, 80), st.sampled_from(sorted(SEEDINGS)))
def test_any_table_gives_a_tessellation_or_a_clear_error(rows: Array, n_generators: int, init: str) -> None:
    if n_generators > len(np.unique(rows, axis=0)):
        # Random generators may be equal samples, where no method refuses them.
        too_many = pytest.raises(ValueError, match="n_generators")
        with suppress(ValueError) if init == "random" else too_many:
            tessellate(rows, n_generators, init=init)
        return
    result = tessellate(rows, n_generators, init=init)
    assert result.masses.sum() == len(rows)  # and it proves itself


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"n_generators": 0}, ValueError, r"n_generators=0 must be in 1\.\.5, the number of samples"),
        ({"n_generators": 6}, ValueError, r"n_generators=6 must be in 1\.\.5"),
        ({"n_generators": 2.0}, TypeError, r"n_generators=2\.0 must be an integer"),
        ({"n_generators": True}, TypeError, "n_generators=True must be an integer"),
        ({"samples": np.zeros((5, 0))}, ValueError, r"samples of shape \(5, 0\) must be \(N, D\)"),
        ({"samples": np.zeros(5)}, ValueError, r"samples of shape \(5,\)"),
        ({"samples": [[np.nan, 1], [0, 1]]}, ValueError, "samples must be finite"),
        ({"samples": [["a"]]}, TypeError, "samples of type <U1"),
        ({"density": np.ones(4)}, ValueError, r"density of shape \(4,\) must be \(5,\)"),
        ({"density": [1, 1, 1, 1, -1]}, ValueError, "density must be finite and >= 0"),
        ({"density": [1, 1, 1, 1, np.inf]}, ValueError, "density must be finite and >= 0"),
        ({"density": np.zeros(5)}, ValueError, "not all 0"),
        ({"method": "magic"}, ValueError, "method='magic' must be one of lloyd, transfer"),
        ({"init": "magic"}, ValueError, "init='magic' must be one of split, k-means"),
        ({"init": len}, ValueError, r"init must be one of split, k-means\+\+, random or \(K, D\) generators"),
        ({"init": [[0, 0]]}, ValueError, r"init of shape \(1, 2\) must be \(2, 2\)"),
        ({"init": [[0, 0], [np.nan, 0]]}, ValueError, "init must be finite"),
        ({"effort": "heroic"}, ValueError, "effort='heroic' must be one of fast, balanced, best"),
        ({"samples": [[0, 1], [1e300, 2]]}, ValueError, r"values up to .*e\+\d+ from their mean must be within 1e"),
        ({"locked": [[1, 2], [4, 5]]}, ValueError, "locked must have fewer than n_generators=2, not 2"),
        ({"locked": [[1, 2, 3]]}, ValueError, r"locked of shape \(1, 3\) must be \(1, 2\)"),
        ({"locked": [[1, np.inf]]}, ValueError, "locked must be finite"),
        ({"volume_power": -1}, ValueError, "volume_power=-1 must be a finite number >= 0"),
        ({"volume_power": np.nan}, ValueError, "volume_power=nan must be"),
        ({"volume_power": 1, "method": "lloyd"}, ValueError, "'lloyd' does not support volume_power=1; transfer does"),
        ({"method": "optimal1d"}, ValueError, "method='optimal1d' needs samples of one dimension, not D=2"),
        (COLUMN | {"locked": [[1]]}, ValueError, "'optimal1d' does not support locked generators; lloyd or transfer"),
        (COLUMN | {"n_generators": 3}, ValueError, r"n_generators=3 must be in 1\.\.2, the number of distinct samples"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    defaults: dict[str, Any] = {"samples": np.arange(10.0).reshape(5, 2), "n_generators": 2}
    with pytest.raises(error, match=message):
        tessellate(**(defaults | arguments))


def test_color_samples_bring_their_own_density_and_bound() -> None:
    samples = color_samples(np.array([[1, 2, 2]], np.uint8))
    with pytest.raises(ValueError, match="density must not be given"):
        tessellate(samples, 1, density=[1, 1])
    with pytest.raises(ValueError, match=r"n_generators=3 must be in 1\.\.2, the number of distinct samples"):
        tessellate(samples, 3)


@pytest.mark.parametrize("init", ["split", "k-means++", "given"])
@pytest.mark.parametrize("effort", EFFORTS)
def test_locked_generators_stay_in_place_and_others_move(init: str, effort: str, photograph: Array) -> None:
    locked = np.array([[0, 255, 0], [120.5, 100, 100]])
    samples = color_samples(photograph)
    start: Any = samples.colors[::4000][:8] if init == "given" else init
    result = tessellate(samples, 10, init=start, effort=effort, locked=locked)
    np.testing.assert_allclose(result.generators[:2], locked)
    assert len(result.generators) == 10
    assert result.energy < 1.5 * tessellate(samples, 8, effort="fast").energy
    assert (result.masses[2:] > 0).all()


@pytest.mark.parametrize("effort", ["fast", "balanced"])
def test_a_callback_sees_every_step_and_can_stop(effort: str, photograph: Array) -> None:
    samples = color_samples(photograph)
    steps: list[tuple[int, float]] = []
    tessellate(samples, 20, effort=effort, callback=lambda *step: steps.append(step))
    assert [number for number, _ in steps] == list(range(len(steps)))
    assert all(energy >= 0 for _, energy in steps)

    seen = []

    def stop_at_once(number: int, energy: float) -> bool:
        seen.append(number)
        return True

    result = tessellate(samples, 20, effort=effort, callback=stop_at_once)
    assert seen == [0]
    assert not result.converged
    assert len(result.generators) == 20


def test_an_interrupt_ends_at_once_and_leaves_no_thread_working() -> None:
    code = """
import os, signal, threading, numpy as np
from cvtimg import tessellate
from cvtimg._shared.threads import _pool
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
rows = np.random.default_rng(0).random((400_000, 3))
try:
    while True:
        tessellate(rows, 200, effort="best")
except KeyboardInterrupt:
    # Both threads of the pool are free for tasks that wait for each other.
    meeting = threading.Barrier(3)
    for _ in range(2):
        _pool().submit(meeting.wait)
    meeting.wait(60)
    print("idle")
"""
    assert run(code, CVTIMG_THREADS="3").strip() == "idle"


def test_rare_samples_among_many_equal_ones_are_found() -> None:
    rows = np.concatenate([np.zeros((300_000, 3)), np.eye(3), 5 * np.eye(3)])
    result = tessellate(rows, 7)
    assert result.energy == pytest.approx(0, abs=1e-9)
    assert sorted(result.masses.tolist()) == [1, 1, 1, 1, 1, 1, 300_000]


@pytest.mark.parametrize("size", [1e-300, 1e-170, 1e-20, 1e20, 1e130])
def test_any_range_of_values_is_tessellated(size: float) -> None:
    rows = size * np.array([[0.0], [0.1], [1.0], [1.1]])
    result = tessellate(rows, 2)
    assert result.labels.tolist() == [0, 0, 1, 1]
    np.testing.assert_allclose(result.energy, 0.01 * size**2, rtol=1e-6)


@pytest.mark.parametrize("direction", [[1.0, 1.0, 1.0], [1.0, 2.0, -3.0], [0.0, 4.0, 0.0]])
def test_rows_on_a_line_have_the_optimum_of_one_column(direction: list[float]) -> None:
    places = np.random.default_rng(3).normal(size=(300, 1))
    rows = places * direction + [5, 6, 7]
    found, best = tessellate(rows, 5), tessellate(places, 5)
    assert found.energy == pytest.approx(best.energy * np.square(direction).sum())
    assert found.energy == pytest.approx(reference.energy(rows, np.ones(300), found.generators))
    np.testing.assert_array_equal(found.labels, reference.squared_distances(rows, found.generators).argmin(axis=1))


def test_rows_of_which_one_is_beside_the_line_are_on_none() -> None:
    rows = np.repeat(np.arange(200.0)[:, None], 2, axis=1)
    assert line_through(rows) is not None
    rows[77, 1] += 1e-6
    assert line_through(rows) is None
    assert line_through(np.ones((5, 2))) is None


@pytest.mark.parametrize("cluster", [lambda rows: tessellate(rows, 1), lambda rows: CVT(1).fit(rows)])
def test_integers_that_float64_does_not_hold_are_told(cluster: Any) -> None:
    rows = np.arange(50, dtype=np.uint64)[:, None] + np.uint64(2**63)
    with pytest.warns(UserWarning, match=r"integers up to \d+, which are rounded beyond 2\*\*53"):
        cluster(rows)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cluster(rows - rows.min())
