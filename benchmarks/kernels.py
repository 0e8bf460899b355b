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
    group,
    large_pictures,
    machine,
    median_seconds,
    parser,
    picture_sets,
    pin_threads,
    print_table,
    progress,
    read_rgb,
    timed,
    write_results,
)

if TYPE_CHECKING:
    from cvtimg.colors import ColorSamples

SIMD_LEVELS = ("baseline", "avx2", "avx512")
DIMS = (1, 3, 4, 16, 64)
#: Points of the assignment: about as many as a photograph has colors.
N_POINTS = 1500 * 64
#: Name of the case in which the points are the colors of a picture.
PHOTOGRAPH = "photograph, D=3"

Row = dict[str, Any]


def options() -> argparse.Namespace:
    """Read the command line."""
    read = parser(__doc__)
    read.add_argument("--k", type=int, default=256, metavar="K", help="number of generators (256)")
    read.add_argument(
        "--repeats", type=int, metavar="N", help="at least so many times to take the median of (9; quick: 3)"
    )
    read.add_argument("--assignment-only", action="store_true", help=argparse.SUPPRESS)
    given = read.parse_args()
    given.repeats = given.repeats or (3 if given.quick else 9)
    return given


def counting(pictures: list[Picture], repeats: int) -> list[Row]:
    """Time color_samples on each picture."""
    import cvtimg

    rows = []
    for picture in pictures:
        progress(f"color_samples {picture.name}")
        n_pixels = picture.pixels.shape[0] * picture.pixels.shape[1]
        seconds = median_seconds(partial(cvtimg.colors.color_samples, picture.pixels), repeats)
        rows.append(
            {
                "what": "color_samples",
                "picture": picture.name,
                "pixels": n_pixels,
                "colors": cvtimg.colors.color_samples(picture.pixels).n_colors,
                "seconds": seconds,
                "ns_a_pixel": seconds / n_pixels * 1e9,
            }
        )
    progress("")
    return rows


def assignment(k: int, repeats: int, picture: Path) -> list[Row]:
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
            "what": "assign",
            "simd": _kernels.simd,
            "points": case,
            "seconds": (seconds := median_seconds(call, repeats)),
            "gpairs_a_second": n_points * k / seconds / 1e9,
        }
        for case, (n_points, call) in calls.items()
    ]


def assignment_at(level: str, given: argparse.Namespace) -> list[Row]:
    """Time the pass in a process of its own: the instruction set is chosen when the module is loaded."""
    progress(f"assign {level}")
    command = [sys.executable, __file__, "--assignment-only", "--k", str(given.k), "--repeats", str(given.repeats)]
    command += ["--threads", str(given.threads)]
    command += ["--data", str(given.data)] if given.data else []
    shown = subprocess.run(
        command, env={**os.environ, "CVTIMG_SIMD": level}, stdout=subprocess.PIPE, text=True, check=True
    )
    rows: list[Row] = json.loads(shown.stdout)
    return rows


def all_levels(given: argparse.Namespace) -> list[Row]:
    """Time the pass at each instruction set that this processor has; they take turns, of which the median counts."""
    turns = [
        row for _ in range(1 if given.quick else 3) for level in SIMD_LEVELS for row in assignment_at(level, given)
    ]
    progress("")
    ran = group(turns, lambda row: (row["simd"], row["points"]))
    for level in SIMD_LEVELS:
        if (level, PHOTOGRAPH) not in ran:
            print(f"- {level}: left out: this processor does not have it, or the compiler did not know it")
    return [sorted(rows, key=lambda row: float(row["seconds"]))[len(rows) // 2] for rows in ran.values()]


def seedings(pictures: list[Picture], k: int, repeats: int) -> list[Row]:
    """Time each way to seed on the colors of each picture."""
    import cvtimg

    rows = []
    for picture in pictures:
        samples = cvtimg.colors.color_samples(picture.pixels)
        for name in cvtimg.engine.SEEDINGS:
            progress(f"{name} {picture.name}")
            rows.append({"what": "seeding", "picture": picture.name, **seeding_row(samples, name, k, repeats)})
    progress("")
    return rows


def seeding_row(samples: ColorSamples, name: str, k: int, repeats: int) -> Row:
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


def report(counted: list[Row], assigned: list[Row], seeded: list[Row], k: int) -> None:
    """Print the three tables."""
    columns = (("pixels", 1, 0), ("colors", 1, 0), ("seconds", 1e3, 2), ("ns_a_pixel", 1, 2))
    print_table(
        "color_samples: distinct colors, their density and the way back",
        ["picture", "pixels", "distinct colors", "ms", "ns a pixel"],
        [[row["picture"], *(f"{row[key] * scale:.{digits}f}" for key, scale, digits in columns)] for row in counted],
    )
    speeds = {(row["simd"], row["points"]): row["gpairs_a_second"] for row in assigned}
    cases = list(dict.fromkeys(row["points"] for row in assigned))
    levels = list(dict.fromkeys(row["simd"] for row in assigned))
    print_table(
        f"assign: billions of point-generator pairs a second, k={k}; {N_POINTS} random points, or a picture's colors",
        ["instruction set", *cases],
        [[level, *(f"{speeds[level, case]:.2f}" for case in cases)] for level in levels],
    )
    print_table(
        f"seeding, k={k}; energy a pixel of the seeds, and after tessellate from them",
        ["picture", "init", "seed ms", "energy of seeds", "energy in the end", "moves", "tessellate ms"],
        [
            [
                row["picture"],
                row["init"],
                f"{row['seconds'] * 1e3:.1f}",
                f"{row['energy_of_seeds']:.2f}",
                f"{row['energy_in_the_end']:.2f}",
                str(row["moves"]),
                f"{row['lloyd_seconds'] * 1e3:.1f}",
            ]
            for row in seeded
        ],
    )


def main() -> None:
    """Measure, print, write."""
    given = options()
    pin_threads(given.threads)
    if given.assignment_only:
        print(json.dumps(assignment(given.k, given.repeats, large_pictures(given.data)[0])))
        return
    print(f"Kernels. {machine()}. Threads: {given.threads or 'as each likes'}.\n")
    small = [pictures[0] for pictures in picture_sets(given.data, 1).values()]
    large = [Picture(path.stem, read_rgb(path)) for path in large_pictures(given.data)]
    pictures = [*small, *large[: 1 if given.quick else None]]
    counted = counting(pictures, given.repeats)
    assigned = all_levels(given)
    seeded = seedings(pictures, given.k, max(given.repeats // 3, 1))
    report(counted, assigned, seeded, given.k)
    write_results("kernels", {"threads": given.threads, "k": given.k}, _same_keys([*counted, *assigned, *seeded]))


def _same_keys(rows: list[Row]) -> list[Row]:
    """Give each row all keys: the three tables go to one file."""
    keys = list(dict.fromkeys(key for row in rows for key in row))
    return [{key: row.get(key, "") for key in keys} for row in rows]


if __name__ == "__main__":
    main()
