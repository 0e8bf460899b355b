"""What ``cvtimg sphere`` does when it runs: it reads maps, points and polygons, places a grid, and writes it."""

import json
from contextlib import AbstractContextManager
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from scipy.io import netcdf_file

import cvtimg
from cvtimg import sphere
from cvtimg._shared.budgets import GIVEN
from cvtimg._shared.checks import check_picture_density
from cvtimg._shared.extras import optional
from cvtimg._shared.geojson import shapes_of
from cvtimg._shared.types import Array, Bools, Floats
from cvtimg.cli.running import Given, Row, Stopwatch, Task, plot
from cvtimg.cli.sphere_command import Finer
from cvtimg.files.remote import exists, local_copy
from cvtimg.halfedges import measure_triangles
from cvtimg.sphere.parts import inside_of
from cvtimg.tables import read_table

#: Pixels along a cell of maps that are drawn of polygons: fewer make coasts jagged; and heights in pixels at least and
#: at most, for islands between points and for memory.
_PIXELS, _LEAST_HEIGHT, _MOST_HEIGHT = 6, 360, 4320
_WIDTHS = ("least_width_km", "median_width_km", "largest_width_km")


def placed(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    """Place the grid of a task, and write what its options name."""
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
    grid: sphere.SphereGrid
    if land is not None:
        grid = sphere.coastal_grid(number, land, **making)
    elif old is not None and given.circle is not None:
        grid = sphere.nested_grid(old, given.number, within=sphere.Cap(*given.circle), **making)
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
        each = measure_triangles(grid.points, grid.triangles[kept[grid.triangles].all(axis=1)])
        values = {"cell width (km)": grid.widths()[kept], "angle of triangles (degrees)": each.angles}
        plot(task.outputs["--histograms"], given, "draw_histograms", values)
    stopwatch.lap("write")
    widths = zip(_WIDTHS, np.quantile(grid.widths(), (0, 0.5, 1)).tolist(), strict=True)
    return {**grid.summary(), "kept": len(whole.points), **dict(widths)}


def _plot(grid: sphere.SphereGrid, kept: Bools, path: Path, given: Given) -> None:
    cells, widths = grid.cells(), grid.widths()[kept]
    more = {"label": "cell width (km)", "lines": sphere.earth_coasts()}
    if given.view is not None:
        plot(path, given, "draw_globe", list(compress(cells, kept)), widths, center=given.view, **more)
    else:
        polygons = compress(sphere.cell_polygons(cells.vertices, cells.corners, cells.offsets), kept)
        plot(path, given, "draw_map", list(polygons), widths, **more)


def _local(option: str, path: Path) -> AbstractContextManager[Path]:
    if not exists(path):
        raise FileNotFoundError(f"{option} {path}: no such file")
    return local_copy(path)


def read_globe(option: str, path: Path) -> Floats:
    """Read a map of the globe as the means of its color bands: finite, >= 0 and not black."""
    image = cvtimg.read_image(path)
    if image.shape[1] != 2 * image.shape[0]:
        raise ValueError(f"{option} {path} of {image.shape[1]} x {image.shape[0]} pixels must be twice as wide as high")
    bands: Floats = np.atleast_3d(image)[:, :, :3].mean(axis=2, dtype=np.float64)
    check_picture_density(f"{option} {path}", bands)
    return bands


def read_coast(path: Path, n: int) -> Array:
    """Read a map of land, or draw polygons of GeoJSON as one whose pixels are some of a cell of n, in degrees."""
    if path.suffix.lower() not in (".geojson", ".json"):
        return read_globe("--coast", path)
    height = int(np.clip(_PIXELS * np.sqrt(n), _LEAST_HEIGHT, _MOST_HEIGHT))
    lat, lon = (np.radians((np.arange(size) + 0.5) * 180 / height) for size in (height, 2 * height))
    z, flat = np.cos(lat)[:, None] + 0 * lon, np.sin(lat)[:, None]
    points = np.stack([-flat * np.cos(lon), -flat * np.sin(lon), z], axis=-1).reshape(-1, 3)
    land = inside_of("--coast", _part("--coast", path), points).reshape(height, 2 * height)
    if not land.any() or land.all():
        raise ValueError(f"--coast {path}: has {'only' if land.all() else 'no'} land on a map {height} pixels high")
    return land


def read_densities(density: Path | None, finer: list[Finer]) -> list[object] | None:
    """Return what `cvtimg.sphere_grid` takes as a density: a map, circles and maps of finer cells, or None."""
    maps = [] if density is None else [read_globe("--density", density)]
    parts: list[object] = [sphere.GlobePicture.of("density", bands) for bands in maps]
    for where, *numbers in finer:
        if isinstance(where, Path):
            parts.append(sphere.GlobePicture.of("density", sphere.by_spacing(read_globe("--refine", where), *numbers)))
        else:
            lon, (lat, radius, ratio) = where, numbers
            parts.append(sphere.Refinement(lon, lat, radius, ratio))
    return parts or None


def cut_out(grid: sphere.SphereGrid, given: Given) -> sphere.PartialGrid | None:
    """Return the part of a grid that --land or --region leaves; None for all of it."""
    part = None
    if given.land is not None:
        straits = [line for text in given.strait or [] for line in _lines(text)]
        land = sphere.earth_land() if str(given.land) == "earth" else _part("--land", given.land)
        part = sphere.cull_land(grid, land, straits=straits, largest=not given.all_seas, fill_bays=not given.keep_bays)
    if given.area is None:
        return part
    if isinstance(given.area, Path):
        within = _part("--region", given.area)
    else:
        within = (sphere.Cap if len(given.area) == 3 else sphere.Box)(*given.area)
    return sphere.limit_area(part or grid, within, layers=given.layers)


def _part(option: str, path: Path) -> Any:
    is_map = path.suffix.lower() not in (".geojson", ".json")
    return read_globe(option, path) if is_map else _read_json(option, path)


def _read_json(option: str, path: Path) -> Any:
    with _local(option, path) as file:
        try:
            return json.loads(file.read_text(encoding="utf-8-sig"))
        except ValueError as error:
            raise ValueError(f"{option} {path} is not a GeoJSON file: {error}") from error


def _lines(text: str) -> list[Any]:
    """Read a point or a line as LON,LAT,..., or those of a GeoJSON file."""
    if text.lower().endswith((".geojson", ".json")):
        return [shapely.get_coordinates(shape) for shape in shapes_of(_read_json("--strait", Path(text)))]
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = [0.0]
    if len(numbers) % 2:
        raise ValueError(f"--strait {text} must be LON,LAT or a line of these, all numbers, or a .geojson file")
    return [[numbers[k : k + 2] for k in range(0, len(numbers), 2)]]


def read_width(width: float | Path, circles: list[Finer]) -> sphere.CellWidth:
    """Return widths of cells in km: one, or a map of them, with circles of finer cells."""
    cells: Any = width
    if isinstance(width, Path) and width.suffix.lower() == ".nc":
        with _local("--cell-width", width) as file:
            table = read_netcdf(file, ("lon", "lat", "cellWidth"))
        try:
            cells = sphere.width_map(table["lon"], table["lat"], table["cellWidth"])
        except ValueError as error:
            raise ValueError(f"--cell-width {width}: {error}") from error
    elif isinstance(width, Path):
        cells = read_globe("--cell-width", width)
    return sphere.CellWidth(cells, [sphere.WidthCircle(*circle) for circle in circles])


def read_netcdf(path: Path, names: tuple[str, ...]) -> dict[str, Floats]:
    """Read variables of a netCDF file; netCDF4 reads those in the format of HDF5."""
    with _opened(path) as content:
        missing = [name for name in names if name not in content.variables]
        if missing:
            raise ValueError(f"{path} must have the variables {', '.join(names)}; it has no {missing[0]}")
        return {name: np.array(content.variables[name][:], np.float64) for name in names}


def _opened(path: Path) -> Any:
    with path.open("rb") as file:
        is_classic = file.read(3) == b"CDF"
    return netcdf_file(path, "r", mmap=False) if is_classic else optional("netCDF4", "globe").Dataset(path)


def read_lineage(path: Path) -> str:
    """Return the file_id of an MPAS mesh and those of its parents, a line each; nothing of a table."""
    if path.suffix.lower() != ".nc":
        return ""
    with local_copy(path) as file, _opened(file) as content:
        texts = [getattr(content, name, b"") for name in ("file_id", "parent_id")]
    return "\n".join(text.decode() if isinstance(text, bytes) else text for text in texts if text)


def read_grid_points(path: Path) -> Floats:
    """Read the points of a grid as unit vectors: an MPAS mesh, or a table with the columns x, y and z."""
    try:
        with _local("--parent", path) as file:
            if file.suffix.lower() != ".nc":
                table = read_table(file, columns="xyz").rows
            else:
                *places, vertices = read_netcdf(file, ("xCell", "yCell", "zCell", "xVertex")).values()
                if len(vertices) != 2 * len(places[0]) - 4:
                    raise OSError(f"--parent {file} is a part of a grid; it must cover the globe")
                table = np.stack(places, axis=1)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise ValueError(f"{path} is neither an MPAS mesh nor a table with columns x, y and z: {error}") from error
    lengths = np.linalg.norm(table, axis=1)
    radius = float(np.median(lengths))
    worst = int(np.abs(lengths - radius).argmax())
    if abs(lengths[worst] - radius) > GIVEN * radius:
        off = f"point {worst} is {lengths[worst]:g} from the center, not {radius:g}"
        raise ValueError(f"points of {path} must be on a sphere: {off}")
    # On a sphere of radius 1, points keep their bits.
    return table if abs(lengths - 1).max() < 1e-12 else table / lengths[:, None]
