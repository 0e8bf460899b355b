"""``cvtimg sphere``: grids of the globe."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from cvtimg.batch import Report, Row, Stopwatch, Task, WrongUsageError, check_suffix, plan_one
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan

if TYPE_CHECKING:
    from cvtimg.sphere import SphereGrid

EXAMPLES = """Examples:

\b
  cvtimg sphere -n 40962 -o globe.nc
  cvtimg sphere -n 20000 --refine 10,50,20,4 -o europe.nc --plot europe.png --view 10 50
  cvtimg sphere -n 10000 --density lights.png -o lights.geojson --plot lights-map.png
  cvtimg sphere -n 10000 --refine lights.png,6 -o cities.vtu
  cvtimg sphere -n 40962 --coast land.png -o ocean.nc
  cvtimg sphere -n 5000 --parent globe.nc --within -96,38,25 -o nested.nc
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("n", "least_angle", "largest_angle", "n_obtuse", "offset", "seconds", "output")

Number = Annotated[
    int,
    Option(
        "-n",
        metavar="N",
        parser=options.whole_number(1, 1 << 28),
        help="Number of points (with --parent: of new points). 12, 42, ... 10 * 4^k + 2 give the most regular grids.",
    ),
]
Density = Annotated[
    Path | None,
    Option(metavar="IMAGE", help="Gather points where a map of the globe, twice as wide as high, is bright."),
]
Refine = Annotated[
    list[str] | None,
    Option(
        metavar="LON,LAT,RADIUS,RATIO",
        help="Make cells RATIO times finer in a circle (all in degrees); or IMAGE,RATIO: where a map is bright. Repeat "
        "it for more.",
    ),
]
Coast = Annotated[
    Path | None, Option(metavar="MASK", help="Place points on the coasts of a map with white land and black sea.")
]
Parent = Annotated[
    Path | None, Option(metavar="FILE", help="Grid (.nc or .csv) that keeps all points outside of --within.")
]
Within = Annotated[
    str | None, Option(metavar="LON,LAT,RADIUS", help="Circle of --parent that gets new points, in degrees.")
]
Output = Annotated[
    Path,
    Option(
        "--output",
        "-o",
        metavar="FILE",
        help="Grid: .nc (MPAS), .ugrid.nc, .scrip.nc, .graph.info, .vtu, .geojson or .csv.",
    ),
]
Radius = Annotated[float, Option(metavar="R", parser=options.number(above=0), help="Radius of the sphere in the file.")]
Plot = Annotated[Path | None, Option(metavar="FILE", help="Plot the cells on a map, .png or .svg, colored by size.")]
View = Annotated[
    tuple[float, float] | None, Option(metavar="LON LAT", help="Plot the globe as seen from above this place instead.")
]
Over = Annotated[Path | None, Option(metavar="IMAGE", help="Map to show below the cells in --plot.")]


def sphere(
    number: Number,
    output: Output,
    density: Density = None,
    refine: Refine = None,
    coast: Coast = None,
    parent: Parent = None,
    within: Within = None,
    radius: Radius = 1.0,
    plot: Plot = None,
    view: View = None,
    over: Over = None,
    effort: options.Effort = "balanced",
    seed: options.Seed = 0,
    *,
    common: options.CommonOptions,
) -> int:
    """Place N points on the sphere as the cells of a grid for models of oceans and atmospheres.

    Points are generators of a centroidal Voronoi tessellation; triangles between them are nearly equilateral, and none
    is obtuse where sizes change gently. Maps are equirectangular: -180 to 180 degrees from left to right, 90 to -90
    from top to bottom.
    """
    from cvtimg.plotting.charts import PLOT_SUFFIXES
    from cvtimg.sphere.formats import GRID_FORMATS

    if not output.name.lower().endswith(tuple(GRID_FORMATS)):
        raise WrongUsageError(f"-o {output} must end in {', '.join(GRID_FORMATS)}")
    if (parent is None) != (within is None):
        raise WrongUsageError("--parent and --within need each other")
    if coast and parent:
        raise WrongUsageError("--coast takes no --parent")
    if plot is None and (view or over):
        raise WrongUsageError("--view and --over need --plot")
    check_suffix("--parent", parent, (".nc", ".csv"))
    check_suffix("--plot", plot, PLOT_SUFFIXES)
    finer = [_refinement(text) for text in refine or []]
    pictures = [density, coast, parent, over, *(part[0] for part in finer if isinstance(part[0], Path))]
    circle = None if within is None else _numbers("--within", within, ("LON", "LAT", "RADIUS"))
    plan = plan_one((), _no_inputs, {"-o": output, "--plot": plot}, also_read=pictures)
    report = Report(COLUMNS, as_json=common.as_json, quiet=common.quiet)
    work = partial(_sphere, number=number, density=density, finer=finer, coast=coast, parent=parent, circle=circle)
    work = partial(work, radius=radius, view=view, over=over, making={"effort": effort, "rng": seed})
    return run_plan(plan, partial(work, overwrite=common.overwrite), report, common)


