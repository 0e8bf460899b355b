"""What cores bring to each verb, and what the memory allows.

`virtual` tells what 16 cores can bring, on any machine: the parts of each pass are timed one by one, in one thread, and
given to as many of 16 workers as the pass asks for, as they get free; beside it how many passes that were, and what
waking threads for each of them adds, where whoever is woken wakes others. Bytes are those of arrays that passes hold
and that no cache does, read or written once a pass; the limit is the gain at which a copy by all cores of this machine
would be as fast. `threads` has seconds and processor seconds for several numbers of threads, also of rivals.

    python benchmarks/scaling.py [--quick] [--parts virtual threads] [--verbs quantize ...]
"""

import argparse
import gc
import json
import os
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from heapq import heapreplace
from importlib import import_module
from importlib.util import find_spec
from itertools import pairwise
from math import ceil, log2, sqrt
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from common import DATA, SAMPLES, Rows, parser, progress, read_rgb, run, timed
from numpy.typing import NDArray
from PIL import Image, ImageOps

Image8 = NDArray[np.uint8]
#: Width, height and pixels of the pictures of which scenes are made.
WIDTH, HEIGHT = 768, 512
PICTURE = WIDTH * HEIGHT
#: Seconds that waking a sleeping thread takes the one that wakes it, on a virtual machine.
WAKING = 36e-6
#: Bytes of an array that stays in the caches of a core.
CACHED = 1 << 20
#: A part of the size runs first: imports are not counted.
WARM = 1 / 64


def scene(share: float, n_pictures: int = 9) -> Image8:
    """Make an image of this share of so many pictures, different ones side by side."""
    root = next(folder for folder in (DATA / "kodak", SAMPLES) if folder.is_dir())
    paths = [path for path in sorted(root.iterdir()) if path.suffix in (".png", ".jpg", ".webp")]
    side = round(sqrt(n_pictures))
    pictures = [Image.fromarray(read_rgb(paths[n % len(paths)])) for n in range(n_pictures)]
    cells = [np.asarray(ImageOps.fit(picture, (WIDTH, HEIGHT))) for picture in pictures]
    whole = np.concatenate([np.concatenate(cells[n : n + side], axis=1) for n in range(0, n_pictures, side)])
    height, width = (round(size * sqrt(share)) for size in whole.shape[:2])
    return np.ascontiguousarray(whole[:height, :width])


def noisy(share: float) -> list[Image8]:
    """Make three noisy versions of a part of a picture."""
    rng, clean = np.random.default_rng(0), scene(share, 1)
    return [np.clip(clean + rng.normal(0, 20, clean.shape), 0, 255).astype(np.uint8) for _ in range(3)]


def rows(share: float) -> NDArray[np.float64]:
    """Make rows of a table."""
    return np.random.default_rng(0).random((int(2_000_000 * share), 4))


def call(module: str, name: str, *arguments: Any, **options: Any) -> Any:
    """Call a function of a module that is imported only now."""
    return getattr(import_module(module), name)(*arguments, **options)


