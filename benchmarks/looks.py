"""Bytes of indexed files of equal looks: cvtimg for eyes beside other programs, all in one run.

Each program writes a curve of files of several qualities of the middle of each picture: PNG, which oxipng then makes
smaller, or with --gif GIF. The ratio of bytes at equal scores is the mean over the range of scores that two curves have
in common, and over pictures. Scores are SSIMULACRA2, and as a second measure that nothing was tuned for, the blurred
difference in Oklab, masked by texture. "Ahead" is by how many points of SSIMULACRA2 cvtimg is better at the bytes of
pngquant's 256 colors. Programs that are not installed are left out.

With --sheet, parts of the pictures three times as large are written instead: as they are, in pngquant's 256 colors, and
by cvtimg at the same score. `whole_process.py` has times.

    python benchmarks/looks.py [--quick] [--pictures 4] [--size 512 384] [--rivals pngquant] [--gif]
                               [--sheet FILE]
"""

from __future__ import annotations

import io
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import oxipng
from common import Picture, machine, parser, picture_sets, progress, show, write_results
from numpy.typing import NDArray
from PIL import Image
from rivals import ImageMagick
from scipy.ndimage import gaussian_filter

from cvtimg import quantize
from cvtimg.colors.spaces import to_space
from cvtimg.looks import VisualQuality
from cvtimg.looks.rate import visibility
from cvtimg.pictures.formats.encoding import encode_image
from cvtimg.plotting import Panel, contact_sheet
from cvtimg.quantization import QuantizeOptions, Writing, quantize_file

#: What each program is asked for, from large files to small ones.
COLORS = (256, 160, 96, 64, 40)
QUALITIES = (84, 77, 70, 63)
#: How lossy gifsicle may be.
LOSSY = (0, 10, 20, 40, 80)
#: Points of a curve at which bytes are compared.
N_POINTS = 50
#: Side of the parts that --sheet shows, and where their middles are, down and right.
SHOWN, PLACE = 80, 0.3
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


def png_of(pixels: Pixels) -> bytes:
    """Return a file that other programs read quickly."""
    return saved(Image.fromarray(pixels), "png", compress_level=1)


def saved(image: Image.Image, form: str, **how: object) -> bytes:
    """Return the file that Pillow makes."""
    file = io.BytesIO()
    image.save(file, form, **how)
    return file.getvalue()


def piped(file: bytes, *command: str) -> bytes:
    """Return what a program makes of a file."""
    return subprocess.run(command, input=file, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True).stdout


def as_png(pixels: Pixels, n_colors: int, *options: str) -> bytes:
    """Return the file that pngquant makes."""
    return piped(png_of(pixels), "pngquant", *options, str(n_colors), "-")


def by_imagequant(pixels: Pixels, n_colors: int) -> bytes:
    """Return the file of the Python package."""
    import imagequant

    image = imagequant.quantize_pil_image(Image.fromarray(pixels).convert("RGBA"), 1.0, n_colors)
    return saved(image, "png", optimize=True)


def by_imagemagick(pixels: Pixels, n_colors: int) -> bytes:
    """Return the file of ImageMagick, with its own way to dither."""
    return piped(png_of(pixels), ImageMagick().program, "png:-", "-colors", str(n_colors), "png8:-")


def by_pillow(pixels: Pixels, n_colors: int) -> bytes:
    """Return the file of Pillow, dithered."""
    image = Image.fromarray(pixels)
    palette = image.quantize(n_colors, Image.Quantize.MEDIANCUT, kmeans=1)
    return saved(image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG), "png", optimize=True)


def rivals(names: Sequence[str] | None) -> dict[str, Callable[[Pixels, int], bytes]]:
    """Return the programs that are installed, or those of these names."""
    found: dict[str, Callable[[Pixels, int], bytes]] = {
        "pngquant": as_png,
        "--speed 1": lambda pixels, n_colors: as_png(pixels, n_colors, "--speed", "1"),
        "Pillow": by_pillow,
    }
    if find_spec("imagequant"):
        found["imagequant"] = by_imagequant
    if ImageMagick().is_available:
        found["ImageMagick"] = by_imagemagick
    return {name: program for name, program in found.items() if names is None or name in names}


def pixels_of(file: bytes) -> Pixels:
    """Return the pixels of a file."""
    return np.asarray(Image.open(io.BytesIO(file)).convert("RGB"))


