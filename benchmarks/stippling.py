"""Stippling and mosaics beside others: how right tones are, how alike mosaics are, and what they cost.

Prints for each way of stippling the PSNR and the error of tones after a blur by the distance of dots, in linear light,
and processor seconds; the length and seconds of tours; and the PSNR of mosaics beside the means of SLIC superpixels.

    python benchmarks/stippling.py [--quick] [--parts stippling tours mosaics]
"""

import argparse
import time
from functools import partial
from typing import Any

import numpy as np
from common import DATA, SAMPLES, Rows, parser, run, timed
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter
from skimage import data
from skimage.metrics import peak_signal_noise_ratio
from skimage.segmentation import slic

import cvtimg
from cvtimg.artwork import find_tour, ink_coverage
from cvtimg.artwork.stipples import draw_dots

Row = dict[str, Any]
#: Share of the paper that black covers.
MAX_INK = 0.6
#: Pixels of a drawing per pixel.
FINE = 4


def photographs(megapixels: float, quick: bool) -> dict[str, NDArray[np.uint8]]:
    """Return photographs at about so many megapixels."""
    paths = [SAMPLES / "coffee.png", SAMPLES / "astronaut.png"]
    paths += [DATA / "kodak" / f"kodim{number}.png" for number in ("23", "05", "01", "13")]
    images = {path.stem: Image.open(path).convert("RGB") for path in paths if path.exists()}
    found = {"camera": Image.fromarray(data.camera()).convert("RGB"), **images}
    scaled = {}
    for name, image in list(found.items())[: 2 if quick else None]:
        factor = (megapixels * 1e6 / (image.width * image.height)) ** 0.5
        size = (round(image.width * factor), round(image.height * factor))
        scaled[name] = np.asarray(image.resize(size, Image.Resampling.BICUBIC))
    return scaled


def stippling(given: argparse.Namespace) -> Rows:
    """Tones of stipples, after a blur by the distance of dots."""
    rows = []
    n_dots = 5000 if given.quick else 20_000
    for name, image in photographs(0.25 if given.quick else 1.0, given.quick).items():
        gray = np.asarray(Image.fromarray(image).convert("L"))
        wanted = np.float32(MAX_INK) * ink_coverage(gray)
        for dots in ("equal", "sized"):
            draw = partial(cvtimg.stipple, gray, n_dots, dots=dots, max_ink=MAX_INK, tones="true")
            result, seconds = timed(draw, time.process_time)
            rows.append({"image": name, "dots": dots, **errors(result.points, result.radii, wanted), "s": seconds})
        plain = partial(cvtimg.place_generators, None, n_dots, density=1 - gray / np.float32(255))
        for other, place in (
            ("density 1 - gray", lambda plain=plain: plain().points),
            ("error diffusion", partial(error_diffusion, wanted, n_dots)),
        ):
            points, seconds = timed(place, time.process_time)
            radii = np.full(len(points), np.sqrt(wanted.sum() / len(points) / np.pi))
            rows.append({"image": name, "dots": other, **errors(points, radii, wanted), "s": seconds})
    return rows


def error_diffusion(wanted: NDArray[np.float32], n_dots: int) -> NDArray[np.float64]:
    """Place about as many dots by Floyd and Steinberg, on a picture whose pixels are dots."""
    factor = np.sqrt(n_dots / wanted.sum() * 1.0)
    size = (max(round(wanted.shape[1] * factor), 1), max(round(wanted.shape[0] * factor), 1))
    tones = np.asarray(Image.fromarray(wanted).resize(size, Image.Resampling.BOX))
    dark = np.rint(255 * (1 - np.clip(tones, 0, 1))).astype(np.uint8)
    dots = np.argwhere(~np.asarray(Image.fromarray(dark).convert("1")))
    return (dots[:, ::-1] + 0.5) * [wanted.shape[1] / size[0], wanted.shape[0] / size[1]]


def errors(points: NDArray[np.float64], radii: NDArray[np.float64], wanted: NDArray[np.float32]) -> Row:
    """Blur by the distance of dots, and compare as sRGB; and the error of ten tones, root mean square."""
    height, width = wanted.shape
    drawn = draw_dots(points, radii, wanted.shape, FINE).reshape(height, FINE, width, FINE).mean(axis=(1, 3))
    blur = np.sqrt(wanted.size / len(points))
    a, b = (1 - gaussian_filter(cover.astype(np.float64), blur, mode="reflect") for cover in (drawn, wanted))
    difference = srgb(a) - srgb(b)
    tones = np.minimum((b * 10).astype(int), 9)
    means = [(a - b)[tones == tone].mean() for tone in range(10) if (tones == tone).sum() > 200]
    return {"psnr": -10 * np.log10((difference**2).mean()), "tone_%": 100 * np.sqrt(np.mean(np.square(means)))}


def srgb(light: NDArray[np.float64]) -> NDArray[np.float64]:
    """Encode light."""
    inside = np.clip(light, 0, 1)
    return np.where(inside <= 0.0031308, 12.92 * inside, 1.055 * inside ** (1 / 2.4) - 0.055)


def tours(given: argparse.Namespace) -> Rows:
    """Tours through stipples, in square roots of their number times the area."""
    gray = np.asarray(Image.fromarray(data.camera()).resize((632, 632)))
    rows = []
    for n_dots in (5000,) if given.quick else (5000, 20_000, 100_000):
        points = cvtimg.stipple(gray, n_dots, tones="true").points
        order, seconds = timed(partial(find_tour, points), time.process_time)
        unit = np.sqrt(n_dots * gray.size)
        before, after = (np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in (points, points[order]))
        rows.append({"dots": n_dots, "as placed": before / unit, "tour": after / unit, "s": seconds})
    return rows


def mosaics(given: argparse.Namespace) -> Rows:
    """PSNR of mosaics beside means of superpixels."""
    rows, psnr = [], partial(peak_signal_noise_ratio, data_range=255)
    for name, image in photographs(0.1 if given.quick else 0.4, given.quick).items():
        for n_tiles in (250,) if given.quick else (1000, 4000):
            cells, seconds = timed(partial(cvtimg.mosaic, image, n_tiles), time.process_time)
            triangles = cvtimg.mosaic(image, n_tiles, shape="triangles")
            others = max(psnr(image, superpixel_means(image, n_tiles, compactness)) for compactness in (3, 10))
            figures = {"cells": psnr(image, cells.image), "triangles": psnr(image, triangles.image), "SLIC": others}
            rows.append({"image": name, "tiles": n_tiles, **figures, "s": seconds})
    return rows


def superpixel_means(image: NDArray[np.uint8], n_tiles: int, compactness: float) -> NDArray[np.float64]:
    """Paint SLIC superpixels with their means; they are asked for again, as so many do not come."""
    labels = slic(image, n_segments=n_tiles, compactness=compactness, start_label=0)
    labels = slic(image, n_segments=n_tiles**2 // (labels.max() + 1), compactness=compactness, start_label=0)
    flat = labels.ravel()
    sums = np.stack([np.bincount(flat, image[:, :, band].ravel()) for band in range(3)], axis=1)
    return (sums / np.bincount(flat)[:, np.newaxis])[labels]


if __name__ == "__main__":
    run(parser(__doc__), stippling, tours, mosaics)