def _no_inputs(name: str) -> list[Path]:
    return [Path(name)]


def _refinement(text: str) -> tuple[Any, ...]:
    """Read LON,LAT,RADIUS,RATIO as numbers, or IMAGE,RATIO as a path and a number."""
    if text.count(",") == 1:
        image, ratio = text.split(",")
        return Path(image), *_numbers("--refine", ratio, ("RATIO",))
    return _numbers("--refine", text, ("LON", "LAT", "RADIUS", "RATIO"))


def _numbers(option: str, text: str, names: tuple[str, ...]) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != len(names):
        raise WrongUsageError(f"{option} {text} must be {','.join(names)}, all numbers")
    return values


def _sphere(
    task: Task,
    stopwatch: Stopwatch,
    *,
    number: int,
    density: Path | None,
    finer: list[tuple[Any, ...]],
    coast: Path | None,
    parent: Path | None,
    circle: tuple[float, ...] | None,
    radius: float,
    view: tuple[float, float] | None,
    over: Path | None,
    making: dict[str, Any],
    overwrite: bool,
) -> Row:
    from dataclasses import asdict

    import cvtimg
    from cvtimg.cli.grid_inputs import read_densities, read_globe, read_grid_points
    from cvtimg.files.whole import write_whole
    from cvtimg.sphere import Cap, coastal_grid, nested_grid

    making = {**making, "density": read_densities(density, finer)}
    land = None if coast is None else read_globe("--coast", coast)
    old = None if parent is None else read_grid_points(parent)
    image = None if over is None else cvtimg.read_image(over)
    stopwatch.lap("read")
    found: SphereGrid
    if land is not None:
        found = coastal_grid(number, land, **making)
    elif old is not None and circle is not None:
        found = nested_grid(old, number, within=Cap(*circle), **making)
    else:
        found = cvtimg.sphere_grid(number, **making)
    stopwatch.lap("place")
    found.save(task.outputs["-o"], radius=radius, overwrite=overwrite)
    if "--plot" in task.outputs:
        path = task.outputs["--plot"]
        write_whole(path, _drawn(found, view, image, path.suffix.lower()), overwrite=overwrite)
    stopwatch.lap("write")
    return {
        "n": len(found.points),
        "triangles": len(found.triangles),
        "fixed": int(found.fixed.sum()),
        "energy": found.energy,
        "offset": found.offset,
        **asdict(found.measures()),
    }


def _drawn(grid: SphereGrid, view: tuple[float, float] | None, image: Any, suffix: str) -> bytes:
    import numpy as np

    from cvtimg.plotting.globes import draw_globe, draw_map
    from cvtimg.sphere import cell_polygons

    cells, sizes = grid.cells(), np.degrees(np.sqrt(grid.areas))
    if view is not None:
        return draw_globe(list(cells), sizes, suffix, center=view, image=image)
    rings = list(cell_polygons(cells.vertices, cells.corners, cells.offsets))
    return draw_map(rings, sizes, suffix, image=image)
