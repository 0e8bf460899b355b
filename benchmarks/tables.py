"""Tables of few rows: energy over that of scikit-learn's KMeans(n_init=10), and processor seconds.

Tables are of scikit-learn, standardized, or made. Energies are computed from labels, for every rival alike. `optima`
counts the proven least energies of the iris table that are found, for 2 to 10 generators; `seeds` compares ten seeds on
tables on which no setting was chosen; `grid` has 60 tables of 30 to 300,000 rows and 1 to 1,000 columns; `many` has
more generators.

    python benchmarks/tables.py [--quick] [--docs] [--parts energies optima seeds grid many]

Rivals that cannot be imported are left out; `hgmeans`, which is HG-means, is built from its source.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
from common import OUT, ROOT, Rows, parser, run, timed
from numpy.typing import NDArray
from PIL import Image

import cvtimg

Table = NDArray[np.float64]
Find = Callable[[Table, int], Any]
#: Least energies of the iris table for 2, 3, ... generators: SIAM J. Scientific Computing 21 (2000), 1485-1505.
IRIS = (152.347951760, 78.851441426, 57.228473214, 46.446182051, 39.039987246, 34.298229665, 29.988943950,
        27.786092417, 25.834054819)  # fmt: skip


#: Rows, columns and generators of the grid.
GRID = (
    (30, 1, 2), (30, 5, 10), (100, 2, 5), (100, 20, 20), (300, 2, 30), (300, 50, 5), (300, 1000, 10), (1000, 3, 100),
    (1000, 10, 10), (1000, 300, 30), (3000, 3, 10), (3000, 20, 1000), (3000, 50, 30), (10000, 2, 50), (10000, 10, 20),
    (10000, 100, 50), (30000, 5, 100), (30000, 30, 10), (100000, 3, 20), (300000, 4, 8),
)  # fmt: skip
KINDS: dict[str, Callable[[np.random.Generator, int, int], Table]] = {
    "normal": lambda rng, n, d: rng.normal(size=(n, d)),
    "clusters": lambda rng, n, d: rng.normal(0, 3, (20, d))[rng.integers(0, 20, n)] + rng.normal(size=(n, d)),
    "log-normal": lambda rng, n, d: np.exp(rng.normal(size=(n, d))),
}


def tables() -> dict[str, Table]:
    """Make all tables; columns of real ones with mean 0 and deviation 1, without constant ones."""
    from sklearn import datasets

    found = {}
    for name in ("iris", "wine", "breast_cancer", "diabetes", "digits"):
        rows = getattr(datasets, f"load_{name}")().data
        varied = rows[:, rows.std(axis=0) > 0]
        found[name] = (varied - varied.mean(axis=0)) / varied.std(axis=0)
    rng = np.random.default_rng(5)
    centers = rng.normal(0, 3, (60, 8))
    found["uniform"] = rng.random((2000, 3))
    found["normal"] = rng.standard_normal((1000, 100))
    found["blobs"] = centers[rng.integers(0, 60, 5000)] + rng.standard_normal((5000, 8))
    return found


def others() -> dict[str, Table]:
    """Make tables on which no setting of cvtimg was chosen, standardized."""
    from sklearn import datasets

    rng = np.random.default_rng(2026)
    centers = rng.normal(0, 2, (25, 12))
    found = {
        "linnerud": np.hstack(datasets.load_linnerud(return_X_y=True)),
        "circles": datasets.make_circles(1200, noise=0.05, random_state=13)[0],
        "swiss roll": datasets.make_swiss_roll(3000, random_state=14)[0],
        "low rank": datasets.make_low_rank_matrix(800, 40, effective_rank=6, random_state=15),
        "25 blobs": centers[np.sqrt(rng.integers(0, 625, 3000)).astype(int)] + rng.standard_normal((3000, 12)),
        "log-normal": np.exp(rng.standard_normal((1500, 8))),
    }
    return {name: (rows - rows.mean(axis=0)) / rows.std(axis=0) for name, rows in found.items()}


def rivals() -> dict[str, Find]:
    """Name what is installed, each from rows and K to labels."""
    from sklearn.cluster import KMeans, MiniBatchKMeans

    def by_faiss(rows: Table, k: int) -> Any:
        model = import_module("faiss").Kmeans(rows.shape[1], k, nredo=10, seed=1, min_points_per_centroid=1)
        model.train(rows.astype(np.float32))
        return model.index.search(rows.astype(np.float32), 1)[1][:, 0]

    def by_hgmeans(rows: Table, k: int) -> Any:
        return import_module("hgmeans").PyHGMeans().run(rows.tolist(), [0] * len(rows), 10, 1000, 1, [k])[0]

    known: dict[str, tuple[str, Find]] = {
        "KMeans(n_init=1)": ("sklearn", lambda rows, k: KMeans(k, n_init=1, random_state=0).fit(rows).labels_),
        "KMeans(n_init=10)": ("sklearn", lambda rows, k: KMeans(k, n_init=10, random_state=0).fit(rows).labels_),
        "MiniBatchKMeans": ("sklearn", lambda rows, k: MiniBatchKMeans(k, n_init=10, random_state=0).fit(rows).labels_),
        "cvtimg fast": ("cvtimg", _fast),
        "cvtimg balanced": ("cvtimg", lambda rows, k: cvtimg.tessellate(rows, k, rng=0).labels),
        "cvtimg best": ("cvtimg", lambda rows, k: cvtimg.tessellate(rows, k, effort="best", rng=0).labels),
        "bkmeans": (
            "bkmeans",
            lambda rows, k: import_module("bkmeans").BKMeans(n_clusters=k, random_state=0).fit(rows).labels_,
        ),
        "faiss, 10 starts": ("faiss", by_faiss),
        "HG-means": ("hgmeans", by_hgmeans),
    }
    return {name: find for name, (module, find) in known.items() if find_spec(module)}


def energy(rows: Table, labels: Any) -> float:
    """Sum the squared distances of rows to the means of their clusters."""
    cells = np.unique(labels, return_inverse=True)[1]
    sums = np.stack([np.bincount(cells, column) for column in rows.T], axis=1)
    return float(np.square(rows - (sums / np.bincount(cells)[:, None])[cells]).sum())


def energies(given: argparse.Namespace) -> tuple[Rows, Rows]:
    """Energy in percent over that of KMeans(n_init=10), and processor seconds."""
    found, shown = [], []
    for name, rows in list(tables().items())[: 2 if given.quick else None]:
        for k in (10, 30):
            shown.append({"table": f"{name}, {rows.shape[0]} x {rows.shape[1]}", "k": k})
            for rival, find in list(rivals().items())[1:]:  # ten starts of scikit-learn are the first
                find(rows[:100], 3)  # imports are not timed
                labels, seconds = timed(lambda f=find, x=rows, k=k: f(x, k), time.process_time)
                case = {"table": name, "k": k, "rival": rival}
                found.append({**case, "energy": energy(rows, labels), "seconds": seconds})
                base = found[-len(shown[-1]) + 1]["energy"]  # of the first rival
                shown[-1][rival] = f"{found[-1]['energy'] / base - 1:+.2%}, {seconds:.2g} s"
    if given.docs:
        draw(found)
    return found, shown


def grid(given: argparse.Namespace) -> tuple[Rows, Rows]:
    """Energy over that of KMeans from one start and from ten, and time by theirs, over the grid."""
    names = ("KMeans(n_init=1)", "KMeans(n_init=10)", "cvtimg fast", "cvtimg balanced", "faiss, 10 starts")
    chosen = {name: find for name, find in rivals().items() if name in names}
    found, shown = [], []
    for n, n_dims, k in GRID[: 4 if given.quick else None]:
        for kind, make in KINDS.items():
            rows = make(np.random.default_rng(n + n_dims + k), n, n_dims)
            for name, find in chosen.items():
                find(rows[:100], 2)
                labels, seconds = timed(lambda f=find, x=rows, k=k: f(x, k), time.process_time)
                case = {"table": f"{kind} {n} x {n_dims}", "k": k, "rival": name}
                found.append({**case, "energy": energy(rows, labels), "seconds": seconds})
    figures = np.array([(row["energy"], row["seconds"]) for row in found]).reshape(-1, len(chosen), 2)
    for at, name in enumerate(chosen):
        row: dict[str, Any] = {"rival": name}
        for base, starts in enumerate(("one start", "ten starts")):
            energies, times = (figures[:, at] / figures[:, base]).T
            worst = found[int(energies.argmax()) * len(chosen)]
            row[f"energy, {starts}"] = f"{energies.mean() - 1:+.2%}, worst {energies.max() - 1:+.2%}"
            row[f"worst, {starts}"] = f"{worst['table']}, k = {worst['k']}"
            row[f"time, {starts}"] = f"{np.median(times):.2g}, most {times.max():.2g}"
        shown.append(row)
    if given.docs:
        draw([row for row in found if row["rival"] != names[0]], "grid")
    return found, shown


def seeds(given: argparse.Namespace) -> Rows:
    """Compare ten seeds with as many of KMeans(n_init=10): energies and processor time, on other tables."""
    from sklearn.cluster import KMeans

    found: Rows = []
    for name, rows in others().items():
        for k in (5, 10, 30) if len(rows) > 30 else (3, 5, 10):
            ten = [timed(partial(KMeans(k, n_init=10, random_state=n).fit, rows), time.process_time) for n in range(10)]
            base, seconds = np.array([(model.inertia_, seconds) for model, seconds in ten]).T
            found.append({"table": f"{name}, {rows.shape[0]} x {rows.shape[1]}", "k": k})
            found[-1]["KMeans"] = f"{base.min() / base.mean() - 1:+.2%} to {base.max() / base.mean() - 1:+.2%}"
            for effort in ("balanced", "best")[: 1 if given.quick else 2]:
                search = partial(cvtimg.tessellate, rows, k, effort=effort)
                runs = [timed(partial(search, rng=n), time.process_time) for n in range(10)]
                energies = np.array([run.energy for run, _ in runs]) / base.mean() - 1
                times = np.mean([second for _, second in runs]) / seconds.mean()
                found[-1][effort] = f"{energies.mean():+.2%}, worst {energies.max():+.2%}, {times:.1f} x"
    return found


def many(given: argparse.Namespace) -> Rows:
    """Energy and processor seconds of many generators on a million rows of 200 Gaussians, by MiniBatchKMeans."""
    from sklearn.cluster import MiniBatchKMeans

    rng = np.random.default_rng(0)
    rows = rng.normal(0, 3, (200, 8))[rng.integers(0, 200, 1_000_000)] + rng.normal(size=(1_000_000, 8))
    rows, shown = rows.astype(np.float32), []
    for k in (1000, 5000, 10_000)[: 1 if given.quick else None]:
        passes = 100 if k == 1000 else 1  # at most; a pass already takes long
        rival = MiniBatchKMeans(k, n_init=1, max_iter=passes, random_state=0)
        base, seconds = timed(lambda f=rival: f.fit(rows).labels_, time.process_time)
        labels, own = timed(partial(_fast, rows, k), time.process_time)
        ratio = energy(rows, labels) / energy(rows, base) - 1
        shown.append({"k": k, "MiniBatchKMeans": f"{seconds:.2g} s, {rival.n_steps_} steps"})
        shown[-1]["cvtimg fast"] = f"{ratio:+.1%}, {own:.2g} s"
        print(shown[-1], flush=True)
    return shown


def _fast(rows: Table, k: int) -> Any:
    return cvtimg.tessellate(rows, k, effort="fast", rng=0).labels


def draw(found: Rows, file: str = "tables") -> None:
    """Write docs/FILE.webp: each rival's time and energy by those of the first, a dot for each table and K."""
    pyplot = import_module("matplotlib.pyplot")
    figure, axis = pyplot.subplots(figsize=(8, 4.6))
    names = list(dict.fromkeys(row["rival"] for row in found))
    base = {(row["table"], row["k"]): row for row in found if row["rival"] == names[0]}
    for number, name in enumerate(names[1:]):
        pairs = [(row, base[row["table"], row["k"]]) for row in found if row["rival"] == name]
        times = [row["seconds"] / first["seconds"] for row, first in pairs]
        excess = [100 * (row["energy"] / first["energy"] - 1) for row, first in pairs]
        axis.scatter(times, excess, s=9, color=f"C{number}", alpha=0.5)
        axis.scatter(np.median(times), np.median(excess), s=90, color=f"C{number}", marker="D", label=name)
    axis.axhline(0, color="0.6", linewidth=0.8)
    axis.axvline(1, color="0.6", linewidth=0.8)
    axis.set(
        xscale="log", ylim=(-10, 13), xlabel=f"time / that of {names[0]}", ylabel=f"energy over that of {names[0]}, %"
    )
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(frameon=False, fontsize=9)
    figure.tight_layout()
    OUT.mkdir(parents=True, exist_ok=True)
    figure.savefig(OUT / f"{file}.png", dpi=110)
    Image.open(OUT / f"{file}.png").convert("RGB").save(ROOT / "docs" / f"{file}.webp", lossless=True)


def optima(given: argparse.Namespace) -> Rows:
    """Proven optima of iris that were found, of nine."""
    from sklearn.datasets import load_iris

    rows, bounds = load_iris().data, 1.000001 * np.array(IRIS)
    return [
        {"rival": name, "found": sum(energy(rows, find(rows, 2 + n)) < bound for n, bound in enumerate(bounds))}
        for name, find in rivals().items()
    ]


if __name__ == "__main__":
    read = parser(__doc__)
    read.add_argument("--docs", action="store_true", help="write plots to docs/tables.webp and docs/grid.webp")
    run(read, energies, optima, seeds, grid, many)
