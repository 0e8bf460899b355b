"""Options that several verbs share, each declared once, and the groups of them that verbs take together."""

import re
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, get_args

from cvtimg._shared.choices import EffortName, InitName, MethodName, SpaceName
from cvtimg.options.record import Choice, File, Option, Real, Switch, Text, Whole, late, passed

PALETTE_NAMES = ".gpl, .json, .hex, .act, .ase, .css, .scss, .svg, .pal, .txt or .png"


def color(text: str) -> str:
    """Check a color in the notation of CSS, and return its eight hexadecimal digits, alpha included."""
    from PIL import ImageColor

    for notation in (text, f"#{text}"):
        with suppress(ValueError):
            return bytes((*ImageColor.getrgb(notation), 255)[:4]).hex()
    raise ValueError(f"{text!r} must be a color such as '#rgb', '#rrggbb' or '#rrggbbaa', or a name such as 'white'")


def color_or_file(text: str | Path) -> str | Path:
    """Check that an argument is a color or an existing file."""
    try:
        return color(str(text))
    except ValueError as error:
        if Path(text).is_file():
            return Path(text)
        raise ValueError(f"{error!s}, or a palette file") from None


def alpha_threshold(text: str | float) -> float | str:
    """Parse percent of alpha as a share, or "dither"."""
    if text == "dither":
        return "dither"
    try:
        if 0 <= (percent := float(str(text).removesuffix("%"))) <= 100:
            return percent / 100
    except ValueError:
        pass
    raise ValueError(f"{str(text)!r} must be percent in 0..100, or 'dither'")


def n_bytes(text: str | int) -> int:
    """Parse a size such as 60000, 60K (1024 bytes each), 60kB (1000 bytes each) or 1.5M."""
    match = re.fullmatch(r"(\d+(?:\.\d*)?)([kKMG]?)(B?)", str(text).strip())
    if match:
        unit = (1000 if match[3] else 1024) ** " KMG".index(match[2].upper() or " ")
        if 1 <= (size := int(float(match[1]) * unit)) < 1 << 62:
            return size
    raise ValueError(f"{str(text)!r} must be a number of bytes >= 1, such as 60000, 60kB or 1.5M")


def quality(text: str | float | Sequence[float]) -> float | tuple[float, float]:
    """Parse a quality such as 80, or a range such as 60-80, 60- for 60-100 or -80 for 0-80."""
    parts: list[Any] = str(text).split("-") if isinstance(text, str | float | int) else list(text)
    if len(parts) == 2 and parts != ["", ""]:
        parts = [parts[0] or 0, parts[1] or 100]
    with suppress(ValueError):
        ends = [float(part) for part in parts]
        if len(ends) in (1, 2) and 0 <= ends[0] <= ends[-1] <= 100:
            return (ends[0], ends[1]) if len(ends) == 2 else ends[0]
    raise ValueError(f"{str(text)!r} must be a number in 0..100, or a range such as 60-80")


def color_bits(text: str | Sequence[int]) -> tuple[int, ...]:
    """Parse bits per channel: 5 for all, or 5,6,5."""
    bits = [int(part) if part in map(str, range(1, 9)) else 0 for part in str(text).split(",")]
    if len(bits) in (1, 3) and all(bits):
        return tuple(bits * 3)[:3]
    raise ValueError(f"{str(text)!r} must be a number of bits in 1..8, or three such as 5,6,5")


def _tints(text: str) -> tuple[str, ...]:
    from cvtimg.pictures.showing import tint

    tints = () if text == "auto" else names(text)
    for name in tints:
        tint(name)
    return tints


def names(text: str) -> tuple[str, ...]:
    """Parse names with commas between them."""
    return tuple(filter(None, (part.strip() for part in text.split(","))))


# What files may end in, known to modules that import NumPy: images, those that keep all values, palettes, meshes.
pictures = late("pictures.files", "image_suffixes")
lossless = late("pictures.files", "lossless_suffixes")
palettes = late("palettes.files", "PALETTE_FORMATS.keys")
meshes = late("meshes.files", "suffixes")
PLOTS = (".png", ".svg")

# Kinds of options


def text(name: str, help: str, metavar: str, **more: Any) -> Option:
    """Return an option that takes a text as it is."""
    return Option(name, Text(), help, metavar=metavar, **more)


def choice(name: str, names: Collection[str], help: str, labels: Mapping[str, str] = {}, **more: Any) -> Option:
    """Return an option that is one of a few names, by default the first."""
    return Option(name, Choice(names, labels), help, default=next(iter(names)), **more)


# Inputs and outputs


def inputs(help: str, metavar: str, *, name: str = "inputs", required: bool = True) -> Option:
    """Return the option of what comes without a flag."""
    return text(name, help, metavar, flags="", required=required, many=True)


IMAGES = inputs(
    "Images, URLs, folders, patterns like 'a/*.tif', - for standard input, or @FILE for a list of names (@- for one on "
    "standard input).",
    "INPUT...",
)


def output(help: str, suffixes: Any = (), *, standard: str = "", required: bool = False) -> Option:
    """Return the option of the main output."""
    excludes = ("out_dir", "ext", "in_place")  # where a verb has them
    kind = File(suffixes, standard)
    return Option("output", kind, help, "--output -o", role="writes", required=required, excludes=excludes)


def out_dir(help: str) -> Option:
    """Return the option of the folder for outputs."""
    return Option("out_dir", File(), help, metavar="DIR", excludes=("in_place",))


