"""Options of ``cvtimg mesh``, ``cvtimg surface`` and ``cvtimg sphere``."""

from cvtimg.options import common
from cvtimg.options.common import file, read, switch, text
from cvtimg.options.record import Choice, Option, Pair, Real, Text, Whole, passed

OUT_DIR = common.out_dir("Folder for outputs NAME.vtu.")
#: Radii of the earth in meters, as models have it.
_RADII = {"mpas": 6_371_229.0, "cesm": 6_371_220.0}


def _radius(text: str | float) -> float:
    """Return a radius by its name, or a number."""
    try:
        return _RADII.get(str(text)) or Real(above=0).parse(text)
    except ValueError as error:
        raise ValueError(f"{error}, or {', '.join(_RADII)}") from None


def _name(text: object) -> tuple[str, list[float]]:
    """Return a name and what it is for: the number of a label, or the four of a box."""
    name, _, numbers = str(text).partition("=")
    try:
        values = [float(number) for number in numbers.split(",")]
    except ValueError:
        values = []
    if not name or not (len(values) == 4 or (len(values) == 1 and values[0].is_integer())):
        raise ValueError(f"{str(text)!r} must be NAME=LABEL or NAME=X0,Y0,X1,Y1")
    return name, values


MESH = (
    common.IMAGES._replace(
        help="Masks (images of black and one more value), images of labels (0 is not meshed), or polygons: .geojson, "
        ".json, .wkt, .wkb, or .csv with columns x and y. Stacks of voxels, filled with tetrahedra: .tif of several "
        "pages, or .npy."
    ),
    passed(
        "n",
        Whole(1, 1 << 26),
        "Number of vertices, otherwise as many as borders need.",
        "--vertices -n",
        excludes=("edge_length",),
    ).on_page("Vertices", slider=(100, 20_000), log=True, default="auto"),
    passed(
        "edge_length", Real(above=0), "Edge length, in the units of the coordinates.", metavar="H", excludes=("size",)
    ).on_page("Edge length", slider=(2, 100), unit="px", default=10.0),
    read("size", "Gray image with the length of edges at each pixel; with -n, its ratios."),
    Option("label", Whole(0), "Mesh only pixels with this label.", metavar="K"),
    passed(
        "grade", Real(above=0), "Growth of sizes for each unit of length, at most.", metavar="G", default=0.2
    ).on_page("Growth", "How fast triangles grow away from borders.", slider=(0.05, 1)),
    passed("min_size", Real(0), "Least size; smaller details are left out.", metavar="H", default=0.0).on_page(
        "Least edge", slider=(0, 20), unit="px"
    ),
    passed(
        "order", Whole(1, 2), "Order of elements: with 2, triangles have six nodes, and bend with borders.", default=1
    ),
    Option(
        "snap",
        Real(0),
        "Join points of polygons that are nearer than this, and close cracks and spikes that are thinner; 0 keeps all. "
        "Default: 1e-5 of the diagonal.",
        metavar="TOL",
    ),
    Option(
        "simplify",
        Real(0),
        "Draw polygons with fewer points, moving lines by about this; areas are kept.",
        metavar="TOL",
        default=0.0,
    ),
    Option(
        "project",
        Choice(("auto",)),
        "Polygons are in degrees, perhaps across the date line: mesh them in km about their middle; lengths are in km.",
    ),
    switch("keep_points", "Make all points of polygons vertices; otherwise only corners are, and areas are kept."),
    passed(
        "periodic",
        Choice(("x", "y", "xy")),
        "Pair vertices on borders that are copies: on the left and right (x), or at the least and the greatest y.",
    ),
    Option(
        "name",
        Text(_name),
        "Name a region by its label (1 without labels), or the border edges in a box, for solvers. Repeat it for more.",
        metavar="NAME=LABEL|NAME=X0,Y0,X1,Y1",
        many=True,
    ),
    text("name_by", "Property of GeoJSON features that names regions.", "PROPERTY", default="name"),
    common.output("Mesh file: .vtu, .msh, .obj, .ply, .stl, or by meshio.", common.meshes),
    OUT_DIR,
    switch("measures", "Report the eight measures of mesh quality."),
    file("plot", "Plot the mesh, .png or .svg, with triangles colored by quality.", common.PLOTS),
    read("over", "Image to show below the mesh in --plot.", metavar="IMAGE", needs=("plot",)),
    common.EFFORT,
    common.SEED,
    *common.READING,
    *common.BATCH,
)

