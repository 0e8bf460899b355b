"""Grids without land, and limited areas: what stays, and what touches what there."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from scipy.io import netcdf_file

from cvtimg import sphere_grid
from cvtimg._shared.types import Array, Bools, Floats
from cvtimg.sphere import Box, Cap, PartialGrid, cull_land, earth_coasts, earth_land, limit_area
from cvtimg.sphere.densities import from_degrees

GRID = sphere_grid(642)
LAND = Cap(20, 10, 50)


def read(path: Path) -> dict[str, Array]:
    with netcdf_file(path, mmap=False) as file:
        return {name: np.array(variable[:]) for name, variable in file.variables.items()}


def wall(points: Floats) -> Bools:
    """Tell where a wall of land around the globe is."""
    return np.asarray(np.abs(np.degrees(np.arcsin(points[:, 2])) - 20) < 12)


def neighbors(cell: int) -> set[int]:
    around = np.unique(GRID.triangles[(GRID.triangles == cell).any(axis=1)])
    return set(around.tolist()) - {cell}


def row(table: Array, i: int) -> set[int]:
    return set(table[i].tolist()) - {0}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[PartialGrid, dict[str, Array], dict[str, Array]]:
    folder = tmp_path_factory.mktemp("culled")
    part = cull_land(GRID, LAND, largest=False, fill_bays=False)
    GRID.save(folder / "whole.nc", radius=2.0)
    part.save(folder / "part.nc", radius=2.0)
    return part, read(folder / "whole.nc"), read(folder / "part.nc")


def test_culled_meshes_connect_what_the_whole_one_does(files: Any) -> None:
    # What a culler must do, by its definition: an edge or a vertex stays if a cell of it does, 0 is what is gone.
    part, whole, culled = files
    cells = np.flatnonzero(part.kept) + 1
    edges = np.flatnonzero(np.isin(whole["cellsOnEdge"], cells).any(axis=1)) + 1
    vertices = np.flatnonzero(np.isin(whole["cellsOnVertex"], cells).any(axis=1)) + 1
    assert (len(culled["xCell"]), len(culled["xEdge"]), len(culled["xVertex"])) == (
        len(cells),
        len(edges),
        len(vertices),
    )
    kinds = {"cells": cells, "edges": edges, "vertices": vertices}
    olds = {"Cell": cells, "Edge": edges, "Vertex": vertices}
    for place, old in olds.items():
        for kind, kept in kinds.items():
            name = f"{kind}On{place}"
            if name not in whole:
                continue
            numbers = {int(was): new for new, was in enumerate(kept, 1)}
            for new, was in enumerate(old):
                expected = {numbers[i] for i in row(whole[name], was - 1) if i in numbers}
                assert row(culled[name], new) == expected, (name, new)


def test_culled_meshes_keep_areas_lengths_and_places_and_lose_kites_of_land(files: Any) -> None:
    part, whole, culled = files
    np.testing.assert_array_equal(culled["areaCell"], whole["areaCell"][part.kept])
    assert culled["kiteAreasOnVertex"].sum() == pytest.approx(culled["areaCell"].sum())
    np.testing.assert_allclose(culled["kiteAreasOnVertex"].sum(axis=1), culled["areaTriangle"])
    assert (culled["cellsOnEdge"][:, 0] > 0).all()
    assert ((culled["cellsOnEdge"][:, 1] == 0) == (culled["boundaryEdge"] == 1)).all()
    assert (culled["kiteAreasOnVertex"][culled["cellsOnVertex"] == 0] == 0).all()
    counts = (culled["edgesOnEdge"] > 0).sum(axis=1)
    assert (counts == culled["nEdgesOnEdge"]).all()


def test_angles_and_weights_follow_edges_that_are_turned(files: Any) -> None:
    _, whole, culled = files
    # A flow along parallels is through edges as the cosine of their angles, wherever its edges point.
    for mesh in (whole, culled):
        mesh["u"] = np.cos(mesh["latEdge"]) * np.cos(mesh["angleEdge"])
        used = mesh["edgesOnEdge"] > 0
        mesh["v"] = (mesh["weightsOnEdge"] * np.where(used, mesh["u"][mesh["edgesOnEdge"] - 1], 0)).sum(axis=1)
    places = {tuple(place): k for k, place in enumerate(np.stack([whole[f"{x}Edge"] for x in "xyz"], axis=1).tolist())}
    old = [places[tuple(p)] for p in np.stack([culled[f"{x}Edge"] for x in "xyz"], axis=1).tolist()]
    turned = np.cos(whole["angleEdge"][old] - culled["angleEdge"]) < 0
    whole_cells, there = whole["cellsOnEdge"][old], culled["nEdgesOnEdge"] == whole["nEdgesOnEdge"][old]
    assert 10 < turned.sum() < len(turned) / 4
    assert (culled["boundaryEdge"][turned] == 1).all()
    assert whole_cells.shape == (len(old), 2)
    np.testing.assert_allclose(culled["v"][there], np.where(turned, -1, 1)[there] * whole["v"][old][there], atol=1e-12)
    assert np.abs(culled["angleEdge"]).max() < np.pi + 1e-9


def test_only_the_largest_sea_stays() -> None:
    both, one = cull_land(GRID, wall, largest=False), cull_land(GRID, wall)
    assert one.points[:, 2].max() < np.sin(np.radians(10)) < both.points[:, 2].max()
    assert (both.kept & (GRID.points[:, 2] < 0) == one.kept & (GRID.points[:, 2] < 0)).all()


def test_straits_connect_seas() -> None:
    part = cull_land(GRID, wall, straits=[[[0, 0], [0, 40]]])
    assert part.points[:, 2].max() > 0.9
    points = cull_land(GRID, wall, straits=[[60, 20]], largest=False).points
    assert (points @ from_degrees(60, 20)[0]).max() > np.cos(np.radians(5))  # a cell is 8 degrees wide


def test_bays_of_single_cells_are_filled_and_what_is_then_one() -> None:
    sea = GRID.points[:, 2] < 0
    inland = np.flatnonzero(GRID.points[:, 2] > 0.3)[0]
    first = next(c for c in neighbors(inland) if GRID.points[c, 2] > 0.2)
    is_sea = sea | np.isin(np.arange(len(sea)), [inland, first])
    kept = cull_land(GRID, lambda _: ~is_sea).kept
    lonely = [c for c in np.flatnonzero(kept).tolist() if len([k for k in neighbors(c) if kept[k]]) <= 1]
    assert not lonely
    assert not kept[inland]
    assert cull_land(GRID, lambda _: ~is_sea, fill_bays=False, largest=False).kept[inland]


def test_land_is_a_map_polygons_or_a_function() -> None:
    lat = np.linspace(89.5, -89.5, 180)[:, None]
    ring = [[-180, 0], [180, 0], [180, 90], [-180, 90], [-180, 0]]
    polygons = {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    away = np.abs(GRID.points[:, 2]) > 0.02
    expected = GRID.points[:, 2] < 0
    for land in (np.broadcast_to(lat > 0, (180, 360)), polygons, lambda points: points[:, 2] > 0):
        assert (cull_land(GRID, land).kept == expected)[away].all()


def test_polygons_may_cross_the_antimeridian() -> None:
    ring = [[170, -10], [200, -10], [200, 10], [170, 10], [170, -10]]
    part = limit_area(GRID, {"type": "Polygon", "coordinates": [ring]}, layers=0)
    assert (part.kept == limit_area(GRID, Box(170, -10, -160, 10), layers=0).kept).all()


def test_layers_lead_outward_one_cell_after_the_other(tmp_path: Path) -> None:
    part = limit_area(GRID, Cap(10, 50, 20), layers=3)
    layers = np.full(len(GRID.points), 99)
    layers[part.kept] = part.layers
    assert ((layers == 0) == Cap(10, 50, 20)(GRID.points)).all()
    for cell in np.flatnonzero(part.kept & (layers > 0)).tolist():
        assert min(layers[list(neighbors(cell))]) == layers[cell] - 1
    part.save(tmp_path / "area.nc")
    mesh = read(tmp_path / "area.nc")
    assert (mesh["bdyMaskCell"] == part.layers).all()
    for place in ("Edge", "Vertex"):
        for cells, mask in zip(mesh[f"cellsOn{place}"], mesh[f"bdyMask{place}"], strict=True):
            assert mask == min(part.layers[c - 1] for c in cells if c)
    assert (mesh["bdyMaskCell"][mesh["boundaryCell"] == 1] == 3).all()


@pytest.mark.slow
def test_every_format_holds_a_part(tmp_path: Path) -> None:
    uxarray = pytest.importorskip("uxarray")
    part = limit_area(GRID, Box(-30, 20, 40, 60), layers=2)
    n = int(part.kept.sum())
    for end in (".nc", ".ugrid.nc", ".scrip.nc"):
        part.save(tmp_path / f"part{end}")
        assert uxarray.open_grid(tmp_path / f"part{end}").n_face == n
    for end in (".graph.info", ".csv", ".geojson", ".vtu"):
        part.save(tmp_path / f"part{end}")
    lines = (tmp_path / "part.graph.info").read_text().splitlines()
    assert lines[0] == f"{n} {sum(len(line.split()) for line in lines[1:]) // 2}"
    table = np.genfromtxt(tmp_path / "part.csv", delimiter=",", names=True)
    assert (table["boundary_layer"] == part.layers).all()


def test_the_land_of_the_earth_is_known() -> None:
    shape = shapely.geometry.shape(earth_land())
    for lon, lat, on_land in ((2, 48, True), (-30, 40, False), (181, 66.5, True), (0, -89, True), (50, 42, False)):
        assert shapely.contains_xy(shape, lon, lat) == on_land
    kept = cull_land(GRID, earth_land(), largest=False, fill_bays=False).kept
    beyond = shapely.contains_xy(shape, np.where(GRID.lon < 0, GRID.lon + 360, GRID.lon), GRID.lat)
    wrong = kept == (shapely.contains_xy(shape, GRID.lon, GRID.lat) | beyond)
    assert not wrong[np.abs(GRID.lat) < 89].any()  # a pole is on the boundary of the polygons
    assert np.average(kept, weights=GRID.areas) == pytest.approx(0.71, abs=0.02)
    steps = np.concatenate([np.abs(np.diff(line, axis=0)) for line in earth_coasts()])
    assert steps.max() < 15


def test_the_sea_of_a_region_has_its_layers(tmp_path: Path) -> None:
    sea = cull_land(GRID, LAND)
    area = limit_area(sea, Cap(60, 10, 30), layers=2)
    assert not (area.kept & ~sea.kept).any()
    assert (area.kept <= limit_area(GRID, Cap(60, 10, 30), layers=2).kept).all()
    assert set(area.layers.tolist()) == {0, 1, 2}
