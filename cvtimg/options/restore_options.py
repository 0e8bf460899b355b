"""Options of ``cvtimg restore``."""

import math
from contextlib import suppress
from typing import get_args

from cvtimg._shared.budgets import MAX_COLORS
from cvtimg._shared.choices import AlignName, AutoEffortName, NoiseName
from cvtimg.options import common
from cvtimg.options.common import choice, file, switch
from cvtimg.options.record import Choice, File, Option, Real, Text, Whole, passed


def _weights(text: str) -> list[float]:
    with suppress(ValueError):
        weights = [float(word) for word in text.split(",")]
        if all(0 < weight < math.inf for weight in weights):
            return weights
    raise ValueError(f"{text!r} must be numbers > 0 with commas between them")


RESTORE = (
    common.inputs(
        "Versions of one image, of one size unless aligned: files, folders or patterns.", "VERSION...", name="versions"
    ),
    common.output(
        "Write the restored image, stack or animation; - for standard output. By default VERSION-restored.png.",
        common.pictures,
        standard=".png",
    ),
    Option(
        "number",
        Whole(1, MAX_COLORS - 1, auto=True),  # more segments no file of labels holds
        "Number of segments; auto picks it by the energy.",
        "--segments -k",
        default="auto",
        keyword="n_generators",
        excludes=("detail",),
    ).on_page("Segments", slider=(2, 64), log=True),
    Option(
        "mask",
        File(),
        "Image that is black where a version is missing; once per version, in their order.",
        role="reads",
        many=True,
    ),
    Option(
        "merge",
        Choice(("T", "Z")),
        "Axis of a stack along which pages are versions of one image; others are restored page by page.",
    ),
    passed("nodata", Real(), "Treat pixels that are V in all bands as missing.", metavar="V").on_page(
        "Value", slider=(0, 255), step=0.5, low=-1e9, high=1e9, default=0.0
    ),
    switch("fill_transparent", "Fill also what is transparent in all versions alike, which stays so by default."),
    passed("weights", Text(_weights), "Weight of each version; by default from its noise.", metavar="W,W,.."),
    switch("align", "Move each version onto the first.").on_page("Align versions"),
    choice(
        "motion",
        ("auto", *get_args(AlignName)[1:]),
        "How versions moved; euclidean is rotation and translation, auto the simplest that fits.",
        labels={"auto": "the simplest that fits", "euclidean": "rotation, translation"},
        needs=("align",),
    ).on_page("Motion"),
    switch(
        "channels",
        "Versions share segments but not colors, as channels do; the first is restored.",
        keyword="channels",
        excludes=("detail",),
    ).on_page("Versions are channels", "They share segments but not colors; the first is restored."),
    switch(
        "detail",
        "Restore texture too, patch by patch; the default for photographs unless -k or others ask for segments.",
    ).on_page("Detail", "Restore texture too, for photographs."),
    passed(
        "noise",
        Real(above=0),
        "Standard deviation of the noise, in levels of 8 bits; by default it is estimated.",
        metavar="S",
    ).on_page("Noise", "Standard deviation, in levels of 8 bits.", slider=(0.5, 60), default="auto"),
    passed(
        "noise_like",
        Choice(get_args(NoiseName), {"auto": "as it is found"}),
        "With --detail: noise that neighboring pixels share is recognized, or all noise is taken for white.",
        default="auto",
    ).on_page("Kind of noise"),
    passed(
        "luma",
        Real(0, 1),
        "With --detail: part of the noise of lightness that is taken away, 0 to 1; less keeps grain.",
        metavar="F",
        default=1.0,
    ).on_page("Luma", slider=(0, 1)),
    passed(
        "chroma",
        Real(0, 1),
        "With --detail: part of the noise of colors that is taken away, 0 to 1.",
        metavar="F",
        default=1.0,
    ).on_page("Chroma", slider=(0, 1)),
    choice(
        "hidden",
        {
            "outliers": "leave out outliers",
            "background": "leave out background",
            "motion": "leave out what moved",
            "none": "use all",
        },
        "Where versions disagree, leave out the outliers, the background, what moved since the first, or none.",
        keyword="hidden",
    ).on_page("Disagreement"),
    choice(
        "renormalize",
        {"range": "as in the versions", "median": "median of a segment", "none": "keep"},
        "How to undo the loss of contrast where some versions are painted over.",
        excludes=("detail",),
        keyword="renormalize",
    ).on_page("Contrast"),
    passed(
        "edge_weight",
        Real(0, auto=True),
        "Penalty for each pair of nearby pixels in different segments; auto follows the noise.",
        metavar="L|auto",
        default="auto",
        excludes=("detail",),
    ).on_page("Edge weight", slider=(0, 200)),
    common.SPACE._replace(
        help=f"{common.SPACE.help[:-1]}: linear for raw files of cameras, for others rgb.", default=None
    ).on_page("Color space", default="rgb"),
    common.EFFORT._replace(
        kind=Choice(get_args(AutoEffortName)),
        default="auto",
        help=f"{common.EFFORT.help[:-1]}; auto: with --detail, less for large images.",
    ),
    common.SEED._replace(help="With --detail: seed of the sample of patches that large images are learned from."),
    file(
        "labels",
        "Write the segment of each pixel, from 1: .png, .tif or .npy.",
        (".png", ".tif", ".tiff", ".npy"),
        excludes=("detail",),
    ),
    file("sheet", "Draw the versions and the restored image on one sheet, .png or .svg.", common.PLOTS),
    *common.READING,
    *common.RUN,
)
