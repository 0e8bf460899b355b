"""Color quantizers side by side: error and seconds on sets of photographs.

Prints, for each set of pictures, the mean over the pictures of the squared error of a pixel (summed over R, G and B,
palette of 8 bits), and the median over the pictures of the seconds with the median ratio to cvtimg balanced. Rivals
take turns on each picture, in one run and in both orders, so that a noisy moment meets them all.

    python benchmarks/quantization.py [--quick] [--k 16 256] [--rivals imagequant faiss] [--heavy 99]
"""

import argparse
import statistics
import sys
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from common import (
    Picture,
    Rows,
    group,
    machine,
    parser,
    picture_sets,
    pin_threads,
    print_table,
    progress,
    spread,
    squared_error,
    write_results,
)
from numpy.typing import NDArray
from rivals import RIVALS, Rival

#: The rival that the others are compared with.
MEASURE = "cvtimg balanced"
#: Seconds from which a rival is timed once a picture: what disturbs a short run weighs less in a long one.
LONG = 0.5


def options() -> argparse.Namespace:
    """Read the command line."""
    read = parser(__doc__)
    read.add_argument("--k", type=int, nargs="+", metavar="K", help="numbers of colors (default: 4 16 64 256)")
    read.add_argument("--pictures", type=int, metavar="N", help="at most N pictures of each set (default: all)")
    read.add_argument("--rivals", nargs="+", metavar="WORD", help="only rivals whose name has one of these words")
    read.add_argument("--heavy", type=int, default=2, metavar="N", help="pictures of each set for slow rivals (2)")
    read.add_argument("--repeats", type=int, default=3, metavar="N", help="times of which to take the median (3)")
    given = read.parse_args()
    if given.quick:
        given.pictures, given.heavy, given.repeats = given.pictures or 2, 1, 1
    given.k = given.k or ([16, 256] if given.quick else [4, 16, 64, 256])
    return given


def chosen(words: Sequence[str] | None) -> list[Rival]:
    """List the rivals that are asked for and can run, and print why others are left out."""
    able = []
    for rival in RIVALS:
        wanted = rival.cost != "optional" if words is None else any(word in rival.name for word in words)
        if rival.name == MEASURE or wanted:
            reason = rival.missing()
            print(f"- {rival.name}: {'left out: ' + reason if reason else rival.version()}")
            if not reason:
                able.append(rival)
        elif words is None:
            print(f"- {rival.name}: left out: it is only run when --rivals names it")
    if MEASURE not in [rival.name for rival in able]:
        sys.exit("cvtimg must be installed to be compared with")
    return able


def warm_up(rivals: Iterable[Rival], n_threads: int) -> None:
    """Load and pin the rivals, and let each pay for its first call now."""
    small = np.random.default_rng(0).integers(0, 256, (32, 32, 3), dtype=np.uint8)
    for rival in rivals:
        if n_threads:
            rival.pin(n_threads)
        rival.cluster(small, 4)


def compare(name: str, picture: Picture, k: int, rivals: Sequence[Rival], repeats: int) -> Rows:
    """Measure rivals on one picture, one after the other, in one order and then in the other; once what is long."""
    seconds: dict[str, list[float]] = {rival.name: [] for rival in rivals}
    shown = {}
    for repeat in range(repeats):
        for rival in rivals[:: 1 if repeat % 2 == 0 else -1]:
            if repeat and seconds[rival.name][0] > LONG:
                continue
            progress(f"{name} {picture.name} k={k} {rival.name}")
            shown[rival.name], once = rival.cluster(picture.pixels, k)
            seconds[rival.name].append(once)
    return [
        {
            "set": name,
            "picture": picture.name,
            "k": k,
            "rival": rival.name,
            "error": squared_error(picture.pixels, shown[rival.name]),
            "seconds": statistics.median(seconds[rival.name]),
            "n_colors": count_colors(shown[rival.name]),
        }
        for rival in rivals
    ]


