"""Options of ``cvtimg cluster``, ``elbow``, ``design`` and ``basis``: of samples that need not be pixels."""

from collections.abc import Sequence

from cvtimg._shared.budgets import MAX_COLORS
from cvtimg.options import common
from cvtimg.options.common import choice, file, read, switch, text
from cvtimg.options.record import Choice, Option, Real, Switch, Text, Whole, late, passed


def _labels() -> Sequence[str]:
    from cvtimg.tables.files import LABEL_SUFFIXES

    return LABEL_SUFFIXES


#: How tables are read.
_TABLE = (
    text(
        "columns",
        "Columns of tables to use; by default all of numbers but the weight and those that only number the rows.",
        "A,B,C",
    ),
    text("weight", "Column with the weight of each row.", "COLUMN"),
    switch("standardize", "Scale each column to mean 0 and variance 1."),
    common.MISSING,
    text("delimiter", "Letter between the values of a text table, or tab; by default as it seems.", "C"),
    Option("decimal", Choice((".", ",")), "Decimal sign of a text table; by default as it seems."),
    text("encoding", "Encoding of a text table, such as cp1252; by default as it seems.", "NAME"),
    Option(
        "header",
        Switch(),
        "The first row has the names of columns, or none; by default as it seems.",
        "--header/--no-header",
    ),
    text("missing_values", "More marks of missing values, such as '-999,unknown'.", "A,B,C"),
)

CLUSTER = (
    common.IMAGES._replace(
        help="Tables (.csv, .csv.gz and the like, .npy, .parquet, .feather, .xlsx, .zarr), URLs of them, folders, "
        "patterns like 'a/*.csv', - for standard input, or @FILE for a list of names.",
        metavar="TABLE...",
    ),
    Option(
        "number",
        Whole(1, auto=True),
        "Number of clusters; auto picks it at the elbow of the energy.",
        "--clusters -k",
        required=True,
        keyword="n_generators",
    ),
    common.output(
        "Write the table with its clusters, .csv, or labels, .npy or .parquet; for one table; - for standard output.",
        _labels,
        standard=".csv",
    ),
    common.out_dir("Folder for outputs NAME-clusters.csv."),
    switch("labels_only", "Write only the label of each row, not the columns of the table."),
    switch(
        "silhouette", "Also tell how far clusters are apart: the mean silhouette of up to 5,000 rows, from -1 to 1."
    ),
    file("generators", "Write the mean and the weight of each cluster, .csv; for one table.", (".csv",)),
    file("plot", "Plot the clusters on their first two principal axes, .png or .svg.", common.PLOTS),
    *_TABLE,
    *common.ENGINE,
    *common.BATCH,
)

ELBOW = (
    common.IMAGES._replace(help="Images, tables (as cvtimg cluster reads), folders or patterns like 'a/*.png'."),
    Option("k_max", Whole(1, 4096), "Largest number of generators to try.", default=64, keyword="n_max"),
    choice("rule", ("chord", "variance", "psnr"), "Rule that picks the number of generators."),
    Option(
        "target",
        Real(0),
        "Target of --rule variance (share explained, 0.95 by default) or psnr (decibels, 30 by default).",
        metavar="X",
        needs=("rule=variance", "rule=psnr"),
    ),
    common.SPACE,
    common.VOLUME_POWER,
    common.EFFORT._replace(
        help="fast: all numbers in one pass; balanced, best: also search each by itself.", default="fast"
    ),
    *_TABLE,
    file("csv", "Write all curves, one line for each k."),
    file("plot", "Plot all curves, .png or .svg.", common.PLOTS),
    common.SEED,
    *common.READING,
    *common.BATCH[1:],
)

#: Criteria of designs as the page names them.
_CRITERIA = {
    "cvt": "even cells",
    "maximin": "largest least distance",
    "projection": "distances in all projections",
    "discrepancy": "least discrepancy",
}
DESIGN = (
    Option("number", Whole(1, MAX_COLORS), "Number of new points.", "--points -n", required=True).on_page(
        "Points", slider=(4, 500), log=True, default=40
    ),
    Option("dimensions", Whole(1, 64), "Number of axes, each from 0 to 1.", "--dimensions -d", "D").on_page(
        "Axes", slider=(1, 8), default=3
    ),
    read(
        "bounds",
        "Axes: a .csv file with the columns name, low and high; also kind (continuous, log, integer or a step), levels "
        "(such as A|B|C, in place of low and high) and unit.",
        (".csv",),
    ),
    Option(
        "axis",
        Text(late("designs.factors", "Factor.parse")),
        "An axis in place of --bounds: a range, one of equal ratios, whole numbers or steps, or levels with | between "
        "them; once for each.",
        metavar="NAME,LOW,HIGH[,log|integer|STEP]|NAME,A|B|C",
        many=True,
    ),
    read("existing", "Points that exist, .csv or .npy: new points keep away from them.", (".csv", ".tsv", ".npy")),
    common.output("Write the points, .csv or .npy; by default print them.", (".csv", ".npy")),
    passed(
        "latin",
        Switch(),
        "Give each of N slices along each axis exactly one point, as far as there are no other conditions.",
        "--latin/--no-latin",
        default=True,
    ).on_page("Latin", about="Each of N slices along each axis has one point."),
    choice(
        "criterion",
        _CRITERIA,
        "Place Latin points for even cells, the largest smallest distance, distances in all projections, or the least "
        "discrepancy.",
        keyword="criterion",
    ).on_page("Criterion"),
    text(
        "feasible",
        "Where points may lie: a condition on the names of axes, or on x1, x2, ..., such as 'x1 + x2 < 1'.",
        "CONDITION",
    ),
    text("density", "Place points more densely where this is greater, such as 'exp(-x1)'.", "EXPRESSION"),
    switch("periodic", "Let opposite ends of each axis meet.", keyword="periodic").on_page("Periodic"),
    switch("measures", "Report the star discrepancy and the evenness of the Voronoi cells."),
    file("plot", "Plot the points in each pair of axes, .png or .svg.", common.PLOTS),
    Option("shuffle", common.SEED.kind, "Put runs in random order, with this seed.", metavar="SEED"),
    common.EFFORT,
    common.SEED,
    *common.RUN,
)


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
        help="An animation (GIF, APNG, WebP), pages of a TIFF, images, a folder of them, or an array, .npy or .zarr."
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
    choice(
        "kind",
        ("pod", "cvt", "cvod"),
        "Principal components, generators of a tessellation, or principal components of each of its cells.",
        keyword="kind",
    ),
    passed("n_cells", Whole(1, MAX_COLORS), "Number of cells of --kind cvod.", "--cells", metavar="C", default=8),
    switch("uncentered", "Describe the snapshots themselves, not their differences from the mean, with --kind pod."),
    read(
        "weights",
        "Weight of each snapshot, with --kind pod: a number in each row.",
        (".csv", ".npy"),
        keyword="weights",
        to=late("tables.files", "read_weights"),
    ),
    file("sheet", "Draw the mean and the modes as images, .png or .svg.", common.PLOTS),
    file("plot", "Plot what the modes leave unexplained, .png or .svg.", common.PLOTS),
    common.SEED,
    *common.READING,
    *common.RUN,
)
