"""Options of ``cvtimg segment``."""

from importlib.util import find_spec

from cvtimg.labels.formats import CONTOUR_FORMATS
from cvtimg.options import common
from cvtimg.options.common import choice, file, switch
from cvtimg.options.record import Option, Real, Text, Whole, late, passed

_AVIF = (".avif",) if find_spec("PIL._avif") else ()
_PICTURES = (".png", ".tif", ".tiff", ".webp", ".jpg", ".jpeg", ".npy", *_AVIF)
#: Kinds of output and their suffixes, the default first.
KINDS = {
    "labels": (".png", ".tif", ".tiff", ".npy", ".zarr"),
    "mean": _PICTURES,
    "edges": (".png", ".tif", ".tiff", ".webp", ".npy"),
    "overlay": _PICTURES,
    "contours": tuple(CONTOUR_FORMATS),
    "table": (".csv", ".parquet"),
    "masks": (".png", ".tif", ".tiff"),
}
#: Kinds of output that need --hierarchy.
HIERARCHY_KINDS = {"tree": (".npz",), "strengths": (".png", ".tif", ".tiff", ".npy")}
#: Options of --contours as lines, with the chance that a person draws each.
OF_LINES = ("chance", "strongest")
#: Segments by color are neither regions nor superpixels; nor can these be those of a volume.
_OTHER_WAYS = ("superpixels", "hierarchy")
_BY_COLOR = (*_OTHER_WAYS, "volume")


def kind_of(option: str) -> str:
    """Return the kind of output that an option names: "--mean", "--write mean.png", or "-o" for labels."""
    return "labels" if option == "-o" else option.removeprefix("--").removeprefix("write ").partition(".")[0]


