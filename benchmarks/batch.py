"""A folder of photographs of 768 x 512 to 64 colors each: pictures a second, beside other programs, in one run.

cvtimg works with one process, with two, and on a local Dask cluster of two workers; pngquant is started for each
picture, two at a time, and so is a script with scikit-learn's KMeans, on few pictures, once its imports are done. All
read PNG and write PNG. Rounds take turns; medians are shown. Energies are those of the written files.

    python benchmarks/batch.py
    python benchmarks/batch.py --pictures 24 --rounds 1 --jobs 8  # processor seconds of many jobs, beside those of one
"""

import ctypes
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import common
import numpy as np
from PIL import Image, ImageOps

SIZE = (768, 512)
#: From a folder of PNG to another with scikit-learn, as one would write it: a process that takes part P of N.
LOOP = """
import sys, time
from pathlib import Path
import numpy as np
from PIL import Image
from sklearn.cluster import KMeans
source, target, part, n_parts, k = Path(sys.argv[1]), Path(sys.argv[2]), *map(int, sys.argv[3:])
for path in sorted(source.iterdir())[part::n_parts]:
    pixels = np.asarray(Image.open(path).convert("RGB"))
    means = KMeans(k, n_init=1, random_state=0).fit(pixels.reshape(-1, 3).astype(np.float32))
    picture = Image.fromarray(means.labels_.reshape(pixels.shape[:2]).astype(np.uint8))
    picture.putpalette(np.rint(means.cluster_centers_).astype(np.uint8).tobytes())
    picture.save(target / path.name)
"""


@dataclass(frozen=True, slots=True)
class Way:
    """One way to do the whole folder."""

    name: str
    run: Callable[[Path, Path], None]
    #: Pictures that it is given, all by default: slow ones get a few.
    n_pictures: int | None = None


