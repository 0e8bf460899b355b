"""Unstructured grids as climate tools read them: UGRID 1.0 and SCRIP, with the Voronoi cells as faces."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from cvtimg.sphere.formats.connectivity import Indices
from cvtimg.sphere.formats.geometry import GridContent, Values, latitudes_longitudes
from cvtimg.sphere.formats.netcdf import Variable, write_netcdf


def write_ugrid(file: BinaryIO, grid: GridContent) -> None:
    """Write the UGRID conventions, version 1.0: coordinates in degrees, indices from 0."""
    around, geometry = grid.around, grid.geometry
    dimensions = {
        "n_face": len(grid.points),
        "n_node": len(grid.triangles),
        "n_edge": len(around.halves),
        "n_max_face_nodes": around.outgoing.shape[1],
        "two": 2,
    }
    # The edge and the face after node j, as the conventions have it.
    tables: dict[str, tuple[tuple[str, ...], Indices]] = {
        "face_nodes": (("n_face", "n_max_face_nodes"), around.vertices_on_cell),
        "face_edges": (("n_face", "n_max_face_nodes"), _moved_by_one(around.edges_on_cell, around.degrees)),
        "face_faces": (("n_face", "n_max_face_nodes"), _moved_by_one(around.cells_on_cell, around.degrees)),
        "edge_nodes": (("n_edge", "two"), around.vertices_on_edge),
        "edge_faces": (("n_edge", "two"), around.cells_on_edge),
    }
    roles = {name: f"{name.removesuffix('s')}_connectivity" for name in tables}
    mesh = {
        "cf_role": "mesh_topology",
        "long_name": "Voronoi cells of the generators",
        "topology_dimension": np.int32(2),
        **{f"{place}_coordinates": f"{place}_lon {place}_lat" for place in ("node", "face", "edge")},
        **{role: name for name, role in roles.items()},
        "face_dimension": "n_face",
        "edge_dimension": "n_edge",
    }
    variables = {
        "mesh": Variable((), np.int32(0), mesh),
        **_coordinates("node", geometry.vertices),
        **_coordinates("face", grid.points),
        **_coordinates("edge", geometry.edges),
    }
    for name, (along, table) in tables.items():
        variables[name] = Variable(
            along, table, {"cf_role": roles[name], "start_index": np.int32(0), "_FillValue": np.int32(-1)}
        )
    areas = geometry.cell_areas * grid.radius**2
    for name, values, text in (
        ("face_area", areas, "area of cells"),
        ("density", grid.density, "density at generators"),
    ):
        variables[name] = Variable(("n_face",), values, {"long_name": text, "mesh": "mesh", "location": "face"})
    attributes = {"Conventions": "CF-1.8 UGRID-1.0", "source": "cvtimg", "sphere_radius": float(grid.radius)}
    write_netcdf(file, dimensions, variables, attributes)


def write_scrip(file: BinaryIO, grid: GridContent) -> None:
    """Write the format of SCRIP and ESMF's tools: cells by their corners, areas in steradians.

    Cells with fewer corners than others repeat their last one.
    """
    around, geometry = grid.around, grid.geometry
    last = around.vertices_on_cell[np.arange(len(grid.points)), around.degrees - 1]
    corners = np.where(around.vertices_on_cell < 0, last[:, None], around.vertices_on_cell)
    latitudes, longitudes = latitudes_longitudes(geometry.vertices)
    center_latitudes, center_longitudes = latitudes_longitudes(grid.points)
    size, table = ("grid_size",), ("grid_size", "grid_corners")
    radians = {"units": "radians"}
    variables = {
        "grid_dims": Variable(("grid_rank",), np.array([len(grid.points)], np.int32)),
        "grid_center_lat": Variable(size, center_latitudes, radians),
        "grid_center_lon": Variable(size, center_longitudes, radians),
        "grid_corner_lat": Variable(table, latitudes[corners], radians),
        "grid_corner_lon": Variable(table, longitudes[corners], radians),
        "grid_imask": Variable(size, np.ones(len(grid.points), np.int32), {"units": "unitless"}),
        "grid_area": Variable(size, geometry.cell_areas, {"units": "radians^2"}),
    }
    dimensions = {"grid_size": len(grid.points), "grid_corners": corners.shape[1], "grid_rank": 1}
    write_netcdf(file, dimensions, variables, {"Conventions": "SCRIP", "title": "cvtimg", "source": "cvtimg"})


def _coordinates(name: str, places: Values) -> dict[str, Variable]:
    latitudes, longitudes = (np.degrees(angles) for angles in latitudes_longitudes(places))
    return {
        f"{name}_lat": Variable((f"n_{name}",), latitudes, {"standard_name": "latitude", "units": "degrees_north"}),
        f"{name}_lon": Variable((f"n_{name}",), longitudes, {"standard_name": "longitude", "units": "degrees_east"}),
    }


def _moved_by_one(table: Indices, degrees: Indices) -> Indices:
    """Begin each row of a table about neighbors with its second entry, and end it with the first."""
    moved = np.roll(table, -1, axis=1)
    moved[:, -1] = -1
    moved[np.arange(len(table)), degrees - 1] = table[:, 0]
    return moved
