"""Reduced bases: errors on test snapshots of Burgers flows beside scikit-learn and pyMOR, and 737 MB on disk.

Every fourth of 600 snapshots of five flows is for tests. The relative error is the squared distance of these to the
basis over that to the mean of the others. The file has 10,000 snapshots of 18,432 values around 12 states.

    python benchmarks/bases.py [--quick] [--parts flows large]
"""

import argparse
import resource
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from common import Rows, parser, run, timed
from numpy.typing import NDArray

Row = dict[str, Any]
ONLINE, RANKS = (2, 4, 8), (16, 32)
N_CELLS = 8
LARGE, LARGE_RANK, RANK = (10_000, 96 * 96 * 2), 60, 56


def burgers(side: int = 96, n_runs: int = 5, n_each: int = 120) -> NDArray[np.float32]:
    """Solve the Burgers equation on the torus from a few vortices, by upwind steps; the first half of a flow is u."""
    rng = np.random.default_rng(0)
    axis = (np.arange(side) + 0.5) / side
    x, y = np.meshgrid(axis, axis, indexing="ij")
    step, viscosity, end = 1 / side, 2e-3, 1.6
    found = []
    for _ in range(n_runs):
        flow = np.zeros((2, side, side))
        for _ in range(3):
            speed, (at_x, at_y), width = rng.normal(size=2), rng.random(2), 0.08 + 0.1 * rng.random()
            apart = ((x - at_x + 0.5) % 1 - 0.5) ** 2 + ((y - at_y + 0.5) % 1 - 0.5) ** 2
            flow += speed[:, None, None] * np.exp(-apart / width**2)
        fastest = np.abs(flow).max(axis=(1, 2)).sum()
        time_step = min(0.25 * step / fastest, 0.2 * step**2 / viscosity)
        every = max(1, int(end / time_step) // n_each)
        for number in range(every * n_each):
            if number % every == 0:
                found.append(flow.astype(np.float32).reshape(-1))
            slopes = np.zeros_like(flow)
            for speed, axis_of in zip(flow, (1, 2), strict=True):
                back, ahead = flow - np.roll(flow, 1, axis_of), np.roll(flow, -1, axis_of) - flow
                slopes -= (np.maximum(speed, 0) * back + np.minimum(speed, 0) * ahead) / step
                slopes += viscosity * (ahead - back) / step**2
            flow = flow + time_step * slopes
    return np.array(found)


def rivals(train: NDArray[np.float32], n: int) -> dict[str, Any]:
    """Return calls that give n modes as rows; those of packages that are missing are left out."""
    from sklearn.decomposition import PCA, IncrementalPCA

    calls: dict[str, Any] = {
        "scikit-learn PCA": lambda: PCA(n, svd_solver="randomized", random_state=0).fit(train).components_,
        "scikit-learn IncrementalPCA": lambda: IncrementalPCA(n, batch_size=150).fit(train).components_,
    }
    try:
        from pymor.algorithms.pod import pod
        from pymor.core.logger import set_log_levels
        from pymor.vectorarrays.numpy import NumpyVectorSpace
    except ImportError:
        print("pyMOR is not installed")
        return calls

    def by_pymor() -> NDArray[np.float64]:
        set_log_levels({"pymor": "ERROR"})
        apart = (train - train.mean(axis=0)).astype(np.float64)
        vectors = NumpyVectorSpace.from_numpy(apart.T if _columns() else apart)
        modes = pod(vectors, modes=n)[0].to_numpy()
        return np.asarray(modes.T if modes.shape[0] != n else modes)

    def _columns() -> bool:
        return NumpyVectorSpace.from_numpy(np.zeros((3, 2))).dim == 3

    calls["pyMOR pod"] = by_pymor
    return calls


def flows(given: argparse.Namespace) -> Rows:
    """Burgers flows: relative errors on test snapshots, and processor seconds."""
    from cvtimg import reduced_basis

    snapshots = burgers(n_each=40 if given.quick else 120)
    held = np.arange(len(snapshots)) % 4 == 2
    train, test = snapshots[~held], snapshots[held].astype(np.float64)
    total = float(((test - train.mean(axis=0)) ** 2).sum())
    rows: list[Row] = []

    def add(name: str, n: int, kind: str) -> None:
        basis, seconds = timed(lambda: reduced_basis(train, n, kind=kind, n_cells=N_CELLS), time.process_time)
        rest = test - basis.reconstruct(basis.project(test))
        rows.append({"basis": name, "n": n, "error": float((rest**2).sum()) / total, "seconds": seconds})

    for n in ONLINE:
        add("POD", n, "pod")
        add(f"CVOD, {N_CELLS} cells", n, "cvod")
    add("POD, as much storage", N_CELLS * (4 + 1), "pod")
    for n in RANKS:
        add("POD", n, "pod")
        add("CVT", n, "cvt")
        for name, call in rivals(train, n).items():
            modes, seconds = timed(call, time.process_time)
            apart = test - train.mean(axis=0)
            rest = apart - (apart @ modes.T) @ modes
            rows.append({"basis": name, "n": n, "error": float((rest**2).sum()) / total, "seconds": seconds})
    return rows


def large(given: argparse.Namespace) -> Rows:
    """Reduce a file of 737 MB."""
    from cvtimg import reduced_basis

    if given.quick:
        return []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "snapshots.npy"
        _write(path)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        # 16 modes need 56 coordinates: 24 beyond twice as many.
        basis, seconds = timed(lambda: reduced_basis(str(path), (RANK - 24) // 2), time.process_time)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        size = path.stat().st_size
    row = {
        "megabytes": size / 1e6,
        "rank": RANK,
        "seconds": seconds,
        "peak_mib": peak / 1024,
        "before_mib": before / 1024,
    }
    row["explained"] = basis.explained
    return [row]


def _write(path: Path) -> None:
    """Write snapshots around 12 states, in blocks."""
    n, n_dims = LARGE
    rng = np.random.default_rng(2)
    directions = np.linalg.qr(rng.standard_normal((n_dims, LARGE_RANK)))[0].T.astype(np.float32)
    states, scales = rng.standard_normal((12, LARGE_RANK)), 0.85 ** np.arange(LARGE_RANK)
    header = {"descr": "<f4", "fortran_order": False, "shape": LARGE}
    with path.open("wb") as file:
        np.lib.format.write_array_header_1_0(file, header)
        for _ in range(0, n, 500):
            near = states[rng.integers(0, 12, 500)] + 0.3 * rng.standard_normal((500, LARGE_RANK))
            block = (near * scales).astype(np.float32) @ directions
            block += np.float32(0.001) * rng.standard_normal(block.shape, np.float32)
            file.write(block.tobytes())


if __name__ == "__main__":
    run(parser(__doc__), flows, large)