def count_colors(pixels: NDArray[np.uint8]) -> int:
    """Count the distinct colors of a picture."""
    wide = pixels.reshape(-1, 3).astype(np.int32)
    return len(np.unique(wide[:, 0] << 16 | wide[:, 1] << 8 | wide[:, 2]))


def measure(name: str, pictures: Sequence[Picture], rivals: Sequence[Rival], given: argparse.Namespace) -> Rows:
    """Measure all rivals on a set; the heavy ones on a few pictures that lie evenly in it."""
    few = {picture.name for picture in spread(pictures, given.heavy)}
    records = []
    for picture in pictures:
        for k in given.k:
            able = [
                rival for rival in rivals if k <= rival.most_colors and (rival.cost == "light" or picture.name in few)
            ]
            records += compare(name, picture, k, able, given.repeats)
    progress("")
    return records


def error_cell(records: Rows, base: dict[str, dict[str, Any]]) -> str:
    """Write the mean error, or the ratio of the means and the number of pictures where they are not all there."""
    if not records:
        return "-"
    mean = statistics.fmean(record["error"] for record in records)
    if len(records) == len(base):
        return f"{mean:.1f}" if mean < 1000 else f"{mean:.0f}"
    compared = statistics.fmean(base[record["picture"]]["error"] for record in records)
    return f"x{mean / compared:.3f} ({len(records)})"


def time_cell(records: Rows, base: dict[str, dict[str, Any]]) -> str:
    """Write the median seconds, and the median over the pictures of the ratio."""
    if not records:
        return "-"
    ratio = statistics.median(record["seconds"] / base[record["picture"]]["seconds"] for record in records)
    return f"{statistics.median(record['seconds'] for record in records):.3f} (x{ratio:.3g})"


def report(name: str, records: Rows, ks: Sequence[int]) -> None:
    """Print the two tables of a set."""
    of_measure = group([record for record in records if record["rival"] == MEASURE], lambda record: record["k"])
    base = {k: {record["picture"]: record for record in rows} for k, rows in of_measure.items()}
    n_pictures = len(base[ks[0]])
    rows_of = group(records, lambda record: record["rival"])
    header = ["rival", *(f"k={k}" for k in ks)]
    cells = {"error": error_cell, "time": time_cell}
    tables = {
        what: [
            [rival, *(cell([record for record in rows if record["k"] == k], base[k]) for k in ks)]
            for rival, rows in rows_of.items()
        ]
        for what, cell in cells.items()
    }
    print_table(f"{name}, {n_pictures} pictures: squared error a pixel", header, tables["error"])
    print_table(f"{name}, {n_pictures} pictures: seconds a picture (times {MEASURE})", header, tables["time"])


def explain(given: argparse.Namespace, records: Rows) -> None:
    """Say how to read the tables, what was left out, and who broke the rules."""
    print(
        "\nError: squared, summed over R, G and B, 8-bit palette, mean over the pictures. Seconds: from decoded pixels"
        "\nto mapped pixels, median over the pictures; (process): of the whole process with its reading and writing."
        f"\nSlow rivals were left out of all but {given.heavy} pictures of each set (--heavy): xR (n) stands for the"
        f"\nratio of the mean error to that of {MEASURE} on the same n pictures."
    )
    for record in records:
        if record["n_colors"] > record["k"]:
            print(f"too many colors: {record}")


def main() -> None:
    """Measure, print, write."""
    given = options()
    pin_threads(given.threads)
    print(f"Color quantization. {machine()}. Threads: {given.threads or 'as each likes'}.\n")
    rivals = chosen(given.rivals)
    warm_up(rivals, given.threads)
    records: Rows = []
    for name, pictures in picture_sets(given.data, given.pictures).items():
        of_set = measure(name, pictures, rivals, given)
        report(name, of_set, given.k)
        records += of_set
    explain(given, records)
    versions = {rival.name: rival.version() for rival in rivals}
    write_results("quantization", {"threads": given.threads, "versions": versions}, records)


if __name__ == "__main__":
    main()
