"""One noisy photograph: white noise, noise that pixels share, that grows with the level of light, of JPEG, or none.

Prints PSNR in dB for the 128 x 128 pixels in the middle of each photograph of a folder, and the standard deviation of
the noise that was found. cvtimg finds the noise itself; the strength of OpenCV's non-local means is the best of
several, chosen by the truth; that of scikit-image's follows its `estimate_sigma`, or is the best of several, told the
noise. Where its package, which is not free software, is installed, BM3D is told the noise; and its true covariance: it
denoises along axes of bands that share none of it, told its true spectrum in each where pixels share noise; and light
between generalized Anscombe transforms, too.

    python benchmarks/shared_noise.py [--quick] [--case white] FOLDER
"""

import io
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from common import machine, parser, pin_threads, print_means, write_results
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import convolve, gaussian_filter
from scipy.stats import poisson
from skimage.restoration import denoise_nl_means, estimate_sigma

from cvtimg import denoise

Floats = NDArray[np.float64]
Random = np.random.Generator

SIDE, SIGMA = 128, 15
STRENGTHS = (2, 4, 8, 12, 16, 20, 25, 30)
NL_MEANS: dict[str, Any] = {"fast_mode": True, "preserve_range": True, "channel_axis": -1}


def as_bytes(image: Floats) -> NDArray[np.uint8]:
    """Round to 8 bits, as files hold them."""
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def as_jpeg(image: Floats, quality: int = 90) -> Image.Image:
    """Compress at a quality."""
    file = io.BytesIO()
    Image.fromarray(as_bytes(image)).save(file, "JPEG", quality=quality)
    return Image.open(file)


def as_light(gain: float, sigma: float) -> Callable[[Floats, Random], tuple[Floats, Floats]]:
    """Return what counts photons of so many levels, and adds noise of reading them."""
    return lambda clean, rng: (clean, gain * rng.poisson(clean / gain) + sigma * rng.standard_normal(clean.shape))


def compressed(quality: int, sigma: float) -> Callable[[Floats, Random], tuple[Floats, Image.Image]]:
    """Return what adds noise and compresses."""
    return lambda clean, rng: (clean, as_jpeg(clean + sigma * rng.standard_normal(clean.shape), quality))


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


def demosaiced(clean: Floats, rng: Random) -> tuple[Floats, Image.Image]:
    """Return a photograph, and what a sensor with noise sees through a Bayer mosaic, interpolated linearly, as JPEG."""
    places = np.add.outer(2 * (np.arange(SIDE) % 2), np.arange(SIDE) % 2)
    tent = np.outer([0.25, 0.5, 0.25], [1, 2, 1])
    seen = clean + SIGMA * rng.standard_normal((SIDE, SIDE, 1))
    found = []
    for band, sites in enumerate(((0,), (1, 2), (3,))):
        known = np.isin(places, sites).astype(np.float64)
        found.append(convolve(known * seen[:, :, band], tent) / convolve(known, tent))
    return clean, as_jpeg(np.stack(found, axis=2))


def white(sigma: float) -> Callable[[Floats, Random], tuple[Floats, Floats]]:
    """Return what adds white noise."""
    return lambda clean, rng: (clean, clean + sigma * rng.standard_normal(clean.shape))


def by_bands(
    share: float, sigma: float = SIGMA, other: float = 0.0
) -> Callable[[Floats, Random], tuple[Floats, Floats]]:
    """Return what adds noise of which bands share a part, and independent noise of `other` levels."""

    def spoil(clean: Floats, rng: Random) -> tuple[Floats, Floats]:
        same, apart = rng.standard_normal((*clean.shape[:2], 1)), rng.standard_normal(clean.shape)
        noise = sigma * (np.sqrt(share) * same + np.sqrt(1 - share) * apart)
        return clean, clean + noise + other * rng.standard_normal(clean.shape)

    return spoil


