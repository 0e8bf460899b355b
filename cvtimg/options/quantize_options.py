"""Options of ``cvtimg quantize``, ``cvtimg palette`` and ``cvtimg info``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, get_args

from cvtimg._shared.budgets import MAX_COLORS
from cvtimg._shared.choices import DitherName, GoalName
from cvtimg.options import common
from cvtimg.options.common import choice, read, switch, text
from cvtimg.options.record import Choice, Option, Real, Text, Whole, late, passed

if TYPE_CHECKING:
    from cvtimg._shared.types import Array, Bytes

#: Colors of `cvtimg palette` for images that have more than it lists, and with --main.
DEFAULT_COLORS, MAIN_COLORS = 16, 6
#: Bits per channel that the page offers.
_MACHINES = {
    "any": "shows any color",
    "2": "6 bits: Master System, EGA",
    "3,3,2": "8 bits: MSX2",
    "3": "9 bits: Mega Drive, PC Engine",
    "4": "12 bits: Amiga, Game Gear",
    "5": "15 bits: SNES, Game Boy Color",
    "5,6,5": "16 bits: small displays",
    "6": "18 bits: VGA",
}


def _images() -> list[str]:
    return [*common.lossless(), ".zarr"]


def _unless_none(name: str) -> str | None:
    return None if name == "none" else name


def _rgb(color: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(color)[:3])


def locked_colors(colors: list[str | Path]) -> Bytes:
    """(L, 3) colors, or (L, 4) if some have transparency, each once."""
    import numpy as np

    from cvtimg import read_palette

    rgba: list[tuple[int, ...]] = []
    for color in colors:
        rows = [bytes.fromhex(color)] if isinstance(color, str) else read_palette(color).tolist()
        rgba += [(*row, 255)[:4] for row in rows]
    distinct = np.array(list(dict.fromkeys(rgba)), np.uint8)
    return distinct if (distinct[:, 3] < 255).any() else distinct[:, :3]


def _weights(path: Path) -> Array:
    """Read a gray image: one channel, or the same in all."""
    from cvtimg import read_image

    weights = read_image(path)
    if weights.ndim == 2:
        return weights
    if weights.shape[2] > 4 or (weights[..., :1] != weights[..., :3]).any():
        raise ValueError("must be a gray image")
    return weights[..., 0]


_LOCK = Option(
    "lock",
    Text(common.color_or_file),
    "Keep a color ('#fff', '#rrggbb', '#rrggbbaa', 'white') or those of a palette file in the palette; can be "
    "repeated.",
    metavar="COLOR|FILE",
    many=True,
    role="reads",
    keyword="locked",
    to=locked_colors,
)

QUANTIZE = (
    common.IMAGES,
    Option(
        "number",
        Whole(1, MAX_COLORS, auto=True),
        f"Number of colors, at most {MAX_COLORS}; auto picks it at the elbow of the energy.",
        "--colors -k",
        keyword="n_colors",
    ).on_page("Colors", slider=(2, 256), log=True, default=16),
    passed(
        "psnr",
        Real(0),
        "Use as few colors as reach this quality, in decibels.",
        metavar="DB",
        excludes=("number=auto", "max_bytes"),
    ).on_page("Quality at least", slider=(20, 50), unit="dB", default=35.0),
    passed(
        "goal",
        Choice(get_args(GoalName)),
        "What the result is for: error, the least squared error, or eyes, a small file that looks the same; by default "
        "eyes for pictures, and error for measurements, if nothing else says what is wanted.",
        metavar="NAME",
        excludes=("number=auto", "psnr"),
    ),
    passed(
        "quality",
        Text(common.quality),
        "Write the smallest file that looks this good, 0 to 100 by SSIMULACRA2: 80 is hard to tell from the image, 70 "
        "is good. If the colors do not reach it, write the best; of a range such as 60-80, nothing below 60.",
        metavar="Q",
        excludes=("number=auto", "psnr"),
    ).on_page("Lossy files look", "80 is hard to tell from the image, 70 is good.", low=0, high=100, default=80),
    passed(
        "max_bytes",
        Text(common.n_bytes),
        "Use as many colors, up to 256 or -k, as fit into a file of this size: 60000, 60kB (of 1000) or 60K (of 1024).",
        metavar="SIZE",
        excludes=("number=auto",),
    ).on_page("File at most", slider=(4, 4000), log=True, unit="kB", suffix="kB", low=1, high=10**6, default=100),
    common.SPACE.on_page("Color space", about="Where distances between colors are measured."),
    choice(
        "dither",
        ("none", *get_args(DitherName)),
        "Mix colors to show those between them: none, floyd-steinberg, edge-aware, blue-noise or bayer; "
        "or compact, for a small file.",
        metavar="NAME",
        to=_unless_none,
        keyword="dither",
    ).on_page("Dither"),
    passed("dither_strength", Real(0, 1), "Strength of dithering, 0 to 1.", metavar="S", needs=("dither",)).on_page(
        "Dither strength"
    ),
    read(
        "palette",
        "Use the colors of a palette file or of an image, a palette by name: cga, game-boy, nes, pico-8, web-safe; or "
        "colors as '#102030,#f0e0d0'; with -k, the best of them.",
        excludes=("number=auto", "psnr", "max_bytes", "lock", "weight_map"),
        keyword="palette",
        to=late("palettes.files", "read_palette"),
    ),
    switch(
        "ramp",
        "Map by lightness, so that all colors of the palette are used: for tones of one color, as those of game-boy.",
        needs=("palette",),
        excludes=("number", "space", "goal=eyes", "quality", "dither=compact", "shared_palette"),
        keyword="ramp",
    ).on_page("By lightness", "Use all colors, for tones of one color, as those of game-boy."),
    _LOCK,
    passed(
        "color_bits",
        Text(common.color_bits, _MACHINES),
        "Use only colors of hardware with this many bits per channel, such as 5, or 5,6,5 for red, green and blue.",
        metavar="N|R,G,B",
        excludes=("palette",),
    ).on_page("Hardware", default="any"),
    read("weight_map", "Gray image of the same size: the weight of each pixel.", keyword="weights", to=_weights),
    common.MASK._replace(keyword="mask"),
    common.NODATA._replace(keyword="nodata"),
    passed(
        "depth",
        Choice(("8", "16")),
        "Bits per channel to work and write with; by default those of the image, and 8 with --quality and --goal eyes.",
    ),
    passed(
        "alpha_threshold",
        Text(common.alpha_threshold),
        "For a .gif: pixels of less alpha become transparent, the others opaque, in percent, 50 by default; or dither, "
        "which takes some of them in a pattern.",
        metavar="PERCENT",
    ),
    passed(
        "matte",
        Text(common.color),
        "For a .gif: color behind half-transparent pixels that become opaque; by default they get their own color.",
        metavar="COLOR",
        to=_rgb,
    ),
    switch(
        "shared_palette",
        "Use one palette for all images together.",
        needs=("number",),
        excludes=("psnr", "max_bytes", "palette", "weight_map"),
    ),
    common.output(common.IMAGE_OUTPUT, _images, standard=".png"),
    common.OUT_DIR,
    text(
        "ext",
        "End of the names of outputs, such as -small.png or .webp; without --out-dir they go beside the inputs.",
        "END",
        excludes=("in_place",),
    ),
    switch(
        "in_place",
        "Replace each input by its output, in the same format, once that is complete; asks first if a folder is given.",
    ),
    switch(
        "yes", "Do not ask before --in-place replaces the images of a folder.", flags="--yes -y", needs=("in_place",)
    ),
    switch("preserve", "Give outputs the times of their inputs."),
    switch("skip_if_larger", "Write no output that is not smaller than its input."),
    common.PALETTE_OUTPUT._replace(excludes=("palette_per_frame",)),
    switch(
        "keep_metadata",
        "Keep the color profile, resolution, EXIF and georeference where still valid.",
        keyword="keep_metadata",
    ),
    switch("optimize", "Make PNG files smaller with oxipng; slower.", keyword="optimize"),
    switch("palette_per_frame", "Use a palette for each frame or page, not one for all.", keyword="per_frame").on_page(
        "Own palettes", "Each frame has its own. Colors that stand still may change."
    ),
    common.READING[0]._replace(keyword="max_pixels"),
    *common.READING[1:],
    *common.ENGINE,
    *common.BATCH,
)

PALETTE = (
    common.IMAGES,
    Option(
        "number",
        Whole(1, MAX_COLORS),
        f"Size of the palette; by default all colors of an image, or {DEFAULT_COLORS} if it has more than 256.",
        "--colors -k",
    ).on_page("Colors", slider=(2, 64), log=True, high=256, default=8),
    switch(
        "main",
        f"Find the few colors that stand out, {MAIN_COLORS} by default: small vivid parts count, and large areas "
        "do not dominate.",
        excludes=("space",),
    ),
    _LOCK._replace(needs=("number",)),
    choice(
        "sort",
        ("share", "lightness", "hue"),
        "Order of the colors: by share, the largest first, lightness, the darkest first, or hue, grays first.",
    ).on_page("Sort by"),
    common.SPACE.on_page("Color space", about="Where distances between colors are measured."),
    common.PALETTE_OUTPUT,
    *common.READING,
    *common.BATCH,
)

INFO = (
    common.IMAGES,
    switch(
        "noise", "Measure the noise in 8-bit levels, how its variance grows with the level, and how neighbors share it."
    ),
    *common.READING,
    *common.BATCH[1:],
)
