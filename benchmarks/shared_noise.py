"""Noise that neighboring pixels share, as blurring, scaling, demosaicing and JPEG leave it: `restore` beside OpenCV.

Prints PSNR in dB for the 192 x 192 pixels in the middle of each photograph of a folder. cvtimg finds the noise itself
or is told that it is white; the strength of OpenCV's non-local means is the best of several, chosen by the truth.

    python benchmarks/shared_noise.py [--quick] FOLDER
"""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from common import machine, parser, pin_threads, print_means, write_results
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import convolve, gaussian_filter

from cvtimg import restore

Floats = NDArray[np.float64]
Random = np.random.Generator

SIDE, SIGMA = 192, 15
STRENGTHS = (8, 12, 16, 20, 25, 30)


def as_bytes(image: Floats) -> NDArray[np.uint8]:
    """Round to 8 bits, as files hold them."""
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def as_jpeg(image: Floats) -> Floats:
    """Compress at quality 90."""
    file = io.BytesIO()
    Image.fromarray(as_bytes(image)).save(file, "JPEG", quality=90)
    return np.asarray(Image.open(file), np.float64)


def blurred(clean: Floats, blur: float, rng: Random) -> tuple[Floats, Floats]:
    """Return a photograph, and with noise that was blurred."""
    noise = gaussian_filter(rng.standard_normal(clean.shape), (blur, blur, 0))
    return clean, clean + SIGMA / noise.std() * noise


def scaled(clean: Floats, rng: Random) -> tuple[Floats, Floats]:
    """Return a photograph made 1.5 times as large, and with the noise that it had before."""

    def resized(image: Floats, side: int) -> Floats:
        bands = [Image.fromarray(band.astype(np.float32)) for band in np.moveaxis(image, 2, 0)]
        return np.stack([np.asarray(band.resize((side, side), Image.Resampling.BICUBIC)) for band in bands], axis=2)

    small = resized(clean, SIDE * 2 // 3)
    return resized(small, SIDE), resized(small + SIGMA * rng.standard_normal(small.shape), SIDE)


def demosaiced(clean: Floats, rng: Random) -> tuple[Floats, Floats]:
    """Return a photograph, and what a sensor with noise sees through a Bayer mosaic, interpolated linearly, as JPEG."""
    places = np.add.outer(2 * (np.arange(SIDE) % 2), np.arange(SIDE) % 2)
    tent = np.outer([0.25, 0.5, 0.25], [1, 2, 1])
    seen = clean + SIGMA * rng.standard_normal((SIDE, SIDE, 1))
    found = []
    for band, sites in enumerate(((0,), (1, 2), (3,))):
        known = np.isin(places, sites).astype(np.float64)
        found.append(convolve(known * seen[:, :, band], tent) / convolve(known, tent))
    return clean, as_jpeg(np.stack(found, axis=2))


def as_blurred(blur: float) -> Callable[[Floats, Random], tuple[Floats, Floats]]:
    """Return what blurs noise."""
    return lambda clean, rng: blurred(clean, blur, rng)


CASES: dict[str, Callable[[Floats, Random], tuple[Floats, Floats]]] = {
    **{f"blurred by {blur} px": as_blurred(blur) for blur in (0.6, 0.8, 1.2)},
    "blurred by 0.8 px, JPEG": lambda clean, rng: (clean, as_jpeg(blurred(clean, 0.8, rng)[1])),
    "scaled by 1.5": scaled,
    "mosaic, JPEG": demosaiced,
    "white": lambda clean, rng: (clean, clean + SIGMA * rng.standard_normal(clean.shape)),
}


def psnr(image: NDArray[np.uint8], clean: Floats) -> float:
    """In dB."""
    return float(10 * np.log10(255**2 / np.mean((image - clean) ** 2)))


def measured(clean: Floats, noisy: NDArray[np.uint8]) -> dict[str, float]:
    """PSNR of what each makes of an image."""
    tries = [cv2.fastNlMeansDenoisingColored(noisy, None, h, h, 5, 15) for h in STRENGTHS]
    return {
        "noisy": psnr(noisy, clean),
        "cvtimg": psnr(restore([noisy], detail=True).image, clean),
        "cvtimg, as white": psnr(restore([noisy], detail=True, noise_like="white").image, clean),
        "OpenCV": max(psnr(image, clean) for image in tries),
    }


def middle(path: Path) -> Floats:
    """Return the middle of a photograph, in levels of 8 bits."""
    with Image.open(path) as image:
        left, top = (image.width - SIDE) // 2, (image.height - SIDE) // 2
        return np.asarray(image.convert("RGB").crop((left, top, left + SIDE, top + SIDE)), np.float64)


def main() -> None:
    """Measure, print, write."""
    arguments = parser(__doc__)
    arguments.add_argument("folder", type=Path)
    given = arguments.parse_args()
    pin_threads(given.threads)
    cv2.setNumThreads(1)
    print(machine())
    paths, rows = sorted(given.folder.glob("*.png"))[: 3 if given.quick else None], []
    for name, spoil in CASES.items():
        found = []
        for path in paths:
            clean, noisy = spoil(middle(path), np.random.default_rng(0))
            found.append(measured(clean, as_bytes(noisy)))
        print_means(f"{name}: PSNR, dB", [path.stem for path in paths], found, ".2f")
        rows += [{"noise": name, "case": path.stem, **one} for path, one in zip(paths, found, strict=True)]
    write_results("shared_noise", {"quick": given.quick}, rows)


if __name__ == "__main__":
    main()
