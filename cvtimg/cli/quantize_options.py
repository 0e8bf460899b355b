"""Options that only ``cvtimg quantize`` has."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from typer import Option

from cvtimg._shared.choices import DitherName
from cvtimg.cli import options

Colors = Annotated[
    Any,
    Option(
        "--colors",
        "-k",
        metavar="N|auto",
        parser=options.or_auto(options.whole_number(1, options.MAX_COLORS)),
        help=f"Number of colors, at most {options.MAX_COLORS}; auto picks it at the elbow of the energy.",
    ),
]
Psnr = Annotated[
    float | None,
    Option(metavar="DB", parser=options.number(0), help="Use as few colors as reach this quality, in decibels."),
]
MaxBytes = Annotated[
    int | None,
    Option(
        metavar="SIZE",
        parser=options.n_bytes,
        help="Use as many colors, up to 256 or -k, as fit into a file of this size, such as 60000, 60K or 1.5M.",
    ),
]
PaletteFile = Annotated[
    Path | None, Option("--palette", metavar="FILE", help="Use the colors of a palette file or of an image.")
]
Lock = Annotated[
    list[Any] | None,
    Option(
        metavar="COLOR|FILE",
        parser=options.color_or_file,
        help="Keep a color ('#fff', '#rrggbb', '#rrggbbaa', 'white') or those of a palette file in the palette; can "
        "be repeated.",
    ),
]
Dither = Annotated[
    Literal["none", DitherName],
    Option(
        metavar="NAME",
        help="Mix colors to show those between them: none, floyd-steinberg, edge-aware, blue-noise, or bayer-2, -4, -8 "
        "or -16.",
    ),
]
DitherStrength = Annotated[
    float | None, Option(metavar="S", parser=options.number(0, 1), help="Strength of dithering, 0 to 1.")
]
WeightMap = Annotated[
    Path | None, Option(metavar="FILE", help="Gray image of the same size: the weight of each pixel.")
]
Depth = Annotated[
    Literal["8", "16"] | None, Option(help="Bits per channel to work and write with; by default those of the image.")
]
SharedPalette = Annotated[bool, Option("--shared-palette", help="Use one palette for all images together.")]
SavePalette = Annotated[
    Path | None, Option(metavar="FILE", help=f"Write the palette, {options.PALETTE_NAMES}; for one input.")
]
Ext = Annotated[
    str | None,
    Option(
        "--ext",
        metavar="END",
        help="End of the names of outputs, such as -small.png or .webp; without --out-dir they go beside the inputs.",
    ),
]
InPlace = Annotated[
    bool, Option("--in-place", help="Replace each input by its output, in the same format, once that is complete.")
]
SkipIfLarger = Annotated[bool, Option("--skip-if-larger", help="Write no output that is not smaller than its input.")]
KeepMetadata = Annotated[
    bool, Option("--keep-metadata", help="Keep the color profile, resolution, EXIF and georeference where still valid.")
]
Optimize = Annotated[bool, Option("--optimize", help="Make PNG files smaller with oxipng; slower.")]
PerFrame = Annotated[bool, Option("--palette-per-frame", help="Use a palette for each frame or page, not one for all.")]
