"""Options of ``cvtimg segment`` that no other command has."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from typer import Option

from cvtimg.cli import options
from cvtimg.cli.segment_outputs import KIND_NAMES

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
        help="Penalty per pixel of border (>= 0); larger values give smoother segments; auto follows the noise.",
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
    Path | None, Option(metavar="FILE", help="With --hierarchy: write how strongly borders part, .png, .tif or .npy.")
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
