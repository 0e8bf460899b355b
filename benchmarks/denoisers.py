"""Denoisers of other packages, as rivals of `restore`: each gets the mean of what is known, holes filled by a blur.

The parameter of each is the best of several, chosen by the truth, which nobody who restores an image has. BM3D takes a
quarter of a minute for each try, so what was found for an input is kept in out/benchmarks/denoisers.json.
"""

import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec

import numpy as np
from common import OUT
from numpy.typing import NDArray
from skimage.restoration import cycle_spin, denoise_nl_means, denoise_tv_chambolle, denoise_wavelet

from cvtimg.restoration.versions import fill

Floats = NDArray[np.float64]

CACHE = OUT / "denoisers.json"


@dataclass(frozen=True, slots=True, eq=False)
class Damaged:
    """Versions, what each knows, and what every rival is given: their mean where known, filled, and its noise."""

    versions: list[Floats]
    known: list[NDArray[np.bool_]]
    mean: Floats
    filled: Floats
    sigma: float


def fused(versions: list[Floats], known: list[NDArray[np.bool_]], noise: float) -> Damaged:
    """Take the mean of what is known; elsewhere, of what is near, as cvtimg does before its first pass."""
    weight = np.sum(known, axis=0).astype(float)[:, :, None]
    total = np.sum([version * mask[:, :, None] for version, mask in zip(versions, known, strict=True)], axis=0)
    mean = total / np.maximum(weight, 1)
    filled = fill(total.astype(np.float32), weight[:, :, 0].astype(np.float32)).astype(np.float64)
    sigma = noise * float(np.sqrt(np.mean(1 / weight[weight > 0])))
    return Damaged(versions, known, mean, filled, sigma)


def psnr(picture: Floats, clean: Floats) -> float:
    """In dB; what leaves 0..1 is cut, for all alike."""
    return float(-10 * np.log10(np.mean((np.clip(picture, 0, 1) - clean) ** 2)))


def total_variation(given: Damaged, weight: float) -> Floats:
    """Minimize the total variation."""
    return np.asarray(denoise_tv_chambolle(given.filled, weight=weight, channel_axis=-1), np.float64)


def non_local_means(given: Damaged, strength: float) -> Floats:
    """Average pixels with similar patches about them; the strength is in multiples of the noise."""
    about = {"patch_size": 5, "patch_distance": 6, "h": strength * given.sigma, "sigma": given.sigma}
    axis = -1 if given.filled.shape[2] > 1 else None
    found = denoise_nl_means(given.filled.squeeze(), channel_axis=axis, **about)
    return np.asarray(found, np.float64).reshape(given.filled.shape)


def wavelets(given: Damaged, factor: float) -> Floats:
    """Shrink wavelet coefficients by BayesShrink, averaged over shifts, for so many times the noise."""
    about = {"sigma": factor * given.sigma, "rescale_sigma": True, "channel_axis": -1}
    about["convert2ycbcr"] = given.filled.shape[2] == 3
    found = cycle_spin(given.filled, denoise_wavelet, 3, func_kw=about, workers=1, channel_axis=-1)
    return np.asarray(found, np.float64)


def bm3d(given: Damaged, factor: float) -> Floats:
    """Denoise by BM3D, for so many times the noise."""
    package = import_module("bm3d")
    denoise = package.bm3d_rgb if given.filled.shape[2] == 3 else package.bm3d
    return np.asarray(denoise(given.filled, factor * given.sigma), np.float64).reshape(given.filled.shape)


@dataclass(frozen=True, slots=True)
class Denoiser:
    """A denoiser, the package that holds it, and the values of its parameter to choose from."""

    package: str
    what: str
    apply: Callable[[Damaged, float], Floats]
    parameters: tuple[float, ...]

    @property
    def name(self) -> str:
        """What it is, and the package with its version."""
        return f"{self.what}, {self.package} {version(self.package)}"

    def best(self, clean: Floats, given: Damaged) -> Floats:
        """Denoise with the best of the parameters."""
        tries = (self.apply(given, parameter) for parameter in self.parameters)
        return max(tries, key=lambda picture: psnr(picture, clean))

    def quality(self, clean: Floats, given: Damaged) -> tuple[float, float]:
        """Best PSNR, and the mean processor seconds of a try: as found before for the same input, or anew."""
        tries = [self.measured(clean, given, parameter) for parameter in self.parameters]
        return max(one[0] for one in tries), sum(one[1] for one in tries) / len(tries)

    def measured(self, clean: Floats, given: Damaged, parameter: float) -> tuple[float, float]:
        """PSNR and processor seconds with one value of the parameter."""
        digest = hashlib.sha256(given.filled.tobytes() + clean.tobytes()).hexdigest()[:16]
        key = f"{self.name}, {parameter:g} of {given.sigma:.6f}, {digest}"
        found = json.loads(CACHE.read_text()) if CACHE.exists() else {}
        if key not in found:
            start = time.process_time()
            found[key] = psnr(self.apply(given, parameter), clean), time.process_time() - start
            CACHE.parent.mkdir(parents=True, exist_ok=True)
            before = json.loads(CACHE.read_text()) if CACHE.exists() else {}
            CACHE.write_text(json.dumps(before | {key: found[key]}, indent=1) + "\n")
        decibels, seconds = found[key]
        return decibels, seconds


BM3D = Denoiser("bm3d", "BM3D", bm3d, (1.0, 1.1, 0.9))
TOTAL_VARIATION = Denoiser(
    "scikit-image", "total variation", total_variation, (0.05, 0.08, 0.12, 0.18, 0.27, 0.4, 0.6, 0.9)
)
NON_LOCAL_MEANS = Denoiser("scikit-image", "non-local means", non_local_means, (0.4, 0.6, 0.8, 1.0, 1.3, 1.7))
WAVELETS = Denoiser("scikit-image", "wavelets", wavelets, (0.6, 0.8, 1.0, 1.25, 1.6))
#: Those that are installed.
DENOISERS = [
    one
    for one in (BM3D, NON_LOCAL_MEANS, WAVELETS, TOTAL_VARIATION)
    if find_spec(one.package.replace("scikit-image", "skimage"))
]