SEGMENT = (
    common.IMAGES,
    Option(
        "number",
        Whole(1, auto=True),
        "Number of segments; auto picks it at the elbow of the energy. Without it, regions as by --hierarchy.",
        "--segments -k",
    ).on_page("Segments", slider=(2, 64), log=True, default=4),
    common.output(
        "Write the label of each pixel, .png, .tif, .npy or .zarr; for one input; - for standard output.",
        KINDS["labels"],
        standard=".png",
    ),
    common.out_dir("Folder for outputs NAME-labels.png and so on."),
    Option(
        "write",
        Text(common.names),
        f"Outputs to write for each input, NAME-KIND: {', '.join(KINDS)}; or KIND.SUFFIX, such as contours.geojson.",
        metavar="KIND,...",
    ),
    file("mean", "Write the image with each segment in its mean color.", KINDS["mean"]),
    file("edges", "Write the edges of the segments, white on black.", KINDS["edges"]),
    file("overlay", "Write the image with the edges drawn over it.", KINDS["overlay"]),
    file(
        "contours",
        "Write the borders as polygons, .svg or .geojson, or as .zip for the ROI Manager of ImageJ and Fiji.",
        KINDS["contours"],
    ),
    file(
        "table", "Write the area, place and mean color of each segment of all inputs, .csv or .parquet.", KINDS["table"]
    ),
    file("masks", "Write labels as gray levels of 16 bits, as Cellpose does, .png or .tif.", KINDS["masks"]),
    choice(
        "edge_mode",
        ("inner", "outer", "thick"),
        "Pixels that --edges marks: inside the brighter segment, outside it, or both.",
    ),
    Option(
        "line_color",
        Text(common.color),
        "Color of the lines that --overlay draws.",
        metavar="#RRGGBB",
        default="#ffff00",
    ),
    Option("line_width", Whole(1), "Width of the lines that --overlay draws.", metavar="PIXELS", default=1),
    switch("subpixel", "Place --contours with subpixel accuracy."),
    Option("simplify", Real(0), "Simplify --contours, at most this far off the border.", metavar="PIXELS", default=0),
    common.SPACE._replace(
        help="Color space in which distances are measured; by default rgb, or lab for --hierarchy.", default=None
    ).on_page("Color space", default="rgb"),
    switch(
        "shading",
        "Take out uneven light first, such as the shade on a page of text.",
        excludes=_BY_COLOR,
        keyword="shading",
    ).on_page("even light"),
    common.AVERAGING._replace(excludes=_BY_COLOR),
    passed(
        "smallest_detail",
        Real(0, sized=True, auto=True),
        "Radius of the smallest detail that counts, in pixels or as 0.5um: edges cost enough that less vanishes; auto "
        "keeps what describes the image in fewer bits, and all above 1 pixel.",
        metavar="R|auto",
        default="auto",
        excludes=_OTHER_WAYS,
    ).on_page("Smallest detail", "Radius of the smallest detail that counts.", slider=(0, 10), unit="px"),
    passed(
        "edge_weight",
        Real(0, auto=True),
        "Penalty for each pair of nearby pixels in different segments; auto follows --smallest-detail and the noise.",
        metavar="L|auto",
        default="auto",
        excludes=_OTHER_WAYS,
    ).on_page(
        "Edge weight",
        "Penalty for each pair of nearby pixels in different segments. Auto follows the smallest detail and the noise.",
        slider=(0, 2000),
    ),
    passed(
        "edge_radius",
        Whole(1, 30),
        "Radius of the neighborhood of --edge-weight.",
        metavar="PIXELS",
        default=3,
        excludes=_OTHER_WAYS,
    ).on_page("Edge radius", slider=(1, 10), unit="px"),
    switch(
        "components", "Make each connected component a segment of its own.", excludes=_BY_COLOR, keyword="components"
    ).on_page("each a segment"),
    passed(
        "min_size",
        Whole(0),
        "Merge components smaller than this into a neighbor.",
        metavar="PIXELS",
        default=0,
        excludes=_BY_COLOR,
    ).on_page("Least size", "Merge smaller pieces into a neighbor.", slider=(0, 2000), unit="px²"),
    switch(
        "objects",
        "Make each object before the background a segment; split touching ones. Without -k, measure all it takes.",
        excludes=("components", *_OTHER_WAYS),
    ).on_page("objects, background"),
    choice(
        "background",
        {"largest": "largest segment", "darkest": "darkest segment", "brightest": "brightest segment"},
        "Segment that is the background of --objects; label 0.",
        needs=("objects",),
    ).on_page("Background"),
    Option(
        "neck_depth",
        Real(0),
        "With --objects: split at necks narrower by this in radius; without -k, by default, as noise allows.",
        metavar="PIXELS",
        default=0.5,
        needs=("objects",),
    ).on_page("Depth of necks", slider=(0, 10), unit="px"),
    switch(
        "no_split", "With --objects: do not split touching objects.", needs=("objects",), excludes=("neck_depth",)
    ).on_page("Keep touching ones whole"),
    Option(
        "diameter",
        Real(above=0, sized=True),
        "With --objects, without -k: diameter of the usual object, in pixels or as 12um; by default measured.",
        metavar="D",
        needs=("objects",),
    ).on_page("Diameter", "Of the usual object.", slider=(2, 200), unit="px", default="auto"),
    Option(
        "min_contrast",
        Real(0, 1, above=0),
        "With --objects, without -k: least contrast of an object, as a share of the usual one; by default measured.",
        metavar="C",
        needs=("objects",),
    ).on_page("Least contrast", "As a share of that of the usual object.", slider=(0.01, 1), default="auto"),
    switch(
        "exclude_edges",
        "With --objects: leave out objects at the edges of the image, which may be cut off.",
        needs=("objects",),
    ).on_page("Leave out at edges"),
    Option(
        "measure",
        Text(common.names),
        "Channels that --table measures, by name or number, or all; by default, those that are segmented.",
        metavar="NAME,...|all",
    ),
    Option(
        "properties",
        Text(common.names),
        "More columns for --table, by their names in scikit-image, such as eccentricity.",
        metavar="NAME,...",
    ),
    switch(
        "hierarchy", "Divide into connected regions, as people see them; the default without -k.", excludes=("volume",)
    ).on_page("connected regions"),
    Option(
        "threshold",
        Real(0),
        "With --hierarchy, not -k N: keep regions apart that differ by more.",
        metavar="T",
        needs=("hierarchy",),
    ).on_page("Threshold", slider=(0.05, 2), default="auto"),
    file("tree", "With --hierarchy: write the tree of regions, .npz.", HIERARCHY_KINDS["tree"], needs=("hierarchy",)),
    file(
        "strengths",
        "With --hierarchy: write how likely a person draws each edge, from black, 0, to white, .png, .tif or .npy.",
        HIERARCHY_KINDS["strengths"],
        needs=("hierarchy",),
    ),
    Option(
        "chance",
        Real(0, 1),
        "With --hierarchy: --contours are the lines that a person draws with at least this chance, which they tell.",
        metavar="P",
        needs=("hierarchy",),
    ),
    Option(
        "strongest",
        Whole(1),
        "With --hierarchy: --contours are the N lines, with their chances, that people draw most of.",
        metavar="N",
        needs=("hierarchy",),
    ),
    switch(
        "superpixels",
        "Divide into about N connected superpixels of similar size.",
        excludes=("number=auto", "hierarchy", "volume"),
    ).on_page("superpixels"),
    Option(
        "compactness",
        Real(0, auto=True),
        "Compactness of --superpixels; larger values: rounder. Auto follows the contrast within cells.",
        metavar="C|auto",
        default="auto",
        needs=("superpixels",),
    ).on_page("Compactness", slider=(0, 500)),
    Option(
        "edit",
        Text(late("segmentation", "Edit.parse")),
        "Change segments by hand, as cvtimg explore does: 'merge X,Y X,Y...', 'split X,Y', or by a brush of radius R: "
        "'paint R X,Y...', 'add R X,Y...', 'erase R X,Y...'. Repeat it for more.",
        metavar="TEXT",
        many=True,
        excludes=("volume",),
    ),
    common.MASK,
    common.NODATA,
    switch(
        "volume",
        "Use the same segments in all pages, as a volume if their distance is known; with --objects: its objects.",
    ),
    switch("track", "Objects of a time series keep their label from frame to frame, by overlap.", needs=("objects",)),
    common.VOLUME_POWER._replace(excludes=_OTHER_WAYS),
    common.EFFORT,
    common.SEED,
    *common.READING,
    *common.BATCH,
)
