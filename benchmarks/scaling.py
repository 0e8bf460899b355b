"""What cores bring to each verb, and how its cost grows with the size.

`shares` is the share of the processor time that one thread works alone, which a busy machine of two cores shows too:
with 16 threads, the time of the calling thread outside the parts that other threads may take. Waiting for memory is not
seen. `threads` has seconds and processor seconds for several numbers of threads, `growth` the exponent of the processor
time of one thread from a sixteenth of the size to the size, both also of rivals.

    python benchmarks/scaling.py [--quick] [--parts shares threads growth] [--verbs quantize ...]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from math import log, sqrt
from typing import Any

import numpy as np
from common import DATA, SAMPLES, Rows, parser, progress, read_rgb, run
from numpy.typing import NDArray
from PIL import Image, ImageOps

Image8 = NDArray[np.uint8]
#: Width, height and pixels of the pictures of which scenes are made.
WIDTH, HEIGHT = 768, 512
PICTURE = WIDTH * HEIGHT
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


def watch_parts() -> list[float]:
    """Count the processor seconds of this thread in parts of passes, in a list of one number, from now on."""
    from cvtimg._shared import threads

    caller, spent, within = threading.get_ident(), [0.0], [False]
    in_parts, side_by_side = threads.in_parts, threads.side_by_side

    def watched(work: Callable[..., Any]) -> Callable[..., Any]:
        def part(*arguments: Any) -> Any:
            if threading.get_ident() != caller or within[0]:
                return work(*arguments)
            within[0], start = True, time.thread_time()
            try:
                return work(*arguments)
            finally:
                spent[0] += time.thread_time() - start
                within[0] = False

        return part

    def parts(kernel: Callable[[int, int], None], n_items: int, work: float) -> None:
        part = watched(kernel)
        in_parts(lambda *ends: (kernel if ends == (0, n_items) else part)(*ends), n_items, work)

    def several(work: Callable[[Any], Any], items: Sequence[Any]) -> Iterator[Any]:
        return side_by_side(watched(work) if len(items) > 1 else work, items)

    threads.in_parts, threads.side_by_side = parts, several  # before other modules import them
    return spent


def measured(name: str, share: float) -> dict[str, float]:
    """Measure one call in this process: seconds, processor seconds, and those of this thread outside of parts."""
    spent = watch_parts()
    make, work = {**VERBS, **RIVALS}[name]
    work(make(share * WARM), share * WARM)
    given, spent[0] = make(share), 0.0
    before = time.perf_counter(), time.process_time(), time.thread_time()
    work(given, share)
    clock, all_, alone = time.perf_counter(), time.process_time(), time.thread_time()
    return {"seconds": clock - before[0], "processor s": all_ - before[1], "alone": alone - before[2] - spent[0]}


def measured_apart(name: str, share: float, n_threads: int) -> dict[str, float]:
    """Measure in a process of its own, with so many threads."""
    progress(f"{name}, {n_threads} threads, {share:g} of the size")
    names = ("CVTIMG", "OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "NUMEXPR_NUM")
    limits = {f"{library}_THREADS": str(n_threads) for library in names}
    command = [sys.executable, __file__, "--one", name, str(share)]
    done = subprocess.run(command, env={**os.environ, **limits}, stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def shares(given: argparse.Namespace) -> Rows:
    """Measure the serial share of each verb, and how many times as fast 16 cores can be."""
    found = []
    for name in [name for name in given.verbs if name in VERBS]:
        one = measured_apart(name, given.size, 16)
        serial = one["alone"] / one["processor s"]
        gain = 1 / (serial + (1 - serial) / 16)
        found.append({"verb": name, "processor s": one["processor s"], "serial": serial, "gain of 16": gain})
    return found


def threads(given: argparse.Namespace) -> Rows:
    """Measure seconds / processor seconds by the number of threads."""
    found = []
    for name in given.verbs:
        runs = {n: measured_apart(name, given.size, n) for n in given.numbers}
        found.append(
            {"verb": name, **{str(n): f"{run['seconds']:.2f} / {run['processor s']:.2f}" for n, run in runs.items()}}
        )
    return found


def growth(given: argparse.Namespace) -> Rows:
    """Measure processor seconds of one thread from a sixteenth of the size to the size, and the exponent."""
    found = []
    for name in given.verbs:
        few, many = (measured_apart(name, share, 1)["processor s"] for share in (given.size / 16, given.size))
        found.append({"verb": name, "a sixteenth": few, "all": many, "exponent": log(many / few) / log(16)})
    return found


if __name__ == "__main__":
    if sys.argv[1] == "--one":
        print(json.dumps(measured(sys.argv[2], float(sys.argv[3]))))
        sys.exit()
    read = parser(__doc__)
    known = [*VERBS, *(name for name, module in NEEDS.items() if find_spec(module))]
    read.add_argument("--verbs", nargs="+", choices=known, default=known, help="only these")
    read.add_argument("--size", type=float, default=1, help="share of the size: 3.5 or .4 megapixels, 2 million rows")
    read.add_argument("--numbers", type=int, nargs="+", default=[1, 2, 4, 8, 16], help="of threads")
    run(read, shares, threads, growth)