def shown(picture: Picture) -> list[Panel]:
    """Return a part of a picture: as it is, of pngquant's file, and of that of cvtimg at the same score."""
    pixels = picture.pixels
    file = as_png(pixels, 256)
    theirs = pixels_of(file)
    ours = quantize(pixels, quality=VisualQuality(pixels)(theirs))
    sizes = {"pngquant": len(file), "cvtimg": len(encode_image(".png", ours.content[0], palette=ours.content[1]))}
    captions = ["original", *(f"{name}, {size / 1000:.0f} kB" for name, size in sizes.items())]
    top, left = (max(0, round(PLACE * n) - SHOWN // 2) for n in pixels.shape[:2])
    part = np.s_[top : top + SHOWN, left : left + SHOWN]
    images = (pixels, theirs, ours.image)
    return [Panel(image[part], (caption,)) for image, caption in zip(images, captions, strict=True)]


def pngs_of(pixels: Pixels, names: Sequence[str] | None) -> dict[str, list[bytes]]:
    """Return the PNG files of each program, those of cvtimg for eyes first."""
    eyes, error = [], [quantize(pixels, n_colors) for n_colors in COLORS]
    for quality in QUALITIES:
        try:
            eyes.append(quantize(pixels, quality=quality))
        except ValueError:  # which 256 colors do not reach
            continue
    eyes.append(quantize(pixels, goal="eyes"))

    def stored(results: list[object]) -> list[bytes]:
        return [encode_image(".png", one.content[0], palette=one.content[1]) for one in results]  # type: ignore

    files = {name: [program(pixels, n) for n in COLORS] for name, program in rivals(names).items()}
    smaller = {f"{name} + oxipng": [oxipng.optimize_from_memory(one) for one in some] for name, some in files.items()}
    return {"eyes": stored(eyes), **files, **smaller, "error": stored(error)}


def gifs_of(pixels: Pixels) -> dict[str, list[bytes]]:
    """Return the GIF files of each program, those of cvtimg for eyes first."""

    def optimized(file: bytes, lossy: int = 0) -> bytes:
        return piped(file, "gifsicle", "-O3", *([f"--lossy={lossy}"] if lossy else []))

    theirs = [saved(Image.open(io.BytesIO(as_png(pixels, n))), "gif", optimize=False) for n in COLORS]
    eyes = []
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, "a.png"), Path(folder, "a.gif")
        source.write_bytes(png_of(pixels))
        for quality in (*QUALITIES, None):
            try:
                quantize_file(
                    source, target, QuantizeOptions(quality=quality, goal="eyes"), writing=Writing(overwrite=True)
                )
            except ValueError:  # which 256 colors do not reach
                continue
            eyes.append(target.read_bytes())
    return {
        "eyes": eyes,
        "pngquant": [optimized(file) for file in theirs],
        "gifsicle --lossy": [optimized(theirs[0], lossy) for lossy in LOSSY],
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


def measure(
    picture: Picture, size: tuple[int, int], files_of: Callable[[Pixels], dict[str, list[bytes]]]
) -> dict[str, float | str]:
    """Compare the programs on the middle of a picture."""
    width, height = size
    top, left = (max(0, (a - b) // 2) for a, b in zip(picture.pixels.shape, (height, width), strict=False))
    pixels = np.ascontiguousarray(picture.pixels[top : top + height, left : left + width])
    score, files = Measures(pixels), files_of(pixels)
    scores = {name: [score(pixels_of(one)) for one in some] for name, some in files.items()}
    curves = {name: curve(some, [one[0] for one in scores[name]]) for name, some in files.items()}
    second = {name: curve(files[name], [one[1] for one in scores[name]]) for name in ("eyes", "pngquant")}
    ours, rival = curves["eyes"], curves["pngquant"]
    row: dict[str, float | str] = {"picture": picture.name}
    row |= {name: ratio(one, ours) for name, one in curves.items() if name not in ("eyes", "error")}
    row["second"] = ratio(second["pngquant"], second["eyes"])
    if "error" in curves:
        row["error"] = ratio(rival, curves["error"])
    return row | {"ahead": float(np.interp(rival[-1, 1], ours[:, 1], ours[:, 0]) - rival[-1, 0])}


def main() -> None:
    """Run the benchmark and print its table."""
    options = parser(__doc__)
    options.add_argument("--pictures", type=int, help="pictures of each set")
    options.add_argument("--size", type=int, nargs=2, default=(512, 384), help="width and height of what is taken")
    options.add_argument("--rivals", nargs="+", metavar="NAME", help="only these programs, one of which is pngquant")
    options.add_argument("--gif", action="store_true", help="GIF files")
    options.add_argument("--sheet", metavar="FILE", help="image file to write instead")
    given = options.parse_args()
    if given.sheet:
        rows = [shown(one) for some in picture_sets(given.data, given.pictures).values() for one in some]
        Image.fromarray(contact_sheet(rows, panel_width=3 * SHOWN)).save(given.sheet, quality=85, method=6)
        return
    program = subprocess.run(["pngquant", "--version"], capture_output=True, text=True, check=True).stdout.split()[0]
    versions = {"pngquant": program, "pyoxipng": version("pyoxipng")}
    files_of = gifs_of if given.gif else partial(pngs_of, names=given.rivals)
    name_of_results, rows = "looks_gif" if given.gif else "looks", []
    for name, pictures in picture_sets(given.data, 2 if given.quick else given.pictures).items():
        for picture in pictures:
            progress(f"{name}: {picture.name}")
            rows.append(measure(picture, given.size, files_of))
            write_results(name_of_results, {"size": given.size, **versions}, rows)  # a run takes long
    names = [name for name in rows[0] if name != "picture"]
    values = {one: np.array([row[one] for row in rows], float) for one in names}
    means = {one: float(some.mean() if one == "ahead" else np.exp(np.log(some).mean())) for one, some in values.items()}
    show(f"Bytes at equal looks, {versions}; {machine()}", [*rows, {"picture": "mean", **means}])


if __name__ == "__main__":
    main()
