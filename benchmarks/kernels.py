"""The compiled passes of cvtimg, one by one, and its seedings.

Prints nanoseconds a pixel of counting distinct colors, billions of point-generator pairs a second of the assignment
for each instruction set, and seconds and energy of each way to seed. There is no rival here: these are the figures to
watch when a kernel changes.

    python benchmarks/kernels.py [--quick] [--k 256]
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from common import (
    Picture,
    Rows,
    group,
    large_pictures,
    median_seconds,
    parser,
    picture_sets,
    pin_threads,
    progress,
    read_rgb,
    run,
    timed,
)

if TYPE_CHECKING:
    from cvtimg.colors import ColorSamples

SIMD_LEVELS = ("baseline", "avx2", "avx512")
DIMS = (1, 3, 4, 16, 64)
#: Points of the assignment: about as many as a photograph has colors.
N_POINTS = 1500 * 64
#: Name of the case in which the points are the colors of a picture.
PHOTOGRAPH = "photograph, D=3"


def repeats(given: argparse.Namespace) -> int:
    """Return how many times to take the median of."""
    return int(given.repeats or (3 if given.quick else 9))


def chosen(given: argparse.Namespace) -> list[Picture]:
    """Return one picture of each set, and large ones."""
    small = [pictures[0] for pictures in picture_sets(given.data, 1).values()]
    large = large_pictures(given.data)[: 1 if given.quick else None]
    return [*small, *(Picture(path.stem, read_rgb(path)) for path in large)]


def counting(given: argparse.Namespace) -> Rows:
    """Time color_samples: distinct colors, their density and the way back."""
    import cvtimg

    rows = []
    for picture in chosen(given):
        n_pixels, samples = picture.pixels[:, :, 0].size, cvtimg.colors.color_samples(picture.pixels)
        seconds = median_seconds(partial(cvtimg.colors.color_samples, picture.pixels), repeats(given))
        row = {"picture": picture.name, "pixels": n_pixels, "colors": samples.n_colors, "seconds": seconds}
        rows.append({**row, "ns a pixel": seconds / n_pixels * 1e9})
    return rows


def assignment(k: int, repeats: int, picture: Path) -> Rows:
    """Time the pass that finds the nearest generator, at the instruction set that this process runs.

    At each D the kernel that compares every point with every generator, on random points; and at D = 3 the pass that
    the engine runs, on the colors of a picture and seeds for them. That one may skip pairs, and all are counted.
    """
    import cvtimg
    from cvtimg.engine import _kernels
    from cvtimg.engine.points import assign, pack

    rng = np.random.default_rng(0)
    calls: dict[str, tuple[int, Callable[[], object]]] = {}
    for n_dims in DIMS:
        points = pack(rng.uniform(0, 255, (N_POINTS, n_dims)).astype(np.float32), np.ones(N_POINTS))
        generators = rng.uniform(-127, 127, (k, n_dims)).astype(np.float32)
        half_norms = 0.5 * np.einsum("kd,kd->k", generators, generators)
        labels = np.empty(N_POINTS, np.int32)
        calls[f"D={n_dims}"] = N_POINTS, partial(_kernels.assign, points.tiles, generators, half_norms, labels)
    samples = cvtimg.colors.color_samples(read_rgb(picture))
    points = pack(samples.colors, samples.density)
    seeds = cvtimg.engine.SEEDINGS["split"](points, k, rng)
    calls[PHOTOGRAPH] = samples.n_colors, partial(assign, points, seeds)
    return [
        {
            "simd": _kernels.simd,
            "points": case,
            "seconds": (seconds := median_seconds(call, repeats)),
            "gpairs_a_second": n_points * k / seconds / 1e9,
        }
        for case, (n_points, call) in calls.items()
    ]


def assignment_at(level: str, given: argparse.Namespace) -> Rows:
    """Time the pass in a process of its own: the instruction set is chosen when the module is loaded."""
    progress(f"assign {level}")
    command = [sys.executable, __file__, "--assignment-only", "--k", str(given.k), "--repeats", str(repeats(given))]
    command += ["--threads", str(given.threads)]
    command += ["--data", str(given.data)] if given.data else []
    shown = subprocess.run(
        command, env={**os.environ, "CVTIMG_SIMD": level}, stdout=subprocess.PIPE, text=True, check=True
    )
    rows: Rows = json.loads(shown.stdout)
    return rows


def levels(given: argparse.Namespace) -> tuple[Rows, Rows]:
    """Time the assignment at each instruction set in turns: billions of point-generator pairs a second."""
    turns = [
        row for _ in range(1 if given.quick else 3) for level in SIMD_LEVELS for row in assignment_at(level, given)
    ]
    progress("")
    ran = group(turns, lambda row: (row["simd"], row["points"]))
    for level in SIMD_LEVELS:
        if (level, PHOTOGRAPH) not in ran:
            print(f"- {level}: left out: this processor does not have it, or the compiler did not know it")
    rows = [sorted(same, key=lambda row: float(row["seconds"]))[len(same) // 2] for same in ran.values()]
    shown = [
        {"instruction set": level, **{row["points"]: row["gpairs_a_second"] for row in some}}
        for level, some in group(rows, lambda row: row["simd"]).items()
    ]
    return rows, shown


def seedings(given: argparse.Namespace) -> Rows:
    """Time each way to seed on the colors of each picture; energies are of a pixel."""
    import cvtimg

    rows = []
    for picture in chosen(given):
        samples = cvtimg.colors.color_samples(picture.pixels)
        for name in cvtimg.engine.SEEDINGS:
            progress(f"{name} {picture.name}")
            row = seeding_row(samples, name, given.k, max(repeats(given) // 3, 1))
            rows.append({"picture": picture.name, **row})
    return rows


def seeding_row(samples: ColorSamples, name: str, k: int, repeats: int) -> dict[str, Any]:
    """Time one way to seed, and see the energy a pixel before and after Lloyd's iteration from it."""
    import cvtimg
    from cvtimg.engine.points import pack

    points = pack(samples.colors, samples.density)
    runs = [timed(lambda: cvtimg.engine.SEEDINGS[name](points, k, np.random.default_rng(0))) for _ in range(repeats)]
    seeds = points.frame.outward(runs[0][0])
    end, lloyd = timed(lambda: cvtimg.tessellate(samples, k, init=seeds))
    return {
        "colors": samples.n_colors,
        "init": name,
        "seconds": statistics.median(seconds for _, seconds in runs),
        "energy_of_seeds": end.energies[0] / samples.inverse.size,
        "energy_in_the_end": end.energy / samples.inverse.size,
        "moves": end.n_iter,
        "lloyd_seconds": lloyd,
    }


def main() -> None:
    """Measure all, or the assignment in this process alone."""
    read = parser(__doc__)
    read.add_argument("--k", type=int, default=256, metavar="K", help="number of generators (256)")
    read.add_argument("--repeats", type=int, metavar="N", help="at least so many times (9; quick: 3)")
    read.add_argument("--assignment-only", action="store_true", help=argparse.SUPPRESS)
    if "--assignment-only" in sys.argv:
        given = read.parse_args()
        pin_threads(given.threads)
        print(json.dumps(assignment(given.k, given.repeats, large_pictures(given.data)[0])))
    else:
        run(read, counting, levels, seedings)


if __name__ == "__main__":
    main()
