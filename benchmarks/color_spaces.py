"""Color spaces side by side: PSNR in sRGB, perceived difference and seconds of cvtimg in each.

Prints, for each set of pictures, the means over the pictures of the PSNR and of the CIEDE2000 difference of a pixel
(the mean, and what 95 % of the pixels do not exceed), as scikit-image has it, and the median ratio of the seconds to
those in rgb. Nothing is dithered.

    python benchmarks/color_spaces.py [--quick] [--k 16 256] [--pictures 4]
"""

import argparse
import statistics
import time
from functools import partial
from typing import Any

import numpy as np
from common import Rows, parser, picture_sets, progress, run, timed
from numpy.typing import NDArray


def differences(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> tuple[float, float]:
    """Return the mean CIEDE2000 difference of the pixels, and their 95th percentile; each pair of colors once."""
    from skimage.color import deltaE_ciede2000, rgb2lab

    pairs = np.concatenate([before, after], axis=2).reshape(-1, 6)
    distinct, counts = np.unique(pairs, axis=0, return_counts=True)
    apart = deltaE_ciede2000(rgb2lab(distinct[:, :3] / 255), rgb2lab(distinct[:, 3:] / 255))
    order = np.argsort(apart)
    share = np.cumsum(counts[order]) / counts.sum()
    return float(np.average(apart, weights=counts)), float(apart[order][np.searchsorted(share, 0.95)])


def spaces(given: argparse.Namespace) -> tuple[Rows, Rows]:
    """Quantize pictures in every space: means over the pictures, and the median ratio of seconds to rgb."""
    from cvtimg import quantize
    from cvtimg.colors import SPACES

    for space in ("lab", "oklab"):
        quantize(np.zeros((2, 2, 3), np.uint8), 1, space=space)  # imports are not timed
    rows, shown = [], []
    for name, pictures in picture_sets(given.data, 2 if given.quick else given.pictures).items():
        for space in SPACES:
            line: dict[str, Any] = {"set": f"{name}, {len(pictures)} pictures", "space": space}
            for k in given.k:
                for picture in pictures:
                    progress(f"{name} {picture.name} k={k} {space}")
                    call = partial(quantize, picture.pixels, k, space=space)
                    result, seconds = timed(call, time.process_time)
                    mean, high = differences(picture.pixels, result.image)
                    row = {"set": name, "picture": picture.name, "k": k, "space": space, "PSNR": result.psnr}
                    rows.append({**row, "CIEDE2000": mean, "95 %": high, "seconds": seconds})
                of_k = rows[-len(pictures) :]
                for key in ("PSNR", "CIEDE2000", "95 %"):
                    line[f"{key}, k={k}"] = statistics.fmean(row[key] for row in of_k)
            own = [row["seconds"] for row in rows if (row["set"], row["space"]) == (name, space)]
            in_rgb = [row["seconds"] for row in rows if (row["set"], row["space"]) == (name, "rgb")]
            line["times rgb"] = statistics.median(a / b for a, b in zip(own, in_rgb, strict=True))
            shown.append(line)
    return rows, shown


if __name__ == "__main__":
    read = parser(__doc__)
    read.add_argument("--k", type=int, nargs="+", default=[16, 64, 256], metavar="K", help="numbers of colors")
    read.add_argument("--pictures", type=int, default=5, metavar="N", help="pictures of each set (default: 5)")
    run(read, spaces)
