"""Dithering to a fixed palette: how well the hues are kept, beside Pillow and ImageMagick.

    python benchmarks/fixed_palette.py IMAGE...

Each image is reduced to 192 x 128 pixels and dithered to the 16 colors of the PICO-8 console. The table shows the mean
CIEDE2000 after a Gaussian blur with a standard deviation of two pixels, which stands for an eye at some distance.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, __version__
from scipy.ndimage import gaussian_filter
from skimage.color import deltaE_ciede2000, rgb2lab

from cvtimg import quantize
from cvtimg.quantization import DITHERS

PICO_8 = np.frombuffer(
    bytes.fromhex("0000001d2b537e2553008751ab52365f574fc2c3c7fff1e8ff004dffa300ffec2700e43629adff83769cff77a8ffccaa"),
    np.uint8,
).reshape(16, 3)


def seen(image: NDArray[Any]) -> NDArray[np.float64]:
    """Return what an eye at some distance sees, in Lab."""
    return np.asarray(rgb2lab(gaussian_filter(np.asarray(image) / 255, (2, 2, 0))))


def results(image: Image.Image) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield each method and its image."""
    for method in (None, *DITHERS):
        yield f"cvtimg {method}", quantize(np.asarray(image), palette=PICO_8, dither=method).image
    palette = Image.new("P", (1, 1))
    palette.putpalette(PICO_8.tobytes() + bytes(PICO_8[0]) * 240)
    dithered = image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)
    yield f"Pillow {__version__}", np.asarray(dithered.convert("RGB"))
    program = shutil.which("magick")
    if program:
        with tempfile.TemporaryDirectory() as folder:
            image.save(f"{folder}/image.png")
            Image.fromarray(PICO_8[None]).save(f"{folder}/palette.png")
            words = ["image.png", "-dither", "FloydSteinberg", "-remap", "palette.png", "PNG24:out.png"]
            subprocess.run([program, *words], cwd=folder, check=True)
            yield "ImageMagick", np.asarray(Image.open(f"{folder}/out.png").convert("RGB"))


def main() -> None:
    """Print a table for each image."""
    for path in map(Path, sys.argv[1:]):
        with Image.open(path) as file:
            image = file.convert("RGB").resize((192, 128), Image.Resampling.LANCZOS)
        print(path.name)
        for name, result in results(image):
            print(f"  {name:24} {deltaE_ciede2000(seen(result), seen(np.asarray(image))).mean():6.2f}")


if __name__ == "__main__":
    main()
