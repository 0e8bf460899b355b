"""Versions that disagree: what is added to one of them, and what is painted over.

Prints the quality (PSNR in dB where white is 1; what leaves 0..1 is clipped) of what `restore` makes of them with each
value of `hidden`, beside the median and the sigma-clipped mean of the versions, and for the last case the share of
pixels in the right segment.

    python benchmarks/disagreement.py
"""

import argparse
import sys
from functools import partial
from typing import Any

import numpy as np
from common import ROOT, Rows, parser, run
from numpy.typing import NDArray
from skimage.draw import disk, ellipse, line

from cvtimg import denoise, read_image, restore
from cvtimg.restoration import HIDDEN

SAMPLES = ROOT / "sample_images"
sys.path.append(str(SAMPLES))
from damage import Damage, damaged_versions  # noqa: E402

Floats = NDArray[np.float64]
PHOTOGRAPHS = ("europe_night.png", "chelsea.png", "coffee.png")
#: Standard deviations at which a value is clipped from the mean.
CLIP = 3.0


def psnr(image: Floats, clean: Floats) -> float:
    """In dB."""
    return float(-10 * np.log10(np.mean((np.clip(image, 0, 1) - clean) ** 2)))


def exposures(clean: Floats, noise: float, seed: int = 0) -> list[Floats]:
    """Four exposures: cosmic rays in the first, dust in the second, hot pixels in the third, then a passer-by."""
    rng = np.random.default_rng(seed)
    height, width = shape = clean.shape[:2]
    rays, dusty, hot, passed = (clean.copy() for _ in range(4))
    for _ in range(12):
        row, column = rng.integers(height - 30), rng.integers(width - 30)
        rays[line(row, column, row + rng.integers(30), column + rng.integers(30))] = 1
    for _ in range(10):
        dusty[disk((rng.integers(height), rng.integers(width)), rng.integers(3, 8), shape=shape)] *= 0.35
    hot[rng.random(shape) < 0.01] = 1
    passed[ellipse(0.6 * height, 0.35 * width, 0.3 * height, 0.09 * width, shape=shape)] = 0.15, 0.2, 0.55
    return [one + noise * rng.standard_normal(clean.shape) for one in (rays, dusty, hot, passed)]


def overlapping(noise: float, side: int = 192) -> tuple[list[Floats], Floats]:
    """Draw a ring in four versions; patches that overlap are painted over in all but the last."""
    down, right = np.mgrid[:side, :side] / side
    far = np.hypot(down - 0.5, right - 0.5)
    clean = ((far < 0.35) & (far > 0.15)).astype(np.float64)
    rng = np.random.default_rng(0)
    versions = []
    for number in range(4):
        patch = np.hypot(down - 0.5 - 0.02 * number, right - 0.75 + 0.03 * number) < 0.13
        versions.append(np.where(patch & (number < 3), 0, clean) + noise * rng.standard_normal(clean.shape))
    return versions, clean


def clipped_mean(versions: list[Floats]) -> Floats:
    """Mean of what lies within some deviations of the median, the deviations by the median too."""
    stack = np.stack(versions)
    apart = np.abs(stack - np.median(stack, axis=0))
    near = apart <= CLIP * np.median(apart) / 0.6745
    count = near.sum(axis=0)
    mean: Floats = np.where(count > 0, (stack * near).sum(axis=0) / np.maximum(count, 1), np.median(stack, axis=0))
    return mean


def compare(name: str, versions: list[Floats], clean: Floats, n_generators: int | None) -> dict[str, Any]:
    """Return a row: the name and the PSNR of every way."""
    found = {"median": np.median(versions, axis=0), f"mean, {CLIP:g} sigma": clipped_mean(versions)}
    verb = denoise if n_generators is None else partial(restore, n_generators=n_generators)
    found |= {f"restore, {way}": verb(versions, hidden=way).image for way in HIDDEN}
    return {"": name, **{way: psnr(image, clean) for way, image in found.items()}}


def quality(given: argparse.Namespace) -> Rows:
    """Compare the PSNR in dB of each way."""
    rows = []
    for name in PHOTOGRAPHS[: 1 if given.quick else None]:
        clean = read_image(SAMPLES / name)[:, :, :3] / 255
        for noise in (0.05, 0.08):
            versions = exposures(clean, noise)
            rows.append(compare(f"{name}, noise {noise}, additions, k = 16", versions, clean, 16))
            rows.append(compare("the same, detail", versions, clean, None))
            alike = [clean + noise * np.random.default_rng(seed).standard_normal(clean.shape) for seed in range(4)]
            rows.append(compare(f"{name}, noise {noise}, no additions, detail", alike, clean, None))
    clean = read_image(SAMPLES / "drawing.png") / 255
    versions, _ = damaged_versions(clean, 3, Damage(noise=0.15, occlusions=4), seed=2)
    return [*rows, compare("drawing, noise 0.15, painted over in one of three", versions, clean, 6)]


def segments(given: argparse.Namespace) -> Rows:
    """Count the share of pixels that are right where all versions but one are painted over."""
    rows = []
    for noise in (0.05, 0.1, 0.2, 0.3):
        versions, clean = overlapping(noise)
        labels = {hidden: restore(versions, 2, hidden=hidden).labels for hidden in HIDDEN}
        right = {hidden: float(np.mean((found == 2) == (clean == 1))) for hidden, found in labels.items()}
        rows.append({"noise": noise, **right})
    return rows


if __name__ == "__main__":
    run(parser(__doc__), quality, segments)
