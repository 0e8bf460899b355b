"""Tables larger than memory on a Dask cluster of one or two workers, beside dask-ml, scikit-learn and faiss.

Rows come from zarr arrays in a scratch folder: pixels, three bytes each, of photographs with a little noise, and
vectors of 32 float32 from 400 Gaussians. Shown are seconds on the clock, seconds of all processors, the largest memory
of a worker, and the energy per row, over the tenth of the rows to which the engine in memory is fitted and over all
rows, for every program alike. Rivals that would take hours get fewer rows, as the table says; seconds for all rows are
then in proportion. Each cluster is started anew, with one thread per worker.

    python benchmarks/clusters.py                         # 10^8 pixels, 10^7 vectors
    python benchmarks/clusters.py --pixels 500000000      # 2 GB of disk
    python benchmarks/clusters.py --speed-up              # two workers over one, on the clock: for an idle machine
    python benchmarks/clusters.py --quick
"""

import os
import resource
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import common
import dask
import numpy as np
import zarr
from numpy.typing import NDArray

#: Rows of a chunk on disk; Dask reads some at a time.
CHUNK_BYTES = 1 << 22
#: Settings of workers: as few surprises of memory as there are on a real cluster of one thread per worker.
WORKERS = {"threads_per_worker": 1, "memory_limit": "4GiB", "dashboard_address": ":0"}
ONE_THREAD = dict.fromkeys(("CVTIMG_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


@dataclass(frozen=True, slots=True)
class Row:
    """What one program cost, and how good it was."""

    program: str
    rows: int
    wall: float
    cpu: float
    worker_gib: float
    passes: int
    energy: float
    energy_of_all: float


@dataclass(frozen=True, slots=True)
class Cost:
    """Seconds on the clock and of processors, and GiB of the largest worker."""

    wall: float
    cpu: float
    worker_gib: float


@cache
def photographs() -> NDArray[np.uint8]:
    """Read the pixels of some photographs, one after the other."""
    sets = common.picture_sets(None, 12)
    return np.concatenate([picture.pixels.reshape(-1, 3) for picture in next(iter(sets.values()))])


def photograph_pixels(n_rows: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Draw pixels of photographs, in runs, with a little noise."""
    pixels = photographs()
    starts = rng.integers(0, len(pixels) - 512, -(-n_rows // 512))
    rows = pixels[(starts[:, None] + np.arange(512)).reshape(-1)[:n_rows]]
    return np.clip(rows + rng.integers(-3, 4, rows.shape, np.int8), 0, 255).astype(np.uint8)


def vectors(n_rows: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw vectors from 400 Gaussians of unequal size and width."""
    fixed = np.random.default_rng(4)
    centers = fixed.normal(0, 4, (400, 32)).astype(np.float32)
    widths, shares = fixed.uniform(0.5, 2, 400).astype(np.float32), fixed.exponential(size=400)
    chosen = rng.choice(400, n_rows, p=shares / shares.sum())
    return centers[chosen] + rng.standard_normal((n_rows, 32), np.float32) * widths[chosen, None]


def write_table(path: Path, n_rows: int, draw: Callable[[int, np.random.Generator], NDArray[Any]]) -> None:
    """Write a zarr array chunk by chunk."""
    row = draw(1, np.random.default_rng(0))
    length = CHUNK_BYTES // row.nbytes
    stored = zarr.create_array(str(path), shape=(n_rows, row.shape[1]), chunks=(length, row.shape[1]), dtype=row.dtype)
    for start in range(0, n_rows, length):
        stop = min(start + length, n_rows)
        stored[start:stop] = draw(stop - start, np.random.default_rng([7, start]))
        common.progress(f"writing {path.name}: {stop / n_rows:.0%}")


@contextmanager
def cluster(n_workers: int) -> Iterator[Any]:
    """Start a cluster of processes with one thread each."""
    from distributed import Client, LocalCluster

    settings = {"distributed.nanny.pre-spawn-environ": ONE_THREAD, "distributed.worker.profile.enabled": False}
    with (
        dask.config.set(settings),
        LocalCluster(n_workers=n_workers, processes=True, **WORKERS) as local,
        Client(local) as client,
    ):
        yield client


def used() -> tuple[float, float]:
    """Return the processor seconds of this process, and the GiB that it had at most."""
    return time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 << 20)


def on_cluster(n_workers: int, call: Callable[[], Any]) -> tuple[Any, Cost]:
    """Call a function that uses a cluster; the time to start the cluster does not count."""
    with cluster(n_workers) as client:
        client.wait_for_workers(n_workers)
        before, own = client.run(used), time.process_time()
        result, wall = common.timed(call)
        after = client.run(used)
        cpu = time.process_time() - own + sum(after[name][0] - before[name][0] for name in before)
        return result, Cost(wall, cpu, max(gib for _, gib in after.values()))


def here(call: Callable[[], Any]) -> tuple[Any, Cost]:
    """Call a function in this process."""
    start = time.process_time()
    result, wall = common.timed(call)
    return result, Cost(wall, time.process_time() - start, used()[1])


def mean_energy(rows: Any, centers: NDArray[Any]) -> float:
    """Measure all programs alike: the energy per row, summed in double."""
    from cvtimg import tessellate

    result = tessellate(rows, len(centers), init=centers, callback=lambda step, energy: True)
    return result.energy / len(rows)


class Programs:
    """The programs, each from a table on disk to (K, D) centers."""

    def __init__(self, path: Path, k: int) -> None:
        self.path, self.k = path, k

    def blocks(self, n_rows: int | None = None) -> Any:
        """Open the first rows of the table as Dask array, in the blocks that cvtimg takes."""
        from cvtimg.blocks import open_blocks

        rows = open_blocks(self.path).rows
        return rows if n_rows is None else rows[:n_rows]

    def in_memory(self, n_rows: int) -> NDArray[Any]:
        """Load the first rows of the table."""
        loaded: NDArray[Any] = zarr.open_array(str(self.path), mode="r")[:n_rows]
        return loaded

    def cvtimg_blocks(self, n_rows: int | None = None) -> tuple[NDArray[Any], int]:
        """Tessellate over blocks."""
        from cvtimg import tessellate

        result = tessellate(self.blocks(n_rows), self.k)
        return result.generators, result.n_iter + 2

    def cvtimg_memory(self, n_rows: int) -> tuple[NDArray[Any], int]:
        """Tessellate in memory."""
        from cvtimg import tessellate

        result = tessellate(self.in_memory(n_rows), self.k)
        return result.generators, result.n_iter + 1

    def dask_ml(self, n_rows: int) -> tuple[NDArray[Any], int]:
        """Run dask-ml's KMeans, as its documentation does."""
        from dask_ml.cluster import KMeans

        found = KMeans(self.k, random_state=0).fit(self.blocks(n_rows).astype(np.float32))
        return found.cluster_centers_, int(found.n_iter_)

    def mini_batch(self, n_rows: int) -> tuple[NDArray[Any], int]:
        """Run scikit-learn's MiniBatchKMeans once over all blocks."""
        from sklearn.cluster import MiniBatchKMeans

        found = MiniBatchKMeans(self.k, random_state=0, n_init=3)
        array = zarr.open_array(str(self.path), mode="r")
        for start in range(0, n_rows, 1 << 14):
            found.partial_fit(array[start : min(start + (1 << 14), n_rows)].astype(np.float32))
        return found.cluster_centers_, 1

    def faiss(self, n_rows: int) -> tuple[NDArray[Any], int]:
        """Run faiss on all rows in memory, as many iterations as it makes by default."""
        import faiss

        rows = self.in_memory(n_rows).astype(np.float32)
        found = faiss.Kmeans(rows.shape[1], self.k, seed=1, max_points_per_centroid=n_rows)
        found.train(rows)
        return found.centroids, 25


def compare(title: str, path: Path, k: int, n_rows: int, n_rival: int) -> list[Row]:
    """Run all programs on a table, and print what each cost."""
    programs = Programs(path, k)
    tenth = programs.in_memory(max(n_rows // 10, 1))
    ways: list[tuple[str, int, Callable[[], Any], int]] = [
        ("cvtimg, 2 workers", n_rows, programs.cvtimg_blocks, 2),
        ("cvtimg, 1 worker", n_rows, programs.cvtimg_blocks, 1),
        ("cvtimg, in memory", len(tenth), lambda: programs.cvtimg_memory(len(tenth)), 0),
        (f"cvtimg, 2 workers, {n_rival:.0e} rows", n_rival, lambda: programs.cvtimg_blocks(n_rival), 2),
        (f"{version('dask-ml')} KMeans, 2 workers", n_rival, lambda: programs.dask_ml(n_rival), 2),
        (f"{version('scikit-learn')} MiniBatchKMeans, once", n_rival, lambda: programs.mini_batch(n_rival), 0),
        (f"{version('faiss-cpu')} Kmeans, in memory", n_rival, lambda: programs.faiss(n_rival), 0),
    ]
    rows, seen = [], []
    for name, n_given, way, n_workers in ways:
        common.progress(f"{title}: {name}")
        (centers, passes), cost = on_cluster(n_workers, way) if n_workers else here(way)
        centers = np.asarray(centers, np.float64)
        energies = [mean_energy(given, centers) for given in (tenth, programs.blocks())]
        rows.append(Row(name, n_given, cost.wall, cost.cpu, cost.worker_gib if n_workers else 0.0, passes, *energies))
        print(f"  {asdict(rows[-1])}", flush=True)
        seen.append(centers)
    print(f"\nThe bits of 1 and 2 workers are {'equal' if (seen[0] == seen[1]).all() else 'DIFFERENT'}.")
    table = [
        {
            **asdict(row),
            "cpu of all": row.cpu * n_rows / row.rows,
            "energy": row.energy / rows[2].energy,
            "energy_of_all": row.energy_of_all / rows[2].energy_of_all,
        }
        for row in rows
    ]
    about = "energy of a tenth and of all rows as a ratio to cvtimg in memory, which was fitted to this tenth"
    common.show(f"{title}, k = {k}; {about}", table, digits=5)
    return rows


def speed_up(path: Path, k: int, n_rows: int) -> None:
    """Print how many times faster two workers are than one, on the clock, in passes from the same generators."""
    from cvtimg import tessellate

    programs = Programs(path, k)
    start = programs.cvtimg_memory(min(n_rows, 10**6))[0]

    def seconds_per_pass() -> float:
        ends: list[float] = []

        def stop(step: int, energy: float) -> bool:
            ends.append(time.perf_counter())
            return len(ends) == 6

        tessellate(programs.blocks(n_rows), k, init=start, callback=stop)
        return (ends[-1] - ends[0]) / (len(ends) - 1)

    seconds: dict[int, list[float]] = {1: [], 2: []}
    for n_workers in 3 * (1, 2):
        common.progress(f"{n_workers} workers")
        seconds[n_workers].append(on_cluster(n_workers, seconds_per_pass)[0])
        print(f"  {n_workers} workers: {seconds[n_workers][-1]:.2f} s per pass", flush=True)
    one, two = (statistics.median(seconds[n_workers]) for n_workers in (1, 2))
    print(f"Two workers are {one / two:.2f} times as fast as one (medians); load {os.getloadavg()[0]:.1f}.")


def version(name: str) -> str:
    """Return the name and version of a package."""
    from importlib.metadata import version as installed

    return f"{name} {installed(name)}"


def main() -> None:
    """Print what each program costs."""
    options = common.parser(__doc__)
    options.add_argument("--pixels", type=int, default=10**8, metavar="N")
    options.add_argument("--vectors", type=int, default=10**7, metavar="N")
    options.add_argument("--rival-pixels", type=int, default=2 * 10**6, metavar="N", help="rows that rivals get")
    options.add_argument("--rival-vectors", type=int, default=2 * 10**5, metavar="N")
    options.add_argument("--scratch", type=Path, default=None, metavar="DIR", help="folder for the tables")
    options.add_argument("--speed-up", action="store_true", help="compare two workers with one, and nothing else")
    arguments = options.parse_args()
    common.pin_threads(1)
    if arguments.quick:
        arguments.pixels, arguments.vectors = 10**7, 10**6
        arguments.rival_pixels, arguments.rival_vectors = 10**6, 10**5
    print(f"{common.machine()}, load {os.getloadavg()[0]:.1f}", flush=True)
    folder = Path(tempfile.mkdtemp(dir=arguments.scratch))
    results: list[dict[str, Any]] = []
    try:
        if arguments.speed_up:
            write_table(folder / "pixels.zarr", 10**8, photograph_pixels)
            speed_up(folder / "pixels.zarr", 64, 10**8)
            return
        for title, k, draw, n_rows, n_rival in (
            ("Pixels, 3 bytes", 64, photograph_pixels, arguments.pixels, arguments.rival_pixels),
            ("Vectors, 32 float32", 256, vectors, arguments.vectors, arguments.rival_vectors),
        ):
            if n_rows:
                path = folder / f"{title.split(',')[0].lower()}.zarr"
                write_table(path, n_rows, draw)
                rows = compare(f"{n_rows:.0e} {title}", path, k, n_rows, min(n_rows, n_rival))
                results += [{"table": title, **asdict(row)} for row in rows]
                shutil.rmtree(path)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(f"\nload {os.getloadavg()[0]:.1f}")
    common.write_results("clusters", {"pixels": arguments.pixels, "vectors": arguments.vectors}, results)


if __name__ == "__main__":
    main()
