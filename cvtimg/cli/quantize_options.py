"""Options that only ``cvtimg quantize`` has, and the values given to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Option

from cvtimg._shared.choices import DitherName
from cvtimg.cli import options

if TYPE_CHECKING:
    import numpy as np

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


@dataclass(frozen=True, slots=True)
class QuantizeOptions:
    """What is done to each image.

    Attributes
    ----------
    mapping : dict
        How pixels are mapped to a palette: options of `map_to_palette`.
    search : dict
        How a palette is found: options of `find_palette`; none where it is given.
    target : dict
        Options of `quantize` that neither is: a PSNR to reach, weights of the pixels.
    colors : dict
        Arguments that are 8-bit colors, to be converted to the depth of the image: "palette" or "locked".
    depth : {"8", "16"} or None
        Bits per channel to work with.
    max_bytes : int or None
        Largest size of the file.
    keep_metadata, optimize, per_frame, mask, nodata
        As the options of these names.
    """

    mapping: Mapping[str, Any]
    search: Mapping[str, Any]
    target: Mapping[str, Any]
    colors: Mapping[str, Any]
    depth: str | None
    max_bytes: int | None
    keep_metadata: bool
    optimize: bool
    per_frame: bool
    mask: Path | None
    nodata: float | None

    @property
    def of_palette(self) -> dict[str, Any]:
        """Options for a palette alone, without the pixels."""
        return {**self.search, "space": self.mapping["space"]}

    def colors_of(self, dtype: np.dtype[Any]) -> dict[str, Any]:
        """Convert given colors to the depth of an image."""
        from cvtimg.colors.spaces import to_depth

        return {name: to_depth(colors, dtype) for name, colors in self.colors.items()}

    def unfit(self, *names: str) -> dict[str, Any]:
        """Return those of the named options that are given; some inputs cannot have them."""
        known = {
            "--psnr": self.target.get("psnr"),
            "--weight-map": self.target.get("weights"),
            "--max-bytes": self.max_bytes,
            "-k auto": True if self.search.get("n_colors") == "auto" else None,
            "--dither": self.mapping.get("dither"),
            "--depth": self.depth,
            "--depth 16": True if self.depth == "16" else None,
            "--keep-metadata": self.keep_metadata or None,
            "--optimize": self.optimize or None,
            "--mask": self.mask,
            "--nodata": self.nodata,
        }
        return {name: known[name] for name in names if known[name] is not None}
