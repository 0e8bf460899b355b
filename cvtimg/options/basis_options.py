"""Options of ``cvtimg basis``: of all frames of an animation together."""

from __future__ import annotations

from cvtimg._shared.budgets import MAX_COLORS
from cvtimg.options import common
from cvtimg.options.common import file, switch
from cvtimg.options.record import Choice, Option, Real, Text, Whole, late, passed


def _modes(text: str) -> int | float | str:
    """Return a number of modes, or a share of the variance in 0..1."""
    kind = Real(above=0, high=0.999999) if "." in text else Whole(1, MAX_COLORS, auto=True)
    try:
        return kind.parse(text)
    except ValueError as error:
        raise ValueError(
            f"{text!r} must be auto, a whole number in 1..65536, or a share in 0..1 such as 0.99"
        ) from error


BASIS = (
    common.IMAGES._replace(
        help="An animation (GIF, APNG, WebP), images, a folder of them, or an array, .npy or .zarr."
    ),
    Option(
        "number",
        Text(_modes),
        "Number of modes, of each cell for cvod; auto picks it at the elbow of the energy; a share such as 0.99 "
        "takes as few as explain it of the variance.",
        "--modes -n",
        metavar="N|SHARE|auto",
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
    passed("n_cells", Whole(1, MAX_COLORS), "Number of cells of --kind cvod.", "--cells", metavar="C", default=8),
    switch("uncentered", "Describe the snapshots themselves, not their differences from the mean, with --kind pod."),
    file(
        "weights",
        "Weight of each snapshot, with --kind pod: a number in each row.",
        (".csv", ".npy"),
        role="reads",
        keyword="weights",
        to=late("tables.files", "read_weights"),
    ),
    file("sheet", "Draw the mean and the modes as images, .png or .svg.", common.PLOTS),
    file("plot", "Plot what the modes leave unexplained, .png or .svg.", common.PLOTS),
    common.SEED,
    *common.READING,
    *common.RUN,
)
