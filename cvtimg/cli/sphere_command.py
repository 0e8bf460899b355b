"""``cvtimg sphere``: grids of the globe."""

from __future__ import annotations

from contextlib import suppress
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Row, Stopwatch, Task, WrongUsageError
from cvtimg.cli.running import Todo, plan_of, planned, plot
from cvtimg.options.record import Given

if TYPE_CHECKING:
    from cvtimg.sphere import SphereGrid

EXAMPLES = """\
  cvtimg sphere -n 40962 -o globe.nc
  cvtimg sphere -n 20000 --refine 10,50,20,4 -o europe.nc --plot europe.png --view 10 50
  cvtimg sphere --cell-width 480km --refine -40,45,2000km,240km -o atlantic.nc
  cvtimg sphere -n 10000 --density lights.png -o lights.geojson --plot lights-map.png
  cvtimg sphere -n 10000 --refine lights.png,6 -o cities.vtu
  cvtimg sphere -n 40962 --coast land.png -o coast.nc
  cvtimg sphere --cell-width 480km --land earth --strait -10,36,3,38 -o ocean.nc --plot ocean.png
  cvtimg sphere --cell-width 480km --region 10,50,20 -o europe.nc
  cvtimg sphere -n 5000 --parent globe.nc --within -96,38,25 -o nested.nc
"""
COLUMNS = ("n", "kept", "median_width_km", "least_angle", "largest_angle", "n_obtuse", "offset", "seconds", "output")
#: Half of the way around the earth, in km: wider cells are meant in meters.
_WIDEST = 20_000
_WIDTHS = ("least_width_km", "median_width_km", "largest_width_km")


def sphere(given: Given) -> Todo:
    """Place N points on the sphere as the cells of a grid for models of oceans and atmospheres.

    Points are generators of a centroidal Voronoi tessellation; triangles between them are nearly equilateral, and none
    is obtuse where sizes change gently. Maps are equirectangular: -180 to 180 degrees from left to right, 90 to -90
    from top to bottom.
    """
    from cvtimg.sphere.formats import GRID_FORMATS

    if not given.output.name.lower().endswith(tuple(GRID_FORMATS)):
        raise WrongUsageError(f"-o {given.output} must end in {', '.join(GRID_FORMATS)}")
    if given.number is None and (given.cell_width is None or given.parent is not None):
        raise WrongUsageError("give -n, the number of points" + (" or --cell-width" if given.parent is None else ""))
    in_km = given.cell_width is not None
    given.finer = [_circle_in_km(text) if in_km else _refinement(text) for text in given.refine or []]
    given.width = None if given.cell_width is None else _width(given.cell_width)
    given.circle = None if given.within is None else _numbers("--within", given.within, ("LON", "LAT", "RADIUS"))
    given.area = None if given.region is None else _area(given.region)
    files = [part for part in (given.area, given.width, *(finer[0] for finer in given.finer)) if isinstance(part, Path)]
    return planned(plan_of(given, together=True, also_read=files), _sphere, COLUMNS, given)


def _refinement(text: str) -> tuple[Any, ...]:
    """Read LON,LAT,RADIUS,RATIO as numbers, or IMAGE,RATIO as a path and a number."""
    if text.count(",") == 1:
        image, ratio = text.split(",")
        if image.replace(".", "", 1).lstrip("-").isdigit() and not Path(image).exists():
            raise WrongUsageError(f"--refine {text} must be LON,LAT,RADIUS,RATIO, all numbers, or IMAGE,RATIO")
        return Path(image), *_numbers("--refine", ratio, ("RATIO",))
    return _numbers("--refine", text, ("LON", "LAT", "RADIUS", "RATIO"))


def _width(text: str) -> float | Path:
    """Read a number of km, or the name of a file."""
    with suppress(ValueError):
        width = float(text.removesuffix("km"))
        if width > _WIDEST:
            raise WrongUsageError(f"--cell-width {text} is in km, and must be at most {_WIDEST}; 30km is 30000 m")
        return width
    return Path(text)


