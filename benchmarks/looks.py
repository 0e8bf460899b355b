"""Bytes of indexed PNG files of equal looks, by cvtimg for eyes, cvtimg for least error, and pngquant.

Each program writes a curve of files of several qualities of the middle of each picture. The ratio of bytes at equal
scores is the mean over the range of scores that two curves have in common, and over pictures. Scores are SSIMULACRA2,
and as a second measure that nothing was tuned for, the blurred difference in Oklab, masked by texture. "Ahead" is by
how many points of SSIMULACRA2 cvtimg is better at the bytes of pngquant's 256 colors.

With --sheet, parts of the pictures three times as large are written instead: as they are, in pngquant's 256 colors, and
by cvtimg at the same score.

    python benchmarks/looks.py [--quick] [--pictures 4] [--size 512 384] [--sheet FILE]
"""

from __future__ import annotations

import io
import subprocess
from importlib.metadata import version

import numpy as np
import oxipng
from common import Picture, machine, parser, picture_sets, print_table, progress, write_results
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter

from cvtimg import quantize
from cvtimg.colors.spaces import to_space
from cvtimg.looks import VisualQuality
from cvtimg.looks.rate import visibility
from cvtimg.pictures.formats.encoding import encode_image

#: What each program is asked for, from large files to small ones.
COLORS = (256, 160, 96, 64, 40)
QUALITIES = (84, 77, 70, 63)
#: Points of a curve at which bytes are compared.
N_POINTS = 50
#: Side of the parts that --sheet shows.
SHOWN = 110
#: Standard deviations of the blurs of the second measure, and how much each counts.
BLURS = {0.7: 1, 1.5: 2, 3.0: 4}

Curve = NDArray[np.float64]
Pixels = NDArray[np.uint8]


class Measures:
    """Both scores of images against an original."""

    def __init__(self, original: Pixels) -> None:
        self._quality = VisualQuality(original)
        self._places = self._placed(original)
        self._seen = visibility(self._places[:, :, 0], 3, 3)[:, :, None]

    def __call__(self, image: Pixels) -> tuple[float, float]:
        """Return SSIMULACRA2 and the second measure, in dB."""
        error = self._placed(image) - self._places
        blurred = [factor * gaussian_filter(error, (sigma, sigma, 0)) ** 2 for sigma, factor in BLURS.items()]
        return self._quality(image), -10 * np.log10((self._seen * sum(blurred)).mean())

    def _placed(self, image: Pixels) -> NDArray[np.float64]:
        return to_space(image.reshape(-1, 3), "oklab").reshape(image.shape) * [255, 127.5, 127.5]


def as_png(pixels: Pixels, n_colors: int, *options: str) -> bytes:
    """Return the file that pngquant makes."""
    source = io.BytesIO()
    Image.fromarray(pixels).save(source, "png", compress_level=1)
    command = ["pngquant", *options, str(n_colors), "-"]
    return subprocess.run(command, input=source.getvalue(), stdout=subprocess.PIPE, check=True).stdout


def pixels_of(file: bytes) -> Pixels:
    """Return the pixels of a file."""
    return np.asarray(Image.open(io.BytesIO(file)).convert("RGB"))