verb = partial(call, "cvtimg")
#: What is measured, at a share of its size: first the input is made, which is not counted.
VERBS: dict[str, tuple[Callable[[float], Any], Callable[[Any, float], Any]]] = {
    "quantize": (scene, lambda image, share: verb("quantize", image, 256)),
    "quantize, 4096": (scene, lambda image, share: verb("quantize", image, 4096)),
    "quantize, eyes": (scene, lambda image, share: verb("quantize", image, 256, goal="eyes")),
    "quantize, quality": (lambda share: scene(share, 1), lambda image, share: verb("quantize", image, quality=70)),
    "visual_quality": (scene, lambda image, share: verb("visual_quality", image, image[::-1].copy())),
    "tessellate": (rows, lambda table, share: verb("tessellate", table, 64)),
    "superpixels": (scene, lambda image, share: verb("superpixels", image, int(2000 * share) + 9)),
    "segment, auto": (scene, lambda image, share: verb("segment", image, 5, edge_weight="auto")),
    "segment_hierarchy": (lambda share: scene(share, 1), lambda image, share: verb("segment_hierarchy", image)),
    "denoise": (noisy, lambda images, share: verb("denoise", images)),
    "denoise, align": (noisy, lambda images, share: verb("denoise", images, align=True)),
    "sphere_grid": (lambda share: int(100_000 * share), lambda n, share: verb("sphere_grid", n)),
    "stipple": (
        lambda share: scene(share, 1),
        lambda image, share: verb("stipple", np.asarray(Image.fromarray(image).convert("L")), int(20_000 * share) + 9),
    ),
    "mosaic": (lambda share: scene(share, 1), lambda image, share: verb("mosaic", image, int(2000 * share) + 9)),
    "design": (lambda share: int(200 * share) + 4, lambda n, share: verb("design", n, 10)),
}
RIVALS = {
    "KMeans of scikit-learn": (rows, lambda table, share: call("sklearn.cluster", "KMeans", 64, n_init=1).fit(table)),
    "SLIC of scikit-image": (
        scene,
        lambda image, share: call("skimage.segmentation", "slic", image, int(2000 * share) + 9),
    ),
    "BM3D": (noisy, lambda images, share: call("bm3d", "bm3d_rgb", np.mean(images, axis=0) / 255, 20 / 255 / sqrt(3))),
}
#: The modules of rivals, which are left out where these cannot be imported.
NEEDS = {"KMeans of scikit-learn": "sklearn", "SLIC of scikit-image": "skimage", "BM3D": "bm3d"}


