"""Objects of a micrograph against what is known of them: 125 nuclei, some of them ten times as bright as others.

The foreground and the objects are compared with their truth. Only the number of segments is tuned to the picture.

    python benchmarks/segmentation_scenes.py
"""

import argparse
import statistics
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from common import DATA, Rows, parser, run, timed
from numpy.typing import NDArray
from skimage.filters import gaussian, threshold_multiotsu, threshold_otsu
from skimage.measure import label

import cvtimg
from cvtimg.segmentation import count_objects

#: Objects below this many pixels are dust, whoever finds them.
DUST = 30
#: An object is found when it covers a true one to this share of their union.
MATCH = 0.5

Labels = NDArray[np.int32]


def median_timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """Return what `call` returns, and the median seconds of five calls."""
    runs = [timed(call) for _ in range(5)]
    return runs[0][0], statistics.median(seconds for _, seconds in runs)


def nuclei(given: argparse.Namespace) -> Rows:
    """Nuclei: pieces of the foreground, which is all but the darkest segment, and objects."""
    scenes = (given.data or DATA) / "scenes"
    if not (scenes / "dsb2018_nuclei_img2d.png").exists():
        print("\nnuclei: no picture")
        return []
    image = cvtimg.read_image(scenes / "dsb2018_nuclei_img2d.png")
    truth = np.load(scenes / "dsb2018_nuclei_mask2d.npz")["labels"]
    rows = [{"rival": "truth", **score(truth, truth)}]
    for name, find in nuclei_rivals(image):
        objects, seconds = median_timed(find)
        rows.append({"rival": name, **score(objects, truth), "ms": 1e3 * seconds})
    return rows


def nuclei_rivals(image: NDArray[Any]) -> Iterator[tuple[str, Callable[[], Labels]]]:
    """Name the ways to find objects, ours and scikit-image's."""

    def ours(n_segments: int) -> Labels:
        return pieces(cvtimg.segment(image, n_segments, smallest_detail=0, min_size=DUST).labels > 1)

    def otsu(sigma: float, n_classes: int) -> Labels:
        smooth = gaussian(image, sigma, preserve_range=True) if sigma else image
        level = threshold_otsu(smooth) if n_classes == 2 else threshold_multiotsu(smooth, n_classes)[0]
        return pieces(smooth > level)

    def split(n_segments: int) -> Labels:
        return cvtimg.segment(image, n_segments, smallest_detail=0, min_size=DUST, objects=True).labels

    yield "cvtimg, count_objects", lambda: count_objects(image).labels
    for n_segments in (2, 3):
        yield f"cvtimg, {n_segments} segments, objects", partial(split, n_segments)
    yield "cvtimg, 2 segments, by noise", lambda: ours(2)
    yield "cvtimg, 3 segments, edge weight auto", lambda: ours(3)
    yield "Otsu", lambda: otsu(0, 2)
    yield "Gaussian 1, Otsu", lambda: otsu(1, 2)
    yield "Gaussian 1, Otsu in 3 classes", lambda: otsu(1, 3)


def pieces(foreground: NDArray[np.bool_]) -> Labels:
    """List the connected pieces of the foreground by number, without dust."""
    numbers = label(foreground, connectivity=1)
    kept = np.bincount(numbers.ravel()) >= DUST
    kept[0] = False
    return np.where(kept[numbers], numbers, 0)


def count(objects: Labels) -> int:
    """Count objects."""
    return len(np.unique(objects[objects > 0]))


def score(objects: Labels, truth: Labels) -> dict[str, Any]:
    """Compare objects with the truth: union of the foregrounds, and matched pairs."""
    both, either = (objects > 0) & (truth > 0), (objects > 0) | (truth > 0)
    pairs, common = np.unique(np.stack([objects[both], truth[both]]), axis=1, return_counts=True)
    union = np.bincount(objects.ravel())[pairs[0]] + np.bincount(truth.ravel())[pairs[1]] - common
    matched = int((common > MATCH * union).sum())
    n_found, n_true = count(objects), count(truth)
    f1 = 2 * matched / (n_found + n_true)
    return {"iou": both.sum() / either.sum(), "objects": n_found, "matched": matched, "f1": f1}


if __name__ == "__main__":
    run(parser(__doc__), nuclei)