def in_gray(clean: Floats, rng: Random) -> tuple[Floats, Floats]:
    """Return a gray photograph in three bands, and with the same noise in all."""
    return by_bands(1.0)(np.repeat(np.rint(clean.mean(axis=2, keepdims=True)), 3, axis=2), rng)


def salt_and_pepper(clean: Floats, rng: Random) -> tuple[Floats, Floats]:
    """Return a photograph, and with 5 % of its pixels black or white."""
    hit, ends = rng.random(clean.shape[:2]) < 0.05, rng.choice([0.0, 255.0], clean.shape[:2])
    return clean, np.where(hit[:, :, None], ends[:, :, None], clean)


def in_rows(clean: Floats, rng: Random) -> tuple[Floats, Floats]:
    """Return a photograph, and with offsets of its rows, of 8 levels, and noise of 3."""
    return clean, clean + rng.normal(0, 8, (len(clean), 1, 1)) + rng.normal(0, 3, clean.shape)


LIGHT = {"light, weak": (0.5, 3.0), "light": (2.0, 5.0), "light, strong": (8.0, 5.0)}
CASES: dict[str, Callable[[Floats, Random], tuple[Floats, Floats | Image.Image]]] = {
    **{f"blurred by {blur} px": lambda clean, rng, b=blur: blurred(clean, b, rng) for blur in (0.6, 0.8, 1.2)},
    "blurred by 0.8 px, JPEG": lambda clean, rng: (clean, as_jpeg(blurred(clean, 0.8, rng)[1])),
    "scaled by 1.5": scaled,
    "mosaic, JPEG": demosaiced,
    "gray in three bands": in_gray,
    **{f"bands correlated by {share}": by_bands(share) for share in (0.5, 0.7, 0.9)},
    "luma 12, chroma 2": by_bands(1.0, 12, 2),
    "noise of 10 levels, JPEG 92": compressed(92, 10),
    "salt and pepper": salt_and_pepper,
    "offsets of rows": in_rows,
    **{name: as_light(*strength) for name, strength in LIGHT.items()},
    **{f"JPEG {quality}": compressed(quality, 0) for quality in (50, 75, 90)},
    "noise of 5 levels, JPEG 75": compressed(75, 5),
    "clean": lambda clean, rng: (clean, clean),
    "JPEG 95": compressed(95, 0),
    **{f"white, {sigma} levels": white(sigma) for sigma in (1, 3, 6, 12, 25)},
}


def psnr(image: NDArray[np.generic], clean: Floats) -> float:
    """In dB."""
    return float(10 * np.log10(255**2 / max(np.mean((np.clip(image, 0, 255) - clean) ** 2), 1e-4)))  # 88 dB if none


def measured(
    clean: Floats, noisy: NDArray[np.uint8] | Image.Image, light: tuple[float, float] | None, *, shared: bool
) -> dict[str, float]:
    """PSNR of what each makes of an image, and the noise that there is and that is found."""
    pixels, result = np.asarray(noisy), denoise([noisy])
    estimate: Any = estimate_sigma
    sigmas = estimate(pixels, channel_axis=-1)
    sigma = float(np.sqrt(np.mean(np.square(pixels - clean))))
    by_sigma = denoise_nl_means(pixels, 5, 6, 0.8 * float(np.mean(sigmas)), sigma=float(np.mean(sigmas)), **NL_MEANS)
    told = [denoise_nl_means(pixels, 5, 6, part * sigma, sigma=sigma, **NL_MEANS) for part in (0.4, 0.6, 0.8, 1, 1.3)]
    tries = [cv2.fastNlMeansDenoisingColored(pixels, None, h, h, 5, 15) for h in STRENGTHS]
    found = {
        "noisy": psnr(pixels, clean),
        "cvtimg": psnr(result.image, clean),
        "OpenCV": max(psnr(image, clean) for image in tries),
        "scikit-image": psnr(by_sigma, clean),
        "scikit-image, told": max(psnr(image, clean) for image in told),
        "noise": sigma,
        "found": float(result.noise[0]),
        "estimate_sigma": float(np.mean(sigmas)),
    }
    if find_spec("bm3d"):
        found["BM3D"] = psnr(255 * import_module("bm3d").bm3d_rgb(pixels / 255, max(sigma, 0.5) / 255), clean)
        found["BM3D, told"] = psnr(by_axes(pixels, clean, shared), clean)
        if light:
            found["Anscombe, BM3D"] = psnr(by_anscombe(pixels, *light), clean)
    return found


