"""Options of ``cvtimg segment`` that no other command has, and what they ask for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Option

from cvtimg.cli import options
from cvtimg.cli.segment_outputs import KIND_NAMES

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.segmentation.result import Segmentation

#: Options that do not need the whole image at a time.
_IN_TILES = ("space", "edge_weight", "edge_radius", "effort", "rng")

_PIXELS = options.whole_number(0, 2**31 - 1)
_AMOUNT = options.number(0)

Number = Annotated[
    Any,
    Option(
        "-k",
        metavar="N|auto",
        parser=options.or_auto(options.whole_number(1, options.MAX_COLORS)),
        help="Number of segments; auto picks it at the elbow of the energy. With --hierarchy: auto by default.",
    ),
]
Labels = Annotated[
    Path | None,
    Option(
        "--output",
        "-o",
        metavar="FILE",
        parser=options.output_file(".png"),
        help="Write the label of each pixel, .png, .tif, .npy or .zarr; for one input; - for standard output.",
    ),
]
OutDir = Annotated[Path | None, Option(metavar="DIR", help="Folder for outputs NAME-labels.png and so on.")]
Write = Annotated[
    str,
    Option(
        metavar="KIND,...",
        help=f"Outputs to write for each input, NAME-KIND: {KIND_NAMES}; or KIND.SUFFIX, such as contours.geojson.",
    ),
]
Mean = Annotated[Path | None, Option(metavar="FILE", help="Write the image with each segment in its mean color.")]
Edges = Annotated[Path | None, Option(metavar="FILE", help="Write the edges of the segments, white on black.")]
Overlay = Annotated[Path | None, Option(metavar="FILE", help="Write the image with the edges drawn over it.")]
ContourFile = Annotated[
    Path | None, Option("--contours", metavar="FILE", help="Write the borders as polygons, .svg or .geojson.")
]
Table = Annotated[
    Path | None, Option(metavar="FILE", help="Write the area, place and mean color of each segment, .csv.")
]
Coco = Annotated[Path | None, Option(metavar="FILE", help="Write the segments as COCO annotations, .json.")]
EdgeMode = Annotated[
    Literal["inner", "outer", "thick"],
    Option(help="Pixels that --edges marks: inside the brighter segment, outside it, or both."),
]
LineColor = Annotated[
    str, Option(metavar="#RRGGBB", parser=options.color, help="Color of the lines that --overlay draws.")
]
LineWidth = Annotated[
    int,
    Option(metavar="PIXELS", parser=options.whole_number(1, 1000), help="Width of the lines that --overlay draws."),
]
Subpixel = Annotated[bool, Option("--subpixel", help="Place --contours with subpixel accuracy.")]
Simplify = Annotated[
    float, Option(metavar="PIXELS", parser=_AMOUNT, help="Simplify --contours, at most this far off the border.")
]
Kernel = Annotated[Literal["gaussian", "box"], Option(help="Kernel of --averaging.")]
Radius = Annotated[float, Option(metavar="PIXELS", parser=_AMOUNT, help="Radius of --averaging.")]
EdgeWeight = Annotated[
    Any,
    Option(
        metavar="L|auto",
        parser=options.or_auto(_AMOUNT),
        help="Penalty for each pair of nearby pixels in different segments; auto follows the noise.",
    ),
]
EdgeRadius = Annotated[
    int,
    Option(metavar="PIXELS", parser=options.whole_number(1, 30), help="Radius of the neighborhood of --edge-weight."),
]
Components = Annotated[bool, Option("--components", help="Make each connected component a segment of its own.")]
MinSize = Annotated[
    int, Option(metavar="PIXELS", parser=_PIXELS, help="Merge components smaller than this into a neighbor.")
]
BorderPrice = Annotated[
    float,
    Option(
        metavar="P",
        parser=_AMOUNT,
        help="With --components: merge neighbors where that costs less per pixel of border.",
    ),
]
Objects = Annotated[
    bool,
    Option("--objects", help="Make each object before the background a segment; split touching ones."),
]
Background = Annotated[
    Literal["largest", "darkest", "brightest"], Option(help="Segment that is the background of --objects; label 0.")
]
NeckDepth = Annotated[
    float,
    Option(metavar="PIXELS", parser=_AMOUNT, help="With --objects: split at necks narrower by this in radius."),
]
ObjectBorder = Annotated[
    Literal["segment", "own"],
    Option(help="With --objects: end them where segments end, or halfway in value between each and the background."),
]
Properties = Annotated[
    str,
    Option(metavar="NAME,...", help="More columns for --table, by their names in scikit-image, such as eccentricity."),
]
Volume = Annotated[
    bool, Option("--volume", help="Use the same segments in all pages of a file, not in each page its own.")
]
Hierarchy = Annotated[
    bool, Option("--hierarchy", help="Divide into connected regions, as people see them; -k is optional.")
]
Threshold = Annotated[
    float | None,
    Option(metavar="T", parser=_AMOUNT, help="With --hierarchy, not -k N: keep regions apart that differ by more."),
]
Tree = Annotated[Path | None, Option(metavar="FILE", help="With --hierarchy: write the tree of regions, .npz.")]
Strengths = Annotated[
    Path | None, Option(metavar="FILE", help="With --hierarchy: write the strength of each border, .png, .tif or .npy.")
]
Cuts = Annotated[
    Path | None, Option(metavar="FILE", help="With --hierarchy: write a sheet of cuts into 5, 10, 20 and 50 regions.")
]
Superpixels = Annotated[
    bool, Option("--superpixels", help="Divide into about N connected superpixels of similar size.")
]
Compactness = Annotated[
    float | None, Option(metavar="C", parser=_AMOUNT, help="Compactness of --superpixels; larger values: rounder.")
]


@dataclass(frozen=True, slots=True)
class SegmentOptions:
    """What is done to each image: a number of segments, and options of `segment` or of `superpixels`."""

    number: int | str
    keywords: Mapping[str, Any]
    superpixels: bool
    mask: Path | None
    nodata: float | None
    volume: bool
    hierarchy: bool = False
    threshold: float | None = None

    def segments(self, image: NDArray[Any], known: NDArray[np.bool_]) -> Segmentation:
        """Divide an image."""
        import cvtimg

        if self.hierarchy:
            from cvtimg.cli.hierarchies import cut_regions

            return cut_regions(image, known, self.number, self.threshold, self.keywords)
        divide: Any = cvtimg.superpixels if self.superpixels else cvtimg.segment
        result: Segmentation = divide(image, self.number, mask=known, **self.keywords)
        return result

    @property
    def in_tiles(self) -> dict[str, Any]:
        """Options that do not need the whole image."""
        return {name: self.keywords[name] for name in _IN_TILES}

    @property
    def unfit(self) -> dict[str, Any]:
        """Given options that need the whole image, by their names on the command line."""
        given = {
            "--superpixels": self.superpixels,
            "--hierarchy": self.hierarchy,
            "-k auto": self.number == "auto",
        }
        given |= {
            f"--{name.replace('_', '-')}": value for name, value in self.keywords.items() if name not in _IN_TILES
        }
        return {name: value for name, value in given.items() if value}
