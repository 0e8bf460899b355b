"""Options of ``cvtimg stipple`` and ``cvtimg mosaic``."""

from cvtimg._shared.budgets import MAX_COLORS
from cvtimg.options import common
from cvtimg.options.common import choice, file, switch
from cvtimg.options.record import Choice, Option, Pair, Real, Text, Whole, late, passed

_PAPERS = ("a2", "a3", "a4", "a5", "a6", "letter", "legal", "tabloid")
_PER_MM = {"mm": 1.0, "cm": 10.0, "in": 25.4, "": 1.0}


def _length(text: str | float) -> float:
    plain = str(text).strip()
    unit = next(unit for unit in _PER_MM if plain.endswith(unit))
    try:
        return float(Real(above=0).parse(plain.removesuffix(unit)) * _PER_MM[unit])
    except ValueError as error:
        raise ValueError(f"{plain!r} must be a length > 0 such as 200mm, 20cm or 8in") from error


def _paper(text: str) -> str | tuple[float, float]:
    """Read a sheet of paper: its name, or its width and height such as 300x200mm."""
    plain = str(text).strip().lower()
    width, cross, height = plain.partition("x")
    if not (cross and height):
        return str(Choice(_PAPERS).parse(plain))
    unit = next(unit for unit in _PER_MM if height.endswith(unit))
    return _length(width if unit and width.endswith(unit) else width + unit), _length(height)


def _margin(text: str | float) -> float:
    return 0.0 if str(text).strip().rstrip("cimn") in ("0", "0.0") else _length(text)


def _pens(text: str) -> tuple[str, ...]:
    return tuple(f"#{common.color(pen)[:6]}" for pen in common.names(text))


STIPPLE = (
    common.IMAGES,
    Option(
        "number",
        Whole(1),
        "Number of dots; by default 20000, or a quarter of the pixels of small images.",
        "--dot-count -n",
    ).on_page("Dots", slider=(100, 100_000), log=True, high=10**6, default="auto"),
    Option(
        "pen",
        Text(_length),
        "Width of a pen, such as 0.4mm: sets the size of dots and, with --width, their number.",
        metavar="LENGTH",
        excludes=("number", "pen_width", "radius_range", "dots=sized"),
        keyword="dot_diameter",
    ).on_page("Pen", slider=(0.1, 2), unit="mm", default=0.4),
    common.output(common.IMAGE_OUTPUT, late("artwork.stipples", "suffixes"), standard=".png"),
    common.OUT_DIR,
    choice(
        "dots", {"equal": "one size", "sized": "by tone"}, "One size, or each as large as its ink.", keyword="dots"
    ).on_page("Sizes"),
    passed(
        "max_ink", Real(0, 1, above=0), "Share of the paper that black covers, up to 1.", metavar="F", default=0.9
    ).on_page("Ink in black", "Share of the paper that black covers.", slider=(0.01, 1)),
    passed("white_cutoff", Real(0, 1), "Leave tones of up to this coverage white.", metavar="F", default=0).on_page(
        "White up to"
    ),
    passed(
        "radius_range",
        Pair(Real(), Real()),
        "Least and greatest radius in pixels of the image, with --dots sized.",
        metavar="A B",
        needs=("dots=sized",),
    ).on_page("Least radius", slider=(0.1, 10), unit="px", default=0.5),
    passed(
        "layers",
        Choice(("cmyk",)),
        "Draw in color, with a layer for each of the pens cyan, magenta, yellow and black.",
        excludes=("invert", "pens"),
    ).on_page("Pens", default="one", choices={"one": "one", "cmyk": "CMYK"}),
    passed(
        "pens",
        Text(_pens),
        "Draw with pens of these colors, such as '#000,#e4002b,navy', a layer for each.",
        metavar="COLOR,...",
        excludes=("invert",),
    ).on_page("Colors of pens", default="#000,#e4002b,#0057b8"),
    choice(
        "tones",
        {"light": "light drawing", "true": "as bright as the image"},
        "light: tones follow lightness, with less ink where there is much; true: as bright as the image from afar.",
        keyword="tones",
    ).on_page("Tones"),
    switch("invert", "Draw light dots on dark paper.", keyword="invert").on_page("Light on dark"),
    switch("bleed", "Let the frame of the picture cut dots; by default they are whole.", keyword="bleed").on_page(
        "Dots cut by the frame"
    ),
    Option(
        "width",
        Text(_length),
        "Greatest width of the drawing, such as 200mm, the default without --paper, 20cm or 8in; for .svg, .png.",
        metavar="LENGTH",
    ).on_page("Drawing width", slider=(50, 1000), unit="mm", default=200.0),
    Option("height", Text(_length), "Greatest height of the drawing.", metavar="LENGTH").on_page(
        "Drawing height", slider=(50, 1000), unit="mm", default="auto"
    ),
    Option(
        "paper",
        Text(_paper, {"none": "as large as the drawing", "a5": "A5", "a4": "A4", "a3": "A3", "letter": "Letter"}),
        "Fit the drawing to the middle of a sheet: a2 to a6, letter, legal, tabloid, or a size such as 300x200mm.",
        metavar="SHEET",
    ).on_page("Paper", default="none"),
    switch("landscape", "Turn the sheet of --paper so that it is wide.", needs=("paper",)).on_page("Landscape"),
    Option(
        "margin", Text(_margin), "Margin around the drawing; by default 10mm on --paper, else 0.", metavar="LENGTH"
    ).on_page("Margin", slider=(0, 50), unit="mm", default="auto"),
    choice(
        "marks",
        ("disks", "circles", "points", "line"),
        "What a dot is in .svg: a disk, its outline, a tiny loop that a pen dots, or a place on one line through all.",
        labels={"disks": "filled disks", "line": "one line"},
    ).on_page("Marks"),
    choice("fill", ("solid", "spiral"), "Fill disks with color, or with a spiral of the pen's line.").on_page("Fill"),
    Option(
        "pen_width", Text(_length), "Width of the pen's line in .svg; by default what suits the dots.", metavar="MM"
    ).on_page("Pen width", slider=(0.05, 2), unit="mm", default="auto"),
    file("cells", "Write the cell of each dot, .svg or .geojson; for one input.", (".svg", ".geojson")),
    *common.READING,
    *common.BATCH,
)

MOSAIC = (
    common.IMAGES,
    Option("number", Whole(1), "Number of tiles.", "--tiles -n", required=True, keyword="n_cells").on_page(
        "Tiles", slider=(50, 20_000), log=True, high=10**6, default=1000
    ),
    common.output(common.IMAGE_OUTPUT, late("artwork.mosaics", "suffixes"), standard=".png"),
    common.OUT_DIR,
    choice(
        "shape",
        ("cells", "triangles"),
        "Voronoi cells, or triangles (low poly).",
        labels={"cells": "Voronoi cells"},
        keyword="shape",
    ).on_page("Shape"),
    passed("palette", Whole(1, MAX_COLORS), "Use only N colors.", "--colors -k").on_page(
        "Colors in all", slider=(2, 64), log=True, default=8
    ),
    common.SPACE,
    common.EFFORT,
    Option(
        "outline", Real(0), "Width of dark lines between tiles, in pixels; 0 for none.", metavar="W", default=0
    ).on_page("Outlines", slider=(0, 5), unit="px"),
    Option("scale", Real(above=0), "Enlarge .png and other images by this factor.", metavar="S", default=1),
    *common.READING,
    *common.BATCH,
)
