"""``cvtimg sphere``: grids of the globe, and the maps, points and polygons that it reads."""

from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias

from cvtimg.cli.running import Given, Todo, WrongUsageError, plan_of, planned
from cvtimg.options.record import late

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
#: A part of the globe with finer cells: an image and a ratio, or the numbers of a circle.
Finer: TypeAlias = tuple[Any, ...]
#: Half of the way around the earth, in km: wider cells are meant in meters.
_WIDEST = 20_000


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
    return planned(plan_of(given, together=True, also_read=files), late("cli.gridding", "placed"), COLUMNS, given)


def _refinement(text: str) -> Finer:
    """Read LON,LAT,RADIUS,RATIO as numbers, or IMAGE,RATIO as a path and a number."""
    if text.count(",") == 1:
        image, ratio = text.split(",")
        if image.replace(".", "", 1).lstrip("-").isdigit() and not Path(image).exists():
            raise WrongUsageError(f"--refine {text} must be LON,LAT,RADIUS,RATIO, all numbers, or IMAGE,RATIO")
        return Path(image), *_numbers("--refine", ratio, ("RATIO",))
    return _numbers("--refine", text, ("LON", "LAT", "RADIUS", "RATIO"))


def _width(text: str) -> float | Path:
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