class Passes:
    """Passes whose parts run one by one, timed, in place of side by side."""

    def __init__(self, n_workers: int) -> None:
        from cvtimg._shared import threads

        self.n_workers = self._room = n_workers  # all, and those that a pass may have now
        self.forget()
        threads.in_parts, threads.side_by_side = self.in_parts, self.side_by_side  # before other modules import them

    def forget(self) -> None:
        """Forget all passes."""
        self.n_passes = self.n_bytes = 0
        self.work, self.saved = 0.0, 0.0  # seconds in passes, and what others spare the one who begins them
        self.waking, self.measuring = 0.0, 0.0  # seconds that waking takes, and that all of this does

    def in_parts(self, kernel: Callable[[int, int], None], n_items: int, work: float) -> None:
        """Do what `threads.in_parts` does."""
        from cvtimg._shared import threads

        n = int(min(self._room, n_items, work / threads._TO_HAND_OVER))
        n_parts = 1 if n <= 1 else min(n_items, threads._PARTS_OF_A_THREAD * n)
        ends = [n_items * part // n_parts for part in range(n_parts + 1)]
        deque(self._timed(lambda part: kernel(*part), [*pairwise(ends)], n), maxlen=0)

    def side_by_side(self, work: Callable[[Any], Any], items: Sequence[Any]) -> Iterator[Any]:
        """Do what `threads.side_by_side` does."""
        return self._timed(work, items, self._room)

    def _timed(self, work: Callable[[Any], Any], items: Sequence[Any], n_workers: int) -> Iterator[Any]:
        room, resumed = self._room, time.thread_time()
        if room == 1 or len(items) == 1:
            yield from map(work, items)
            return
        is_outer = room == self.n_workers
        if is_outer:
            self.n_bytes += sum({id(array): array.nbytes for array in held(work) if array.nbytes > CACHED}.values())
            self.waking += WAKING * ceil(log2(n_workers))
            self.n_passes += 1
        free = [0.0] * n_workers  # when each worker has done its parts
        for item in items:
            before, self._room, start = (
                (self.measuring, self.saved),
                room // min(len(items), n_workers),
                time.thread_time(),
            )
            try:
                result = work(item)
            finally:
                self._room, whole = room, time.thread_time() - start
            spent = whole - (self.measuring - before[0])
            self.work += spent if is_outer else 0
            spent -= self.saved - before[1]  # by passes within, which have the workers that are left
            self.saved += spent
            heapreplace(free, free[0] + spent)
            self.measuring += time.thread_time() - resumed - whole
            yield result
            resumed = time.thread_time()
        self.saved -= max(free)


def held(thing: object, depth: int = 12) -> Iterator[NDArray[Any]]:
    """Yield the arrays that a kernel holds: in its closure, its arguments, and values in these."""
    if isinstance(thing, np.ndarray):
        yield thing
    elif depth and not isinstance(thing, (type, ModuleType)):
        for part in gc.get_referents(thing.__closure__ if isinstance(thing, FunctionType) else thing):
            yield from held(part, depth - 1)


def bandwidth() -> float:
    """Measure the bytes in a second that all threads of this machine copy, read and written, at best."""
    rows, out = np.ones((2, 1 << 14, 1 << 9))
    return (
        2 * rows.nbytes / min(timed(partial(call, "cvtimg._shared.sums", "copy_rows", rows, out))[1] for _ in range(99))
    )


def measured(name: str, share: float) -> dict[str, float]:
    """Measure one call in this process: seconds, and processor seconds."""
    make, work = {**VERBS, **RIVALS}[name]
    work(make(share * WARM), share * WARM)
    given = make(share)
    before = time.perf_counter(), time.process_time()
    work(given, share)
    return {"seconds": time.perf_counter() - before[0], "processor s": time.process_time() - before[1]}


def planned(name: str, share: float) -> dict[str, float]:
    """Measure one call in one thread of this process, and what its passes would take on 16 cores."""
    passes = Passes(16)
    make, work = VERBS[name]
    work(make(share * WARM), share * WARM)
    given = make(share)
    passes.forget()
    start = time.thread_time()
    work(given, share)
    all_ = time.thread_time() - start - passes.measuring
    return {
        "processor s": all_,
        "alone": all_ - passes.work,
        "gain of 16": all_ / (all_ - passes.saved),
        "with waking": all_ / (all_ - passes.saved + passes.waking),
        "passes": passes.n_passes,
        "waking s": passes.waking,
        "bytes": passes.n_bytes,
        "bytes an item": passes.n_bytes / (given if isinstance(given, int) else np.prod(np.shape(given)[:-1])),
    }


def measured_apart(name: str, share: float, n_threads: int, how: str = "--measured") -> dict[str, float]:
    """Measure in a process of its own, with a number of threads."""
    progress(f"{name}, {n_threads} threads, {share:g} of the size")
    names = ("CVTIMG", "OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "NUMEXPR_NUM")
    limits = {f"{library}_THREADS": str(n_threads) for library in names}
    command = [sys.executable, __file__, how, name, str(share)]
    done = subprocess.run(command, env={**os.environ, **limits}, stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def virtual(given: argparse.Namespace) -> Rows:
    """Measure the serial part and the passes of each verb, and how many times as fast it can be."""
    found, speed = [], bandwidth()
    for name in (name for name in given.verbs if name in VERBS):
        row = measured_apart(name, given.size, 1, "--planned")
        found.append({"verb": name, **row, "limit": row["processor s"] * speed / max(row.pop("bytes"), 1)})
    progress(f"a copy by all threads of this machine: {speed / 1e9:.1f} GB/s")
    return found


def threads(given: argparse.Namespace) -> Rows:
    """Measure seconds / processor seconds by the number of threads."""
    rows = []
    for name in given.verbs:
        runs = [(n, measured_apart(name, given.size, n)) for n in given.numbers]
        rows.append({"verb": name} | {str(n): f"{run['seconds']:.2f} / {run['processor s']:.2f}" for n, run in runs})
    return rows


if __name__ == "__main__":
    if sys.argv[1:2] in (["--measured"], ["--planned"]):
        print(json.dumps((measured if sys.argv[1] == "--measured" else planned)(sys.argv[2], float(sys.argv[3]))))
        sys.exit()
    read = parser(__doc__)
    known = [*VERBS, *(name for name, module in NEEDS.items() if find_spec(module))]
    read.add_argument("--verbs", nargs="+", choices=known, default=known, help="only these")
    read.add_argument("--size", type=float, default=1, help="share of the size: 3.5 or .4 megapixels, 2 million rows")
    read.add_argument("--numbers", type=int, nargs="+", default=[1, 2, 4, 8, 16], help="of threads")
    run(read, virtual, threads)