def file(name: str, help: str, suffixes: Any = (), *, role: str = "writes", **more: Any) -> Option:
    """Return an option that names a file to write."""
    return Option(name, File(suffixes), help, role=role, **more)


def read(name: str, help: str, suffixes: Any = (), **more: Any) -> Option:
    """Return an option that names a file to read beside the inputs."""
    return file(name, help, suffixes, role="reads", **more)


def switch(name: str, help: str, **more: Any) -> Option:
    """Return an option that is on or off."""
    return Option(name, Switch(), help, default=False, **more)


OUT_DIR = out_dir("Folder for outputs, which keep the names and subfolders of the inputs.")
IMAGE_OUTPUT = "Output file, for one input; - for standard output, in PNG or in another format as webp:-."
#: Of every verb that reads images: how large they may be, and what is read of their files.
READING = (
    Option("max_pixels", Whole(1, 1 << 62), "Refuse larger images, for safety; 178956970 by default."),
    Option("page", Whole(1), "Read only page N of files of several pages."),
    Option("series", Whole(1), "Read only image N of a TIFF of several images, such as the series of OME."),
    Option(
        "channel_axis", Whole(0, 2), "Axis of the bands in .npy arrays: 0 for (bands, height, width).", metavar="AXIS"
    ),
    text("axes", "Axes of a stack, where its file does not name them: letters of T, C, Z, Y, X.", "TCZYX"),
    text("channel", "Read only this channel, by its name or number.", "NAME|N"),
    Option(
        "composite",
        Text(_tints),
        "Read all channels as one image in these colors, each stretched to its range, such as green,magenta; auto for "
        "usual ones.",
        metavar="COLOR,...|auto",
        excludes=("channel",),
    ),
    Option("t", Whole(1), "Read only this frame of a time series."),
    Option("z", Whole(1), "Read only this plane of a stack."),
    Option(
        "pixel_size",
        Text(late("pictures.formats.pixel_size", "PixelSize.parse")),
        "Size of a pixel in place of what the file says, such as 0.325um, or 0.3x0.3x2um with the distance of planes.",
        metavar="SIZE",
    ),
)
MASK = read("mask", "Image of the same size (one, or one per page or frame): leave out black pixels.")
NODATA = Option(
    "nodata",
    Real(),
    "Ignore pixels with the value V in every band; by default the nodata value of a GeoTIFF.",
    metavar="V",
)
MISSING = choice("missing", ("error", "drop"), "What to do with rows of tables that lack a value.")
PALETTE_OUTPUT = file("save_palette", f"Write the palette, {PALETTE_NAMES}; for one input.", palettes)

# The method

EFFORT = passed(
    "effort",
    Choice(get_args(EffortName)),
    "How long to search: fast takes about half as long as balanced, best several times.",
    default="balanced",
).on_page("Effort")
SPACE = passed(
    "space",
    Choice(get_args(SpaceName), {"rgb": "sRGB", "oklab": "Oklab", "lab": "CIE Lab", "linear": "linear light"}),
    "Color space in which distances are measured.",
    default="rgb",
).on_page("Color space")
SEED = Option("seed", Whole(0, 2**63 - 1), "Seed of the random number generator.", default=0, keyword="rng")
VOLUME_POWER = passed(
    "volume_power",
    Real(0),
    "Weight cells by their size to this power (0: all cells count the same).",
    metavar="P",
    default=0,
)
AVERAGING = passed(
    "averaging",
    Real(0, 1000),
    "Average the image first by a Gaussian of this standard deviation, against noise and fine texture.",
    metavar="PIXELS",
    default=0,
).on_page("Averaging", slider=(0, 20), unit="px")
#: How generators are found: options of `cvtimg.tessellate`.
ENGINE = (
    EFFORT,
    VOLUME_POWER,
    SEED,
    passed(
        "method", Choice(get_args(MethodName)), "Algorithm that moves the generators; by default the one that suits."
    ),
    passed("init", Choice(get_args(InitName)), "How initial generators are chosen.", default="split"),
)

# The run

#: Of every verb: whether to replace files, and what to print.
RUN = (
    switch("overwrite", "Replace existing outputs; inputs are replaced only by commands with --in-place."),
    switch("as_json", "Print one JSON object per line and input, not a table.", flags="--json", excludes=("quiet",)),
    switch("quiet", "Print nothing but errors.", flags="--quiet -q"),
    file("report", "Write a row for each input, .csv or .jsonl, as it is done.", (".csv", ".jsonl"), role=""),
    switch("dry_run", "Print which files would be written, INPUT -> OUTPUT, and do nothing.", excludes=("quiet",)),
)
#: Of verbs that process each input separately; the first is of those that write files.
BATCH = (
    switch("skip_existing", "Skip inputs whose outputs all exist, to resume a run that was stopped."),
    *RUN,
    Option(
        "jobs",
        Whole(1, 1024),
        "Number of inputs processed at the same time, each by a core; by default one per core where that is faster.",
        "--jobs -j",
    ),
    text("dask", "Run on a Dask cluster: tcp://HOST:PORT, or local to start one on this machine.", "ADDRESS"),
)

#: Of ``cvtimg explore``.
EXPLORE = (
    inputs("Images to open: files, folders or patterns; more can be dropped.", "[IMAGE...]", required=False),
    Option("port", Whole(0, 65535), "Port of the server; 0 for any that is free.", default=0),
    switch("no_browser", "Print the address of the page without opening it."),
    switch("no_store", "Keep nothing: a reload begins anew, and settings are not saved by name."),
)
