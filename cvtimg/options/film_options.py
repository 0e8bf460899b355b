"""Options of ``cvtimg basis``, ``cvtimg keyframes`` and ``cvtimg frames``: of all frames of an animation together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from cvtimg.options import common
from cvtimg.options.common import file
from cvtimg.options.record import Choice, File, Option, Real, Text, Whole, passed

FILM = replace(
    common.IMAGES,
    help="An animation (GIF, APNG, WebP), a short film, images, a folder of them, or an array, .npy or .zarr.",
)


def size(text: str) -> tuple[int, int]:
    """Parse a width and a height, such as 32x24."""
    numbers = str(text).lower().split("x")
    if len(numbers) == 2 and all(one.isdecimal() and 0 < int(one) < 1 << 31 for one in numbers):
        return int(numbers[0]), int(numbers[1])
    raise ValueError(f"{str(text)!r} must be a width and a height, such as 32x24")


def _animations() -> Sequence[str]:
    from cvtimg.pictures.formats.animated import FRAME_WRITERS

    return list(FRAME_WRITERS)


PASSES = passed(
    "passes", Whole(2, 64, even=True), "How often to read the input, an even number: more is more precise.", default=4
)

BASIS = (
    FILM,
    Option(
        "number",
        Whole(1, 1 << 16, auto=True),
        "Number of modes, of each cell for cvod; auto picks it at the elbow of the energy.",
        "--modes -n",
        required=True,
        keyword="n_modes",
    ),
    common.output("Write the basis, .npz.", (".npz",), required=True),
    passed(
        "kind",
        Choice(("pod", "cvt", "cvod")),
        "Principal components, generators of a tessellation, or principal components of each of its cells.",
        default="pod",
    ),
    passed("n_cells", Whole(1, 1 << 16), "Number of cells of --kind cvod.", "--cells", metavar="C", default=8),
    file("sheet", "Draw the mean and the modes as images.", common.lossless),
    file("plot", "Plot what the modes leave unexplained, .png or .svg.", common.PLOTS),
    PASSES,
    common.SEED,
    common.MAX_PIXELS,
    *common.RUN,
)

KEYFRAMES = (
    FILM,
    Option(
        "number",
        Whole(1, 1 << 16, auto=True),
        "Number of key frames; auto picks it at the elbow of the energy.",
        "--frames -n",
        required=True,
        keyword="n_frames",
    ),
    passed(
        "by",
        Choice(("looks", "scenes")),
        "What a key frame represents: frames that look alike, or a scene, frames that follow each other.",
        default="looks",
    ),
    Option("out_dir", File(), "Write the key frames as frame-INDEX.png into this folder.", metavar="DIR"),
    file("sheet", "Draw the key frames side by side.", common.lossless),
    PASSES,
    common.SEED,
    common.MAX_PIXELS,
    *common.RUN,
)

FRAMES = (
    replace(
        common.IMAGES,
        help="An animation (GIF, APNG, WebP), a sprite sheet with --cell or as its .json, or an image for each frame.",
    ),
    file("output", "Write an animation, .gif, .png (APNG) or .webp.", _animations, flags="--output -o"),
    Option("out_dir", File(), "Write each frame as frame-INDEX.png into this folder.", metavar="DIR"),
    file("sheet", "Write a sprite sheet: all frames in one image.", common.lossless),
    file(
        "data",
        "Write where the frames are in the sheet and how long they show, .json, as Aseprite does.",
        (".json",),
        needs=("sheet",),
    ),
    Option(
        "sheet_columns",
        Whole(1, 1 << 16),
        "Number of cells in a row of --sheet; by default as many as make it about square.",
        needs=("sheet",),
    ),
    Option("cell", Text(size), "Cut a sprite sheet into cells of this size, such as 32x24.", metavar="WxH"),
    Option(
        "margin",
        Whole(0, 1 << 16),
        "Transparent pixels around the sheet: of the input with --cell, else of --sheet.",
        default=0,
        needs=("cell", "sheet"),
    ),
    Option(
        "spacing",
        Whole(0, 1 << 16),
        "Transparent pixels between cells: of the input with --cell, else of --sheet.",
        default=0,
        needs=("cell", "sheet"),
    ),
    Option(
        "duration",
        Real(above=0),
        "How long each frame shows, in milliseconds; by default as in the input, or 100.",
        metavar="MS",
    ),
    common.MAX_PIXELS,
    *common.RUN,
)
