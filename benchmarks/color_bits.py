"""Palettes of hardware with few bits per channel: found among its colors, or rounded to them afterwards.

    python benchmarks/color_bits.py IMAGE...

The table shows the squared error of cvtimg as a share of that of a palette of cvtimg, Pillow or ImageMagick that is
rounded to the colors of the hardware, after which each pixel gets the nearest of them: the mean over all images, the
worst, and how many of the colors are left after rounding.
"""

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cvtimg import find_palette
from cvtimg.colors import color_samples
from cvtimg.quantization import map_to_palette
from cvtimg.quantization.hardware import rounded

Colors = NDArray[np.uint8]


def palettes(image: Image.Image, n_colors: int) -> Iterator[tuple[str, Colors]]:
    """Yield palettes of any colors."""
    yield "cvtimg", find_palette(color_samples(np.asarray(image)), n_colors).colors
    yield "Pillow", colors_of(image.quantize(n_colors, kmeans=1, dither=Image.Dither.NONE))
    if program := shutil.which("magick") or shutil.which("convert"):
        with tempfile.TemporaryDirectory() as folder:
            image.save(f"{folder}/in.png")
            words = ["in.png", "+dither", "-colors", str(n_colors), "PNG24:out.png"]
            subprocess.run([program, *words], cwd=folder, check=True)
            with Image.open(f"{folder}/out.png") as reduced:
                yield "ImageMagick", colors_of(reduced)


def colors_of(image: Image.Image) -> Colors:
    """Return the distinct colors of an image."""
    return color_samples(np.asarray(image.convert("RGB"))).colors


def main() -> None:
    """Print a row for each number of bits and colors."""
    print("bits  colors  rounded afterwards  mean  worst  colors left")
    for n_bits in (5, 4, 3):
        for n_colors in (16, 64, 256):
            shares: dict[str, list[tuple[float, float]]] = {}
            for path in map(Path, sys.argv[1:]):
                with Image.open(path) as file:
                    image = file.convert("RGB")
                samples = color_samples(np.asarray(image))
                ours = map_to_palette(samples, find_palette(samples, n_colors, color_bits=n_bits).colors).energy
                for name, colors in palettes(image, n_colors):
                    after = np.unique(rounded(colors, (n_bits,) * 3), axis=0)
                    energy = map_to_palette(samples, after).energy
                    shares.setdefault(name, []).append((ours / energy, len(after)))
            for name, figures in shares.items():
                share, left = np.array(figures).T
                print(f"{n_bits:4}  {n_colors:6}  {name:18}  {share.mean():.3f}  {share.max():.3f}  {left.mean():.0f}")


if __name__ == "__main__":
    main()
