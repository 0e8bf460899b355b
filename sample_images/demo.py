"""Quantize the sample images to 4, 16, 64 and 256 colors, segment one, and restore another.

Run it from anywhere: ``python sample_images/demo.py [OUT_DIR]``. It writes each image in each number of colors, a sheet
with all of them side by side and a sheet of the other uses, and prints errors and times. Files of an earlier run are
replaced.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg import mosaic, quantize, read_image, restore, segment, stipple, superpixels, write_image
from cvtimg.colors import color_samples
from cvtimg.plotting import draw_edges, draw_sheet
from cvtimg.quantization import Quantized

FOLDER = Path(__file__).resolve().parent
PICTURES = (
    "coffee.png",
    "chelsea.png",
    "astronaut.png",
    "rocket.jpg",
    "europe_night.png",
    "bone_texture.png",
    "drawing.png",
)
N_COLORS = (4, 16, 64, 256)
#: An image with its caption.
Panel = tuple[NDArray[Any], str]

HEADER = ("image", "size", "colors", "KB", "k", "energy", "PSNR", "ms", "KB")
COLUMNS = "{:<14} {:>9} {:>9} {:>6} {:>6} {:>9} {:>9} {:>7} {:>6}"


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """A quantized image, and its cost."""

    result: Quantized
    milliseconds: float
    n_bytes: int

    @property
    def energy(self) -> str:
        """Summed squared error per pixel."""
        energy = self.result.energy / self.result.indices.size
        return f"{energy:,.0f}" if energy >= 100 else f"{energy:.1f}"

    @property
    def psnr(self) -> str:
        """Quality in dB, or "exact"."""
        return "exact" if self.exact else f"{self.result.psnr:.1f} dB"

    @property
    def exact(self) -> bool:
        """Whether the image has no more colors than requested."""
        return self.result.tessellation is None


def main() -> None:
    """Run the demo from the command line."""
    parser = argparse.ArgumentParser(description="Quantize the sample images to 4, 16, 64 and 256 colors.")
    parser.add_argument("out_dir", nargs="?", type=Path, default=Path("out"), help="folder to write to (default: out)")
    out = parser.parse_args().out_dir
    try:
        out.mkdir(parents=True, exist_ok=True)
        run(out)
    except OSError as error:
        sys.exit(f"demo: {error}")


def run(out: Path) -> None:
    """Write the images and the sheets to `out`, and print a table."""
    quantize(np.arange(9, dtype=np.uint8).reshape(3, 3), 2)  # load the library before the first timing
    print(COLUMNS.format(*HEADER))
    rows = []
    for name in PICTURES:
        image = read_image(FOLDER / name)
        outcomes = [quantized(image, k, out / f"{Path(name).stem}-{k}.png") for k in N_COLORS]
        print_rows(FOLDER / name, image, outcomes)
        rows.append([original_panel(Path(name).stem, image)])
        rows[-1] += [panel(k, outcome) for k, outcome in zip(N_COLORS, outcomes, strict=True)]
    sheet = out / "sheet.png"
    sheet.write_bytes(draw_sheet(rows, ".png"))
    print(
        "\nenergy: squared error per pixel, summed over the channels; ms: time to quantize, without reading and writing"
    )
    print(f"{len(PICTURES) * len(N_COLORS)} images are in {out}; {sheet} shows them side by side")
    uses = out / "uses.png"
    uses.write_bytes(draw_sheet([segmented("coffee.png"), restored(), art()], ".png"))
    print(f"{uses} shows segments, superpixels, a restored image, stipples and mosaics")


def segmented(name: str) -> list[Panel]:
    """Show an image, its elbow palette, its segments with their edges, and superpixels."""
    image = read_image(FOLDER / name)
    few = quantize(image, "auto")
    segments = segment(image, 6, space="lab", components=True, min_size=100)
    cells = superpixels(image, 400)
    return [
        (image, Path(name).stem),
        (few.image, f"{len(few.palette)} colors, from the elbow"),
        (draw_edges(image, segments.labels), f"{segments.labels.max()} regions in 6 colors"),
        (draw_edges(image, cells.labels), f"{cells.labels.max()} superpixels"),
    ]


def restored() -> list[Panel]:
    """Show three damaged versions of a drawing, and the restored image."""
    versions = [read_image(FOLDER / f"drawing_{number}.png") for number in (1, 2, 3)]
    result = restore(versions, 6)
    shown = [(version, "noise, holes and a gap") for version in versions]
    return [*shown, (result.image, "restored")]


def art() -> list[Panel]:
    """Show a portrait in dots, a photograph in dots of four inks, and mosaics of it."""
    portrait, cup = read_image(FOLDER / "astronaut.png"), read_image(FOLDER / "coffee.png")
    dots = stipple(portrait, 8000)
    inks = stipple(cup, 20000, dots="sized", layers="cmyk")
    return [
        (dots.draw(scale=2), f"{len(dots):,} dots"),
        (inks.draw(scale=2), f"{len(inks):,} dots in four inks"),
        *((mosaic(cup, 800, shape=shape).draw(), f"a mosaic of 800 {shape}") for shape in ("cells", "triangles")),
    ]


def quantized(image: NDArray[Any], n_colors: int, path: Path) -> Outcome:
    """Quantize an image and write it."""
    start = perf_counter()
    result = quantize(image, n_colors)
    milliseconds = 1000 * (perf_counter() - start)
    palette = result.palette
    if palette.shape[1] == 1:
        palette = np.repeat(palette, 3, axis=1)
    write_image(path, result.indices, palette=palette, overwrite=True)
    return Outcome(result, milliseconds, path.stat().st_size)


def print_rows(source: Path, image: NDArray[Any], outcomes: list[Outcome]) -> None:
    """Print one line per number of colors; the first also has the figures of the image."""
    height, width = image.shape[:2]
    kilobytes = f"{source.stat().st_size / 1024:.0f}"
    shared = (source.stem, f"{width}x{height}", f"{outcomes[0].result.n_distinct:,}", kilobytes)
    for k, outcome in zip(N_COLORS, outcomes, strict=True):
        figures = (k, outcome.energy, outcome.psnr, f"{outcome.milliseconds:.1f}", f"{outcome.n_bytes / 1024:.0f}")
        print(COLUMNS.format(*shared, *figures))
        shared = ("", "", "", "")


def original_panel(name: str, image: NDArray[Any]) -> Panel:
    """Show an original image."""
    height, width = image.shape[:2]
    n_colors = color_samples(image).n_colors
    return image, f"{name.replace('_', ' ')}\noriginal, {width} x {height}, {n_colors:,} colors"


def panel(n_colors: int, outcome: Outcome) -> Panel:
    """Show a quantized image."""
    result = outcome.result
    figures = f"energy {outcome.energy} per pixel, {outcome.psnr}"
    if outcome.exact:
        figures = f"exact: the image has {result.n_distinct} colors"
    return result.image, f"{n_colors} colors\n{figures}"


if __name__ == "__main__":
    main()