def _circle_in_km(text: str) -> tuple[float, ...]:
    """Read LON,LAT,RADIUS,WIDTH or LON,LAT,RADIUS,WIDTH,TRANSITION, lengths in km."""
    names = ("LON", "LAT", "RADIUS", "WIDTH", "TRANSITION")
    parts = text.split(",")
    plain = ",".join(parts[:2] + [part.removesuffix("km") for part in parts[2:]])
    return _numbers("--refine", plain, names[: 5 if len(parts) == 5 else 4])


def _area(text: str) -> tuple[float, ...] | Path:
    """Read LON,LAT,RADIUS or WEST,SOUTH,EAST,NORTH, or the name of a file of polygons."""
    if text.lower().endswith((".geojson", ".json")):
        return Path(text)
    names = ("LON", "LAT", "RADIUS") if text.count(",") == 2 else ("WEST", "SOUTH", "EAST", "NORTH")
    return _numbers("--region", text, names)


def _numbers(option: str, text: str, names: tuple[str, ...]) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != len(names):
        raise WrongUsageError(f"{option} {text} must be {','.join(names)}, all numbers")
    return values


def _sphere(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    import numpy as np

    import cvtimg
    from cvtimg.cli.grid_inputs import cut_out, read_coast, read_densities, read_grid_points, read_lineage, read_width
    from cvtimg.sphere import Cap, coastal_grid, nested_grid

    width = None if given.width is None else read_width(given.width, given.finer)
    density = read_densities(given.density, given.finer) if width is None else width
    making = {"effort": given.effort, "rng": given.seed, "density": density}
    number = width.n_points if width is not None and given.number is None else given.number
    land = None if given.coast is None else read_coast(given.coast, number)
    old = None if given.parent is None else read_grid_points(given.parent)
    attributes = {"history": given.command}
    if given.parent is not None:
        attributes["parent_id"] = read_lineage(given.parent)
    stopwatch.lap("read")
    grid: SphereGrid
    if land is not None:
        grid = coastal_grid(number, land, **making)
    elif old is not None and given.circle is not None:
        grid = nested_grid(old, given.number, within=Cap(*given.circle), **making)
    else:
        grid = cvtimg.sphere_grid(number, **making)
    part = cut_out(grid, given)
    whole = part or grid
    stopwatch.lap("place")
    whole.save(task.outputs["-o"], radius=given.radius, attributes=attributes, overwrite=given.overwrite)
    kept = np.ones(len(grid.points), bool) if part is None else part.kept
    if "--plot" in task.outputs:
        _plot(grid, kept, task.outputs["--plot"], given)
    if "--histograms" in task.outputs:
        from cvtimg.halfedges import measure_triangles

        each = measure_triangles(grid.points, grid.triangles[kept[grid.triangles].all(axis=1)])
        values = {"cell width (km)": grid.widths()[kept], "angle of triangles (degrees)": each.angles}
        plot(task.outputs["--histograms"], given, "draw_histograms", values)
    stopwatch.lap("write")
    return {
        **grid.summary(),
        "kept": len(whole.points),
        **dict(zip(_WIDTHS, np.quantile(grid.widths(), (0, 0.5, 1)).tolist(), strict=True)),
    }


def _plot(grid: SphereGrid, kept: Any, path: Path, given: Given) -> None:
    from cvtimg.sphere import cell_polygons, earth_coasts

    cells, widths = grid.cells(), grid.widths()[kept]
    more = {"label": "cell width (km)", "lines": earth_coasts()}
    if given.view is not None:
        plot(path, given, "draw_globe", list(compress(cells, kept)), widths, center=given.view, **more)
    else:
        polygons = compress(cell_polygons(cells.vertices, cells.corners, cells.offsets), kept)
        plot(path, given, "draw_map", list(polygons), widths, **more)
