import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.io import netcdf_file
from scipy.spatial import SphericalVoronoi

from cvtimg._shared.types import Array, Floats
from cvtimg.sphere import SphereGrid, triangulate
from cvtimg.sphere.formats import GRID_FORMATS, GridContent, write_grid
from cvtimg.sphere.triangulation import unit

N = 600
EARTH = 6371229.0


def spiral(n: int, seed: int = 0, noise: float = 0.02) -> Floats:
    height, turn = 1 - (2 * np.arange(n) + 1) / n, np.arange(n) * np.pi * (3 - 5**0.5)
    radius = np.sqrt(1 - height**2)
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    return unit(points + noise * np.random.default_rng(seed).normal(size=points.shape))


def grid_of(points: Floats) -> SphereGrid:
    density = np.linspace(1, 2, len(points))
    return SphereGrid(
        points,
        triangulate(points),
        np.full(len(points), 4 * np.pi / len(points)),
        density,
        1.0,
        0.0,
        np.zeros(len(points), bool),
    )


def content(points: Floats, radius: float = 1.0) -> GridContent:
    return GridContent(points, triangulate(points), np.linspace(1, 2, len(points)), radius)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a file of each format."""
    path = tmp_path_factory.mktemp("grids")
    for end in GRID_FORMATS:
        grid_of(spiral(N)).save(path / f"grid{end}", radius=EARTH if end == ".nc" else 1.0)
    grid_of(spiral(N)).save(path / "unit.nc")
    return path


@pytest.fixture(scope="module")
def mpas(folder: Path) -> dict[str, Array]:
    """Return the variables on the unit sphere, with indices from 0."""
    with netcdf_file(folder / "unit.nc", mmap=False) as file:
        found = {
            name: variable[:].astype(variable[:].dtype.newbyteorder("=")) for name, variable in file.variables.items()
        }
    for name in found:
        if "On" in name and name[0] != "n" and name not in ("weightsOnEdge", "kiteAreasOnVertex"):
            found[name] = found[name] - 1
    for kind in ("Cell", "Edge", "Vertex"):
        found[kind] = np.stack([found[f"{axis}{kind}"] for axis in "xyz"], axis=1)
    return found


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["unit.nc", "grid.nc", "grid.ugrid.nc", "grid.scrip.nc"])
def test_uxarray_opens_and_validates_the_grid(folder: Path, name: str) -> None:
    import uxarray

    if name == "grid.nc":
        dual = uxarray.open_grid(folder / name, use_dual=True)
        assert (dual.n_face, dual.n_node, dual.validate()) == (2 * N - 4, N, True)
    grid = uxarray.open_grid(folder / name)
    assert grid.validate()
    assert (grid.n_face, grid.n_node) == (N, 2 * N - 4)
    assert "scrip" in name or grid.n_edge == 3 * N - 6  # in SCRIP files, corners that are repeated make edges
    assert np.allclose(grid.face_areas, SphericalVoronoi(spiral(N)).calculate_areas(), rtol=1e-5)


def test_mpas_has_the_dimensions_and_attributes_of_its_specification(folder: Path) -> None:
    with netcdf_file(folder / "grid.nc", mmap=False) as file:
        most = file.dimensions["maxEdges"]
        assert dict(file.dimensions) == {
            "nCells": N, "nEdges": 3 * N - 6, "nVertices": 2 * N - 4, "maxEdges": most, "maxEdges2": 2 * most, "TWO": 2,
            "vertexDegree": 3, "Time": None,
        }  # fmt: skip
        assert (file.on_a_sphere, file.is_periodic, file.mesh_spec, file.Conventions) == (
            b"YES",
            b"NO",
            b"1.0",
            b"MPAS",
        )
        assert file.sphere_radius == EARTH
        assert len(file.file_id) == 10


def test_lengths_and_areas_are_in_units_of_the_radius(folder: Path, mpas: dict[str, Array]) -> None:
    with netcdf_file(folder / "grid.nc", mmap=False) as file:
        for name, power in (("xCell", 1), ("dcEdge", 1), ("dvEdge", 1), ("areaCell", 2), ("kiteAreasOnVertex", 2)):
            assert np.allclose(file.variables[name][:], mpas[name] * EARTH**power, rtol=1e-12)
        for name in ("latCell", "angleEdge", "weightsOnEdge", "meshDensity"):
            assert np.allclose(file.variables[name][:], mpas[name], rtol=1e-12)


def test_numbers_have_the_types_that_other_programs_read(folder: Path, tmp_path: Path) -> None:
    write_grid(tmp_path / "a.nc", content(spiral(50), 6371220.123))
    write_grid(tmp_path / "a.ugrid.nc", content(spiral(50), 6371220.123))
    for path in (tmp_path / "a.nc", tmp_path / "a.ugrid.nc", folder / "grid.scrip.nc"):
        with netcdf_file(path, mmap=False) as file:
            described = [file, *file.variables.values()]
            values = [*(variable.data for variable in described[1:])]
            values += [value for one in described for value in one._attributes.values()]
            for value in values:
                kind = np.asarray(value).dtype
                assert kind.kind in "SU" or kind.newbyteorder("=") in (np.float64, np.int32)
            if "scrip" not in path.name:
                assert file.sphere_radius == 6371220.123


def test_cells_of_scrip_repeat_their_last_corner_and_nothing_else(folder: Path, mpas: dict[str, Array]) -> None:
    with netcdf_file(folder / "grid.scrip.nc", mmap=False) as file:
        lon, lat = (file.variables[f"grid_corner_{name}"][:] for name in ("lon", "lat"))
    same = (np.diff(lon, axis=1) == 0) & (np.diff(lat, axis=1) == 0)
    n_corners = lon.shape[1] - same.sum(axis=1)
    assert (n_corners == mpas["nEdgesOnCell"]).all()
    assert (same == (np.arange(1, lon.shape[1]) >= n_corners[:, None])).all()


def test_orders_go_around_counterclockwise(mpas: dict[str, Array]) -> None:
    for cell in range(N):
        degree = mpas["nEdgesOnCell"][cell]
        cells, edges, vertices = (mpas[f"{name}OnCell"][cell, :degree] for name in ("cells", "edges", "vertices"))
        for name in ("cells", "edges", "vertices"):
            assert (mpas[f"{name}OnCell"][cell, degree:] == -1).all()
        center = mpas["Cell"][cell]
        for j in range(degree):
            assert set(mpas["cellsOnEdge"][edges[j]]) == {cell, cells[j]}
            # Vertex j lies between edges j and j + 1.
            assert set(mpas["cellsOnVertex"][vertices[j]]) == {cell, cells[j], cells[(j + 1) % degree]}
            following = mpas["Vertex"][vertices[(j + 1) % degree]]
            assert np.dot(center, np.cross(mpas["Vertex"][vertices[j]], following)) > 0
    for vertex in range(2 * N - 4):
        cells = mpas["cellsOnVertex"][vertex]
        assert np.linalg.det(mpas["Cell"][cells]) > 0
        for k in range(3):
            edge = mpas["edgesOnVertex"][vertex, k]
            assert set(mpas["cellsOnEdge"][edge]) == {cells[k - 1], cells[k]}  # as the official converter has it
    first, second = mpas["Cell"][mpas["cellsOnEdge"]].transpose(1, 0, 2)
    right, left = mpas["Vertex"][mpas["verticesOnEdge"]].transpose(1, 0, 2)
    assert (np.einsum("ij,ij->i", np.cross(mpas["Edge"], second - first), left - right) > 0).all()


def lhuilier(a: Floats, b: Floats, c: Floats) -> float:
    """Area of a spherical triangle with its sign."""
    x, y, z = (np.arctan2(np.linalg.norm(np.cross(p, q)), p @ q) for p, q in ((b, c), (c, a), (a, b)))
    s = (x + y + z) / 2
    tangents = np.tan(s / 2) * np.tan((s - x) / 2) * np.tan((s - y) / 2) * np.tan((s - z) / 2)
    return float(np.sign(np.linalg.det([a, b, c])) * 4 * np.arctan(np.sqrt(max(tangents, 0))))


def test_areas_and_kites_agree_with_formulas_for_single_triangles(mpas: dict[str, Array]) -> None:
    areas, kites = SphericalVoronoi(spiral(N)).calculate_areas(), mpas["kiteAreasOnVertex"]
    assert np.allclose(mpas["areaCell"], areas, rtol=1e-7)
    assert np.allclose(np.bincount(mpas["cellsOnVertex"].ravel(), kites.ravel()), mpas["areaCell"], rtol=1e-12)
    for vertex in range(0, 2 * N - 4, 7):
        corners = mpas["Cell"][mpas["cellsOnVertex"][vertex]]
        assert mpas["areaTriangle"][vertex] == pytest.approx(lhuilier(*corners), rel=1e-7)
        center = mpas["Vertex"][vertex]
        assert np.ptp(corners @ center) < 1e-14
        for k, corner in enumerate(corners):
            after, before = (unit((corner + corners[(k + step) % 3])[None])[0] for step in (1, 2))
            kite = lhuilier(corner, after, center) + lhuilier(corner, center, before)
            assert mpas["kiteAreasOnVertex"][vertex, k] == pytest.approx(kite, rel=1e-7, abs=1e-12)


def test_weights_agree_with_their_definition(mpas: dict[str, Array]) -> None:
    for edge in range(3 * N - 6):
        expected: dict[int, float] = {}
        for side, cell in enumerate(mpas["cellsOnEdge"][edge]):
            degree = mpas["nEdgesOnCell"][cell]
            around = mpas["edgesOnCell"][cell, :degree].tolist()
            corners = mpas["verticesOnCell"][cell, :degree]
            start, share = around.index(edge), 0.0
            for step in range(1, degree):
                vertex = corners[(start + step - 1) % degree]
                corner = mpas["cellsOnVertex"][vertex].tolist().index(cell)
                share += mpas["kiteAreasOnVertex"][vertex, corner] / mpas["areaCell"][cell]
                other = around[(start + step) % degree]
                outward = 1 if mpas["cellsOnEdge"][other, 0] == cell else -1
                ratio = mpas["dvEdge"][other] / mpas["dcEdge"][edge]
                expected[other] = (1 - 2 * side) * outward * (0.5 - share) * ratio
        n = mpas["nEdgesOnEdge"][edge]
        assert mpas["edgesOnEdge"][edge, :n].tolist() == list(expected)
        assert np.allclose(mpas["weightsOnEdge"][edge, :n], list(expected.values()), rtol=1e-9, atol=1e-12)
        assert (mpas["edgesOnEdge"][edge, n:] == -1).all()
        assert (mpas["weightsOnEdge"][edge, n:] == 0).all()


def test_angles_of_edges_are_those_with_the_east(mpas: dict[str, Array]) -> None:
    step = 1e-6
    latitude, longitude, angle = mpas["latEdge"], mpas["lonEdge"], mpas["angleEdge"]
    latitude, longitude = latitude + step * np.sin(angle), longitude + step * np.cos(angle) / np.cos(latitude)
    ahead = np.stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], 1)
    first, second = mpas["Cell"][mpas["cellsOnEdge"]].transpose(1, 0, 2)
    assert np.allclose((ahead - mpas["Edge"]) / step, unit(second - first), atol=1e-4)


def poles_and_meridian() -> Floats:
    """Cells with corners at the poles and on the antimeridian."""
    angles = np.radians(np.arange(45.0, 360, 90))
    rings = [
        np.stack([np.cos(angles) * np.cos(x), np.sin(angles) * np.cos(x), np.full(4, np.sin(x))], 1)
        for x in (0.8, -0.8)
    ]
    return np.concatenate([*rings, unit(np.array([[1, 0.1, 0], [-1, 0.2, 0.1], [0.1, 1, 0], [0.2, -1, 0.1]], float))])


@pytest.mark.parametrize(
    "points",
    [pytest.param(spiral(N), marks=pytest.mark.slow), spiral(N)[:, [2, 0, 1]], poles_and_meridian()],
    ids=["a", "b", "corners"],
)
def test_cells_in_geojson_tile_the_map(tmp_path: Path, points: Floats) -> None:
    path = tmp_path / "a.geojson"
    write_grid(path, content(points))
    features = json.loads(path.read_text())["features"]
    shapes = [shapely.geometry.shape(feature["geometry"]) for feature in features]
    assert len(shapes) == len(points)
    assert all(shape.is_valid for shape in shapes)
    west, south, east, north = shapely.total_bounds(shapes)
    assert (west, south, east, north) == (-180, -90, 180, 90)
    assert sum(shape.area for shape in shapes) == pytest.approx(360 * 180, rel=1e-9)
    assert shapely.union_all(shapes).area == pytest.approx(360 * 180, rel=1e-9)
    areas = [feature["properties"]["area"] for feature in features]
    assert sum(areas) == pytest.approx(4 * np.pi)
    longitudes, latitudes = np.degrees(np.arctan2(points[:, 1], points[:, 0])), np.degrees(np.arcsin(points[:, 2]))
    places = shapely.points(longitudes, latitudes)
    assert all(shape.contains(place) for shape, place in zip(shapes, places, strict=True))


def test_tables_hold_the_generators(folder: Path) -> None:
    table = np.genfromtxt(folder / "grid.csv", delimiter=",", names=True)
    assert np.allclose(np.stack([table[axis] for axis in "xyz"], 1), spiral(N), rtol=0, atol=1e-15)
    assert np.allclose(np.sin(np.radians(table["lat"])), table["z"])
    assert table["area"].sum() == pytest.approx(4 * np.pi)
    assert table["neighbors"].sum() == 6 * N - 12


def test_graphs_list_the_neighbors_of_each_cell(folder: Path, mpas: dict[str, Array]) -> None:
    head, *lines = (folder / "grid.graph.info").read_text().splitlines()
    assert head == f"{N} {3 * N - 6}"
    for line, row, degree in zip(lines, mpas["cellsOnCell"] + 1, mpas["nEdgesOnCell"], strict=True):
        assert line == " ".join(map(str, row[:degree]))


def test_triangles_must_close_the_sphere(tmp_path: Path) -> None:
    whole = content(spiral(20))
    holed = GridContent(whole.points, whole.triangles[1:], whole.density, 1.0)
    turned = GridContent(whole.points, whole.triangles.copy(), whole.density, 1.0)
    turned.triangles[3] = turned.triangles[3, ::-1]
    for grid in (holed, turned):
        with pytest.raises(ValueError, match="triangles must close the sphere"):
            write_grid(tmp_path / "a.nc", grid)
    assert list(tmp_path.iterdir()) == []


def test_the_end_of_the_name_picks_the_format(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"path='a\.tif' must be a name that ends in \.ugrid\.nc"):
        write_grid("a.tif", content(spiral(20)))
    path = tmp_path / "A.UGRID.NC"
    write_grid(path, content(spiral(20)))
    assert b"mesh_topology" in path.read_bytes()
    with pytest.raises(FileExistsError):
        write_grid(path, content(spiral(20)))
    with pytest.raises(ValueError, match="radius=0 must be a finite number > 0"):
        grid_of(spiral(20)).save(tmp_path / "b.nc", radius=0)
