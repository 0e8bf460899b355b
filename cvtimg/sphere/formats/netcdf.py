"""Grids as netCDF, in the classic format with 64-bit offsets, which every library reads: MPAS, UGRID and SCRIP."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, BinaryIO

import numpy as np

from cvtimg._shared.choices import Options
from cvtimg._shared.types import Array, Floats
from cvtimg.sphere.formats.geometry import GridContent, Indices, latitudes_longitudes

#: Flags of cells that a grid may have.
FLAGS = {
    "land": "1 on land",
    "coast": "1 on the coast",
    "boundary_layer": "0 inside, 1, 2, ... in layers along the boundary",
}
#: Types of netCDF's classic format.
_TYPES = {"f": np.float64, "i": np.int32}


@dataclass(frozen=True, slots=True, eq=False)
class Variable:
    """A variable: its dimensions, values and attributes, and how values change when they are written."""

    dimensions: tuple[str, ...]
    values: Any
    attributes: Options = field(default_factory=dict)
    change: Callable[[Any], Any] = np.asarray


class _Changed:
    """Values as `netcdf_file` asks for them, changed only then: those of large grids are not in memory all at once."""

    def __init__(self, empty: Array, variable: Variable) -> None:
        self.shape, self.size, self.dtype, self.itemsize = empty.shape, empty.size, empty.dtype, empty.itemsize
        self._variable = variable

    def tobytes(self) -> Any:
        changed = self._variable.change(self._variable.values)
        return np.ascontiguousarray(changed, self.dtype).data


def write_netcdf(
    file: BinaryIO, dimensions: Mapping[str, int | None], variables: Mapping[str, Variable], attributes: Options
) -> None:
    """Write a netCDF file; the first dimension may be None: unlimited."""
    from scipy.io import netcdf_file

    class LargeFile(netcdf_file):  # type: ignore[misc]
        def _pack_int(self, value: int) -> None:  # the sizes of variables have all 32 bits
            self.fp.write(np.array(value, ">u4").tobytes())

    with LargeFile(file, "w", version=2) as content:
        for name, length in dimensions.items():
            content.createDimension(name, length)
        for name, variable in variables.items():
            dtype = _TYPES[np.asarray(variable.values).dtype.kind]
            created = content.createVariable(name, dtype, variable.dimensions)
            created.__dict__["data"] = _Changed(created.data, variable)
            _describe(created, variable.attributes)
        _describe(content, attributes)


def _describe(described: object, attributes: Options) -> None:
    """Set attributes; floating point numbers in double precision, as other programs read them."""
    for key, value in attributes.items():
        setattr(described, key, np.float64(value) if isinstance(value, float) else value)


def write_mpas(file: BinaryIO, grid: GridContent) -> None:
    """Write a mesh of the Model for Prediction Across Scales, which ocean and atmosphere models start from.

    MPAS Mesh Specification, version 1.0 (2015). Indices begin with 1; 0 stands for none.
    """
    around, geometry = grid.around, grid.geometry
    edges_on_edge, weights = grid.tangential
    most = around.cells_on_cell.shape[1]
    dimensions = {
        "Time": None,
        "nCells": len(grid.points),
        "nEdges": len(around.cells_on_edge),
        "nVertices": len(geometry.vertices),
        "maxEdges": most,
        "maxEdges2": 2 * most,
        "TWO": 2,
        "vertexDegree": 3,
    }
    radius, area = partial(np.multiply, grid.radius), partial(np.multiply, grid.radius**2)
    from_one = partial(np.add, np.int32(1))
    variables = {}
    for name, places in (("Cell", grid.points), ("Edge", geometry.edges), ("Vertex", geometry.vertices)):
        along: tuple[str, ...] = ({"Cell": "nCells", "Edge": "nEdges", "Vertex": "nVertices"}[name],)
        variables[f"lat{name}"] = Variable(along, places, change=lambda places: latitudes_longitudes(places)[0])
        variables[f"lon{name}"] = Variable(along, places, change=lambda places: latitudes_longitudes(places)[1])
        for axis, coordinates in zip("xyz", places.T, strict=True):
            variables[f"{axis}{name}"] = Variable(along, coordinates, change=radius)
        variables[f"indexTo{name}ID"] = Variable(along, np.arange(1, len(places) + 1, dtype=np.int32))
    cells, cell_table = ("nCells",), ("nCells", "maxEdges")
    edges, edge_pairs, edge_table = ("nEdges",), ("nEdges", "TWO"), ("nEdges", "maxEdges2")
    vertices, vertex_table = ("nVertices",), ("nVertices", "vertexDegree")
    variables |= {
        "nEdgesOnCell": Variable(cells, around.degrees),
        "nEdgesOnEdge": Variable(edges, (edges_on_edge >= 0).sum(axis=1, dtype=np.int32)),
        "cellsOnCell": Variable(cell_table, around.cells_on_cell, change=from_one),
        "edgesOnCell": Variable(cell_table, around.edges_on_cell, change=from_one),
        "verticesOnCell": Variable(cell_table, around.vertices_on_cell, change=from_one),
        "cellsOnEdge": Variable(edge_pairs, around.cells_on_edge, change=from_one),
        "verticesOnEdge": Variable(edge_pairs, around.vertices_on_edge, change=from_one),
        "edgesOnEdge": Variable(edge_table, edges_on_edge, change=from_one),
        "weightsOnEdge": Variable(edge_table, weights),
        "cellsOnVertex": Variable(vertex_table, around.cells_on_vertex, change=from_one),
        # Entry k is the edge between cells k - 1 and k, as the official converter has it.
        "edgesOnVertex": Variable(vertex_table, np.roll(around.edges_on_vertex, 1, axis=1), change=from_one),
        "kiteAreasOnVertex": Variable(vertex_table, geometry.kites, change=area),
        "areaCell": Variable(cells, geometry.cell_areas, change=area),
        "areaTriangle": Variable(vertices, geometry.triangle_areas, change=area),
        "dcEdge": Variable(edges, geometry.cell_distances, change=radius),
        "dvEdge": Variable(edges, geometry.edge_lengths, change=radius),
        "angleEdge": Variable(edges, geometry.angles),
        "meshDensity": Variable(cells, grid.density / grid.density.max()),
    }
    variables |= _masks(grid)
    attributes = {
        "on_a_sphere": "YES",
        "sphere_radius": float(grid.radius),
        "is_periodic": "NO",
        "mesh_spec": "1.0",
        "Conventions": "MPAS",
        "source": "cvtimg",
        "file_id": grid.identity,
        "history": "",
        **grid.attributes,
    }
    write_netcdf(file, dimensions, variables, attributes)


#: Names of flags of cells in files of MPAS; MpasCellCuller removes cells whose cullCell is 1.
_MPAS_FLAGS = {"land": "cullCell", "coast": "coastCell"}


def _masks(grid: GridContent) -> dict[str, Variable]:
    """Return flags of cells, and of edges and vertices where there is a boundary."""
    around = grid.around
    flags = grid.flags
    masks = {mask: Variable(("nCells",), flags[name]) for name, mask in _MPAS_FLAGS.items() if name in flags}
    tables = {"Edge": ("nEdges", around.cells_on_edge), "Vertex": ("nVertices", around.cells_on_vertex)}
    layers = flags.get("boundary_layer")
    if layers is not None:  # an edge or a vertex is in the innermost layer of its cells
        masks["bdyMaskCell"] = Variable(("nCells",), layers)
        for place, (along, cells) in tables.items():
            innermost = np.where(cells >= 0, layers[cells], layers.max()).min(axis=1)
            masks[f"bdyMask{place}"] = Variable((along,), innermost)
    if (around.cells_on_edge < 0).any():
        is_neighbor = np.arange(around.cells_on_cell.shape[1]) < around.degrees[:, None]
        tables["Cell"] = "nCells", np.where(is_neighbor, around.cells_on_cell, 0)
        for place, (along, cells) in tables.items():
            masks[f"boundary{place}"] = Variable((along,), (cells < 0).any(axis=1).astype(np.int32))
    return masks


def write_ugrid(file: BinaryIO, grid: GridContent) -> None:
    """Write the UGRID conventions, version 1.0: coordinates in degrees, indices from 0."""
    around, geometry = grid.around, grid.geometry
    dimensions = {
        "n_face": len(grid.points),
        "n_node": len(geometry.vertices),
        "n_edge": len(around.cells_on_edge),
        "n_max_face_nodes": around.cells_on_cell.shape[1],
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
        indices = {"cf_role": roles[name], "start_index": np.int32(0), "_FillValue": np.int32(-1)}
        variables[name] = Variable(along, table, indices)
    areas = geometry.cell_areas * grid.radius**2
    for name, values, text in (
        ("face_area", areas, "area of cells"),
        ("density", grid.density, "density at generators"),
        *((name, flags, FLAGS[name]) for name, flags in grid.flags.items()),
    ):
        variables[name] = Variable(("n_face",), values, {"long_name": text, "mesh": "mesh", "location": "face"})
    attributes = {"Conventions": "CF-1.8 UGRID-1.0", "source": "cvtimg", "sphere_radius": float(grid.radius)}
    write_netcdf(file, dimensions, variables, {**attributes, **grid.attributes})


def write_scrip(file: BinaryIO, grid: GridContent) -> None:
    """Write the format of SCRIP and ESMF's tools: cells by their corners, areas in steradians.

    SCRIP has no fill value: cells with fewer corners than others repeat their last one, as MPAS-Tools writes it.
    """
    around, geometry = grid.around, grid.geometry
    last = around.vertices_on_cell[np.arange(len(grid.points)), around.degrees - 1]
    corners = np.where(around.vertices_on_cell < 0, last[:, None], around.vertices_on_cell)
    latitudes, longitudes = latitudes_longitudes(geometry.vertices)
    center_latitudes, center_longitudes = latitudes_longitudes(grid.points)
    size, table = ("grid_size",), ("grid_size", "grid_corners")
    radians, land = {"units": "radians"}, grid.flags.get("land", np.zeros(len(grid.points), np.int32))
    variables = {
        "grid_dims": Variable(("grid_rank",), np.array([len(grid.points)], np.int32)),
        "grid_center_lat": Variable(size, center_latitudes, radians),
        "grid_center_lon": Variable(size, center_longitudes, radians),
        "grid_corner_lat": Variable(table, latitudes[corners], radians),
        "grid_corner_lon": Variable(table, longitudes[corners], radians),
        "grid_imask": Variable(size, 1 - land, {"units": "unitless"}),
        "grid_area": Variable(size, geometry.cell_areas, {"units": "radians^2"}),
    }
    dimensions = {"grid_size": len(grid.points), "grid_corners": corners.shape[1], "grid_rank": 1}
    attributes = {"Conventions": "SCRIP", "title": "cvtimg", "source": "cvtimg", **grid.attributes}
    write_netcdf(file, dimensions, variables, attributes)


def _coordinates(name: str, places: Floats) -> dict[str, Variable]:
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