def shown(picture: Picture) -> Pixels:
    """Return a part of a picture, of pngquant's and of that of cvtimg at the same score, side by side."""
    pixels = picture.pixels
    file = as_png(pixels, 256)
    theirs = pixels_of(file)
    quality = VisualQuality(pixels)
    score = quality(theirs)
    ours = quantize(pixels, quality=score)
    size = len(encode_image(".png", ours.content[0], palette=ours.content[1]))
    print(f"{picture.name}: {len(file)} bytes, {score:.1f}; {size} bytes, {ours.quality:.1f}", flush=True)
    top, left = (max(0, (extent - SHOWN) // 2) for extent in pixels.shape[:2])
    parts = [one[top : top + SHOWN, left : left + SHOWN] for one in (pixels, theirs, ours.image)]
    return np.hstack(parts).repeat(3, axis=0).repeat(3, axis=1)


def files_of(pixels: Pixels) -> dict[str, list[bytes]]:
    """Return the files of each program."""
    eyes, error = [], [quantize(pixels, n_colors) for n_colors in COLORS]
    for quality in QUALITIES:
        try:
            eyes.append(quantize(pixels, quality=quality))
        except ValueError:  # which 256 colors do not reach
            continue
    eyes.append(quantize(pixels, goal="eyes"))

    def stored(results: list[object]) -> list[bytes]:
        return [encode_image(".png", one.content[0], palette=one.content[1]) for one in results]  # type: ignore

    default = [as_png(pixels, n) for n in COLORS]
    return {
        "eyes": stored(eyes),
        "error": stored(error),
        "pngquant": default,
        "pngquant --speed 1": [as_png(pixels, n, "--speed", "1") for n in COLORS],
        "pngquant + oxipng": [oxipng.optimize_from_memory(one, level=4) for one in default],
    }


def curve(files: list[bytes], scores: list[float]) -> Curve:
    """Return (n, 2) scores and logarithms of bytes: files that no smaller one beats, by score."""
    best: list[tuple[int, float]] = []
    for size, score in sorted((len(file), score) for file, score in zip(files, scores, strict=True)):
        if not best or score > best[-1][1]:
            best.append((size, score))
    return np.array([(score, np.log(size)) for size, score in best])


def ratio(rival: Curve, ours: Curve) -> float:
    """Return the bytes of ours over those of a rival at equal scores.

    Where all of ours are better, the smallest of ours is compared with the best of the rival.
    """
    high = min(rival[-1, 0], ours[-1, 0])
    scores = np.linspace(min(max(rival[0, 0], ours[0, 0]), high), high, N_POINTS)
    return float(np.exp((np.interp(scores, *ours.T) - np.interp(scores, *rival.T)).mean()))


def measure(picture: Picture, size: tuple[int, int]) -> dict[str, float | str]:
    """Compare the programs on the middle of a picture."""
    width, height = size
    top, left = (max(0, (a - b) // 2) for a, b in zip(picture.pixels.shape, (height, width), strict=False))
    pixels = np.ascontiguousarray(picture.pixels[top : top + height, left : left + width])
    score, files = Measures(pixels), files_of(pixels)
    scores = {name: [score(pixels_of(one)) for one in some] for name, some in files.items()}
    curves = {name: curve(some, [one[0] for one in scores[name]]) for name, some in files.items()}
    second = {name: curve(files[name], [one[1] for one in scores[name]]) for name in ("eyes", "pngquant")}
    ours, rival = curves["eyes"], curves["pngquant"]
    return {
        "picture": picture.name,
        "pngquant": ratio(rival, ours),
        "--speed 1": ratio(curves["pngquant --speed 1"], ours),
        "+ oxipng": ratio(curves["pngquant + oxipng"], ours),
        "second": ratio(second["pngquant"], second["eyes"]),
        "error": ratio(rival, curves["error"]),
        "ahead": float(np.interp(rival[-1, 1], ours[:, 1], ours[:, 0]) - rival[-1, 0]),
    }


def main() -> None:
    """Run the benchmark and print its table."""
    options = parser(__doc__)
    options.add_argument("--pictures", type=int, help="pictures of each set")
    options.add_argument("--size", type=int, nargs=2, default=(512, 384), help="width and height of what is taken")
    options.add_argument("--sheet", metavar="FILE", help="image file to write instead")
    given = options.parse_args()
    if given.sheet:
        parts = [shown(one) for some in picture_sets(given.data, given.pictures).values() for one in some]
        rows_of = [np.hstack(parts[i : i + 2]) for i in range(0, len(parts) - 1, 2)]
        Image.fromarray(np.vstack(rows_of)).save(given.sheet, quality=90)
        return
    program = subprocess.run(["pngquant", "--version"], capture_output=True, text=True, check=True).stdout.split()[0]
    versions = {"pngquant": program, "pyoxipng": version("pyoxipng")}
    rows = []
    for name, pictures in picture_sets(given.data, 2 if given.quick else given.pictures).items():
        for picture in pictures:
            progress(f"{name}: {picture.name}")
            rows.append(measure(picture, given.size))
            write_results("looks", {"size": given.size, **versions}, rows)  # a run takes long
    names = [name for name in rows[0] if name != "picture"]
    table = [[str(row["picture"]), *(f"{row[one]:.3f}" for one in names)] for row in rows]
    values = {one: np.array([row[one] for row in rows], float) for one in names}
    means = [f"{some.mean() if one == 'ahead' else np.exp(np.log(some).mean()):.3f}" for one, some in values.items()]
    print(machine())
    print_table(f"Bytes at equal looks, {versions}", ["picture", *names], [*table, ["mean", *means]])


if __name__ == "__main__":
    main()