def make_pictures(folder: Path, n_pictures: int) -> None:
    """Write photographs, turned and mirrored where there are fewer than asked for."""
    sets = common.picture_sets(None, None)
    photographs = sets.get("kodak") or next(iter(sets.values()))
    for number in range(n_pictures):
        pixels = Image.fromarray(photographs[number % len(photographs)].pixels)
        turn = number // len(photographs)
        image = ImageOps.fit(pixels if pixels.width >= pixels.height else pixels.rotate(90, expand=True), SIZE)
        image = ImageOps.mirror(image) if turn & 1 else image
        image = ImageOps.flip(image) if turn & 2 else image
        # Another light for each further turn: no two pictures are the same.
        image = Image.eval(image, lambda value, turn=turn: value * (40 - turn // 4) // 40)
        image.save(folder / f"{number:04}.png", compress_level=1)


def run(*command: str | Path, threads: int = 1) -> None:
    """Run a program to its end."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    environment = {**os.environ, **dict.fromkeys(names, str(threads))}
    subprocess.run(list(map(str, command)), check=True, env=environment, stdout=subprocess.DEVNULL)


def cvtimg(k: int, *options: str) -> Callable[[Path, Path], None]:
    """Make a way of cvtimg's command line."""
    command = [sys.executable, "-m", "cvtimg", "quantize"]

    def quantize(source: Path, target: Path) -> None:
        run(*command, source, "-k", str(k), "--out-dir", target, "--quiet", *options)

    return quantize


def pngquant(k: int, jobs: int) -> Callable[[Path, Path], None]:
    """Make a way that starts pngquant for each picture, some at a time."""

    def quantize(source: Path, target: Path) -> None:
        one = f"pngquant --nofs {k} --output {target}/$(basename $0) $0"
        names = "\0".join(map(str, sorted(source.iterdir()))).encode()
        subprocess.run(["xargs", "-0", "-n1", f"-P{jobs}", "sh", "-c", one], input=names, check=True)

    return quantize


def scikit_learn(k: int, jobs: int) -> Callable[[Path, Path], None]:
    """Make a way that runs a loop with scikit-learn in some processes."""

    def quantize(source: Path, target: Path) -> None:
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        parts = [
            subprocess.Popen(
                [sys.executable, "-c", LOOP, source, target, str(part), str(jobs), str(k)], env=environment
            )
            for part in range(jobs)
        ]
        if sum(part.wait() != 0 for part in parts):  # waits for all of them
            raise RuntimeError("scikit-learn failed")

    return quantize


def ways(k: int, jobs: int) -> list[Way]:
    """List the ways that are there."""
    found = [
        Way("cvtimg, 1 process", cvtimg(k, "--jobs", "1")),
        Way(f"cvtimg, {jobs} processes", cvtimg(k, "--jobs", str(jobs))),
        Way(f"cvtimg fast, {jobs} processes", cvtimg(k, "--jobs", str(jobs), "--effort", "fast")),
        Way(f"cvtimg, Dask, {jobs} workers", cvtimg(k, "--jobs", str(jobs), "--dask", "local")),
    ]
    if shutil.which("pngquant"):
        found.append(Way(f"pngquant, {jobs} at a time", pngquant(k, jobs)))
    try:
        import sklearn
    except ImportError:
        return found
    return [*found, Way(f"scikit-learn {sklearn.__version__}, {jobs} processes", scikit_learn(k, jobs), 2 * jobs)]


def take_turn(way: Way, source: Path, few: Path) -> tuple[float, float, float]:
    """Return the pictures a second of a way, its processor seconds a picture, and the error a pixel of its files."""
    folder, before = few if way.n_pictures else source, sum(os.times()[2:4])
    with tempfile.TemporaryDirectory() as target:
        start = time.perf_counter()
        way.run(folder, Path(target))
        seconds = time.perf_counter() - start
        with suppress(ChildProcessError):  # what it has left to itself, such as a server of workers
            while os.wait():
                pass
        paths = sorted(folder.iterdir())
        written = [Path(target, path.name) for path in paths[:8]]
        errors = [
            common.squared_error(common.read_rgb(a), common.read_rgb(b)) for a, b in zip(paths, written, strict=False)
        ]
    return len(paths) / seconds, (sum(os.times()[2:4]) - before) / len(paths), float(np.mean(errors))


def main() -> None:
    """Print pictures a second."""
    options = common.parser(__doc__)
    options.add_argument("--pictures", type=int, default=200, metavar="N")
    options.add_argument("--rounds", type=int, default=3, metavar="N")
    options.add_argument("--jobs", type=int, default=2, metavar="N")
    options.add_argument("-k", type=int, default=64, metavar="N")
    arguments = options.parse_args()
    n_pictures, rounds = (24, 1) if arguments.quick else (arguments.pictures, arguments.rounds)
    found = ways(arguments.k, arguments.jobs)
    rates: dict[str, list[float]] = {way.name: [] for way in found}
    work: dict[str, float] = {}
    errors: dict[str, float] = {}
    ctypes.CDLL(None).prctl(36, 1)  # PR_SET_CHILD_SUBREAPER: processes whose parent has ended are counted, too
    with tempfile.TemporaryDirectory() as folder:
        source, few = Path(folder, "all"), Path(folder, "few")
        for path, n in ((source, n_pictures), (few, 2 * arguments.jobs)):
            path.mkdir()
            make_pictures(path, n)
        for turn in range(rounds):
            for way in found if turn % 2 == 0 else reversed(found):
                common.progress(f"round {turn + 1}: {way.name}")
                rate, work[way.name], errors[way.name] = take_turn(way, source, few)
                rates[way.name].append(rate)
    print(f"\n{common.machine()}\n{n_pictures} photographs of {SIZE[0]} x {SIZE[1]} to {arguments.k} colors")
    medians = {name: statistics.median(some) for name, some in rates.items()}
    own = medians[f"cvtimg, {arguments.jobs} processes"]
    shown = [
        {"": name, "pictures/s": rate, "of cvtimg": rate / own, "cpu s": work[name], "error of 8": errors[name]}
        for name, rate in medians.items()
    ]
    common.show("Pictures a second", shown)
    rows = [{"way": name, "pictures_per_second": rate, "error": errors[name]} for name in rates for rate in rates[name]]
    common.write_results("batch", {"pictures": n_pictures, "k": arguments.k, "jobs": arguments.jobs}, rows)


if __name__ == "__main__":
    main()
