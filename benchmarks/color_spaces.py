"""Color spaces side by side: PSNR in sRGB, perceived difference and seconds of cvtimg in each.

Prints, for each set of pictures, the means over the pictures of the PSNR and of the CIEDE2000 difference of a pixel
(the mean, and what 95 % of the pixels do not exceed), as scikit-image has it, and the median ratio of the seconds to
those in rgb. Nothing is dithered.

    python benchmarks/color_spaces.py [--quick] [--k 16 256] [--pictures 4]
"""

from __future__ import annotations

import argparse
import statistics
import time
from dataclasses import asdict, dataclass

import numpy as np
from common import (
    Picture,
    group,
    machine,
    parser,
    picture_sets,
    pin_threads,
    print_table,
    progress,
    timed,
    write_results,
)
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Record:
    """One space on one picture at one k."""

    set: str
    picture: str
    k: int
    space: str
    psnr: float
    mean_difference: float
    high_difference: float
    seconds: float


def options() -> argparse.Namespace:
    """Read the command line."""
    read = parser(__doc__)
    read.add_argument("--k", type=int, nargs="+", default=[16, 64, 256], metavar="K", help="numbers of colors")
    read.add_argument("--pictures", type=int, default=5, metavar="N", help="pictures of each set (default: 5)")
    return read.parse_args()


def differences(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> tuple[float, float]:
    """Return the mean CIEDE2000 difference of the pixels, and their 95th percentile; each pair of colors once."""
    from skimage.color import deltaE_ciede2000, rgb2lab

    pairs = np.concatenate([before, after], axis=2).reshape(-1, 6)
    distinct, counts = np.unique(pairs, axis=0, return_counts=True)
    apart = deltaE_ciede2000(rgb2lab(distinct[:, :3] / 255), rgb2lab(distinct[:, 3:] / 255))
    order = np.argsort(apart)
    share = np.cumsum(counts[order]) / counts.sum()
    return float(np.average(apart, weights=counts)), float(apart[order][np.searchsorted(share, 0.95)])


def measure(name: str, picture: Picture, k: int) -> list[Record]:
    """Quantize a picture in every space."""
    from cvtimg import quantize
    from cvtimg.colors import SPACES

    records = []
    for space in SPACES:
        progress(f"{name} {picture.name} k={k} {space}")
        result, seconds = timed(lambda space=space: quantize(picture.pixels, k, space=space), time.process_time)
        apart = differences(picture.pixels, result.image)
        records.append(Record(name, picture.name, k, space, result.psnr, *apart, seconds))
    return records


def show(name: str, records: list[Record]) -> None:
    """Print the table of a set: a row for each space, three columns for each k."""
    sizes = list(group(records, lambda record: record.k))
    header = ["space", *(f"{what}, k={k}" for k in sizes for what in ("PSNR", "CIEDE2000", "95 %")), "seconds"]
    seconds = {(record.picture, record.k): record.seconds for record in records if record.space == "rgb"}
    rows = []
    for space, some in group(records, lambda record: record.space).items():
        cells = []
        for same in group(some, lambda record: record.k).values():
            cells += [f"{statistics.fmean(record.psnr for record in same):.2f}"]
            cells += [f"{statistics.fmean(record.mean_difference for record in same):.2f}"]
            cells += [f"{statistics.fmean(record.high_difference for record in same):.2f}"]
        ratio = statistics.median(record.seconds / seconds[record.picture, record.k] for record in some)
        rows.append([space, *cells, f"x {ratio:.1f}"])
    n_pictures = len({record.picture for record in records})
    print_table(f"{name}: {n_pictures} pictures", header, rows)


def main() -> None:
    """Measure, print and write the results."""
    given = options()
    pin_threads(given.threads)
    sets = picture_sets(given.data, 2 if given.quick else given.pictures)
    from cvtimg import quantize

    for space in ("lab", "oklab"):
        quantize(np.zeros((2, 2, 3), np.uint8), 1, space=space)  # imports are not timed
    records: list[Record] = []
    for name, pictures in sets.items():
        found = [record for k in given.k for picture in pictures for record in measure(name, picture, k)]
        show(name, found)
        records += found
    print(f"\n{machine()}")
    write_results("color_spaces", {"threads": given.threads}, [asdict(record) for record in records])


if __name__ == "__main__":
    main()