def by_axes(pixels: NDArray[np.uint8], clean: Floats, shared: bool) -> Floats:
    """Denoise by BM3D along the axes of the true covariance of bands, told the noise in each, or its spectrum."""
    apart = (pixels - clean) / 255
    _, axes = np.linalg.eigh(np.cov(apart.reshape(-1, 3).T))
    axes = axes[:, np.argsort(-np.abs(axes.sum(axis=0)))]  # blocks are matched by the first, most like lightness
    powers = np.square(np.abs(np.fft.fft2(apart @ axes, axes=(0, 1))))
    told = gaussian_filter(powers, (3, 3, 0), mode="wrap") if shared else [*np.std(apart @ axes, axis=(0, 1))]
    vars(np).setdefault("trapz", np.trapezoid)  # which the package knows by its old name
    return np.asarray(255 * import_module("bm3d").bm3d(pixels / 255 @ axes, told) @ axes.T)


def by_anscombe(pixels: NDArray[np.uint8], gain: float, sigma: float) -> Floats:
    """Denoise by BM3D what the generalized Anscombe transform makes even, and take the unbiased inverse."""

    def even(levels: Floats) -> Floats:
        return np.asarray(2 / gain * np.sqrt(np.maximum(gain * levels + 0.375 * gain**2 + sigma**2, 0)))

    values = even(pixels.astype(np.float64))
    low, span = values.min(), np.ptp(values)
    done = low + span * import_module("bm3d").bm3d_rgb((values - low) / span, 1 / span)
    # The mean of the transform over photons and, at nodes of Gauss and Hermite, over noise.
    nodes, weights = np.polynomial.hermite_e.hermegauss(21)
    levels = np.concatenate([[0], np.geomspace(0.01, 300, 300)])
    photons = np.arange(int(300 / gain + 12 * np.sqrt(300 / gain) + 12))
    means = even(gain * photons[:, None] + sigma * nodes) @ weights / weights.sum()
    return np.interp(done, poisson.pmf(photons, levels[:, None] / gain) @ means, levels)


def middle(path: Path) -> Floats:
    """Return the middle of a photograph, in levels of 8 bits."""
    with Image.open(path) as image:
        left, top = (image.width - SIDE) // 2, (image.height - SIDE) // 2
        return np.asarray(image.convert("RGB").crop((left, top, left + SIDE, top + SIDE)), np.float64)


def main() -> None:
    """Measure, print, write."""
    arguments = parser(__doc__)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--case", default="", help="part of the names of cases")
    wanted = arguments.parse_args()
    pin_threads(wanted.threads)
    cv2.setNumThreads(1)
    print(machine())
    paths, rows = sorted(wanted.folder.glob("*.png"))[: 3 if wanted.quick else None], []
    for name, spoil in CASES.items():
        if wanted.case not in name:
            continue
        found = []
        for path in paths:
            clean, noisy = spoil(middle(path), np.random.default_rng(0))
            given = noisy if isinstance(noisy, Image.Image) else as_bytes(noisy)
            found.append(measured(clean, given, LIGHT.get(name), shared="JPEG" in name or "blurred" in name))
        print_means(f"{name}: PSNR, dB", [path.stem for path in paths], found, ".2f")
        print(f"least gain: {min(one['cvtimg'] - one['noisy'] for one in found):.2f} dB")
        rows += [{"damage": name, "case": path.stem, **one} for path, one in zip(paths, found, strict=True)]
    write_results("shared_noise", {"quick": wanted.quick}, rows)


if __name__ == "__main__":
    main()
