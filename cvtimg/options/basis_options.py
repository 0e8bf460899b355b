"""Options of ``cvtimg basis``: of all frames of an animation together."""

from __future__ import annotations

from cvtimg.options import common
from cvtimg.options.common import file
from cvtimg.options.record import Choice, Option, Whole, passed

BASIS = (
    common.IMAGES._replace(
        help="An animation (GIF, APNG, WebP), images, a folder of them, or an array, .npy or .zarr."
    ),
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
    passed(
        "passes",
        Whole(2, 64, even=True),
        "How often to read the input, an even number: more is more precise.",
        default=4,
    ),
    common.SEED,
    common.MAX_PIXELS,
    *common.RUN,
)