SURFACE = (
    common.IMAGES._replace(help="Surfaces of triangles: .stl, .obj, .ply or .off."),
    Option("number", Whole(4), "Number of points.", "--points -n", required=True),
    common.output("Mesh file: .vtu, .obj, .ply, .stl, .msh, or by meshio.", common.meshes),
    OUT_DIR,
    Option(
        "feature_angle",
        Real(0, 180),
        "Keep edges where faces meet at more than this angle from flat, in degrees; 180 keeps none.",
        metavar="DEGREES",
        default=40.0,
    ),
    Option(
        "weld",
        Real(0),
        "Join vertices that are nearer than this, to close cracks. Default: a millionth of the diagonal.",
        metavar="TOL",
    ),
    file("plot", "Plot the triangles, .png or .svg, colored by quality and shaded.", common.PLOTS),
    Option(
        "view",
        Pair(),
        "Direction to the viewer of the plot, in degrees; z points up.",
        metavar="LON LAT",
        default=(-60.0, 30.0),
    ),
    common.EFFORT,
    *common.BATCH,
)

SPHERE = (
    Option(
        "number",
        Whole(1),
        "Number of points (with --parent: of new points). 10 t + 2, t = h*h + h*k + k*k, give the most regular grids. "
        "Optional with --cell-width, whose widths it scales.",
        "--points -n",
    ).on_page("Points", slider=(12, 163842), log=True, low=12, high=163842, default=2562),
    text(
        "cell_width",
        "Width of cells on the earth in km, such as 30km: the mean distance from a point to its neighbors. Or a map of "
        "widths: .nc with cellWidth, lat and lon, or an image, twice as wide as high.",
        "KM|FILE",
        excludes=("density",),
    ).on_page("Width", slider=(60, 2000), log=True, low=60, high=5000, default=480, unit="km"),
    common.output("Grid: .nc (MPAS), .ugrid.nc, .scrip.nc, .graph.info, .vtu, .geojson or .csv.", required=True),
    read("density", "Gather points where a map of the globe, twice as wide as high, is bright.", metavar="IMAGE"),
    text(
        "refine",
        "Make cells RATIO times finer in a circle (all in degrees); or IMAGE,RATIO: where a map is bright. With "
        "--cell-width: LON,LAT,RADIUS,WIDTH and perhaps TRANSITION, lengths in km. Repeat it for more.",
        "LON,LAT,RADIUS,RATIO",
        many=True,
    ),
    read(
        "coast",
        "Place points on the coasts of a map with white land and black sea, or of polygons of land.",
        metavar="MASK|GEOJSON",
        excludes=("parent",),
    ),
    read("parent", "Grid (.nc or .csv) that keeps all points outside of --within.", (".nc", ".csv"), needs=("within",)),
    text("within", "Circle of --parent that gets new points, in degrees.", "LON,LAT,RADIUS", needs=("parent",)),
    read(
        "land",
        "Remove the cells whose points are on land: a map with white land, polygons, or `earth` for coasts at 1:110 "
        "million; keep the largest sea.",
        metavar="FILE|earth",
    ),
    text(
        "strait",
        "Point, or line of points, in degrees, whose cells stay sea; or a .geojson file of them. Repeat it for more.",
        "LON,LAT[,LON,LAT...]",
        many=True,
        needs=("land",),
    ),
    switch("all_seas", "Keep lakes and inland seas.", needs=("land",)),
    switch("keep_bays", "Keep bays of single cells.", needs=("land",)),
    text(
        "region",
        "Keep the cells in a circle or a box, in degrees, or in polygons, and layers of cells around them.",
        "LON,LAT,RADIUS|WEST,SOUTH,EAST,NORTH|FILE",
    ),
    Option("layers", Whole(0, 1000), "Layers of cells around --region.", default=7, needs=("region",)),
    Option(
        "radius",
        Text(_radius),
        "Radius of the sphere in the file: a number, `mpas` for 6371229 m (WRF, too) or `cesm` for 6371220 m (E3SM, "
        "too).",
        metavar="R|mpas|cesm",
        default=1.0,
    ),
    file("plot", "Plot the cells on a map, .png or .svg, colored by size.", common.PLOTS),
    Option(
        "view",
        Pair(Real(), Real(-90, 90)),
        "Plot the globe as seen from above this place instead.",
        metavar="LON LAT",
        needs=("plot",),
    ),
    file("histograms", "Plot histograms of widths and angles, .png or .svg.", common.PLOTS),
    common.EFFORT,
    common.SEED,
    *common.RUN,
)
