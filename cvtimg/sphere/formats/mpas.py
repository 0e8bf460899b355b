"""Meshes of the Model for Prediction Across Scales (MPAS), which ocean and atmosphere models start from.

MPAS Mesh Specification, version 1.0 (2015). Indices begin with 1; 0 stands for none.
"""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from cvtimg.sphere.formats.geometry import GridContent, latitudes_longitudes, tangential_weights
from cvtimg.sphere.formats.netcdf import Variable, write_netcdf


def write_mpas(file: BinaryIO, grid: GridContent) -> None:
    """Write all dimensions, variables and attributes of the specification."""
    around, geometry = grid.around, grid.geometry
    edges_on_edge, weights = tangential_weights(around, geometry)
    most = around.outgoing.shape[1]
    dimensions = {
        "Time": None,
        "nCells": len(grid.points),
        "nEdges": len(around.halves),
        "nVertices": len(grid.triangles),
        "maxEdges": most,
        "maxEdges2": 2 * most,
        "TWO": 2,
        "vertexDegree": 3,
    }
    variables = {}
    for name, places in (("Cell", grid.points), ("Edge", geometry.edges), ("Vertex", geometry.vertices)):
        along: tuple[str, ...] = ({"Cell": "nCells", "Edge": "nEdges", "Vertex": "nVertices"}[name],)
        latitudes, longitudes = latitudes_longitudes(places)
        variables[f"lat{name}"] = Variable(along, latitudes)
        variables[f"lon{name}"] = Variable(along, longitudes)
        for axis, coordinates in zip("xyz", places.T, strict=True):
            variables[f"{axis}{name}"] = Variable(along, coordinates * grid.radius)
        variables[f"indexTo{name}ID"] = Variable(along, np.arange(1, len(places) + 1, dtype=np.int32))
    cells, cell_table = ("nCells",), ("nCells", "maxEdges")
    edges, edge_pairs, edge_table = ("nEdges",), ("nEdges", "TWO"), ("nEdges", "maxEdges2")
    vertices, vertex_table = ("nVertices",), ("nVertices", "vertexDegree")
    area = grid.radius**2
    variables |= {
        "nEdgesOnCell": Variable(cells, around.degrees),
        "nEdgesOnEdge": Variable(edges, (edges_on_edge >= 0).sum(axis=1, dtype=np.int32)),
        "cellsOnCell": Variable(cell_table, around.cells_on_cell + 1),
        "edgesOnCell": Variable(cell_table, around.edges_on_cell + 1),
        "verticesOnCell": Variable(cell_table, around.vertices_on_cell + 1),
        "cellsOnEdge": Variable(edge_pairs, around.cells_on_edge + 1),
        "verticesOnEdge": Variable(edge_pairs, around.vertices_on_edge + 1),
        "edgesOnEdge": Variable(edge_table, edges_on_edge + 1),
        "weightsOnEdge": Variable(edge_table, weights),
        "cellsOnVertex": Variable(vertex_table, around.cells_on_vertex + 1),
        # Entry k is the edge between cells k - 1 and k, as the official converter has it.
        "edgesOnVertex": Variable(vertex_table, np.roll(around.edges_on_vertex, 1, axis=1) + 1),
        "kiteAreasOnVertex": Variable(vertex_table, geometry.kites * area),
        "areaCell": Variable(cells, geometry.cell_areas * area),
        "areaTriangle": Variable(vertices, geometry.triangle_areas * area),
        "dcEdge": Variable(edges, geometry.cell_distances * grid.radius),
        "dvEdge": Variable(edges, geometry.edge_lengths * grid.radius),
        "angleEdge": Variable(edges, geometry.angles),
        "meshDensity": Variable(cells, grid.density / grid.density.max()),
    }
    attributes = {
        "on_a_sphere": "YES",
        "sphere_radius": float(grid.radius),
        "is_periodic": "NO",
        "mesh_spec": "1.0",
        "Conventions": "MPAS",
        "source": "cvtimg",
        "file_id": _identity(grid),
        "history": "",
    }
    write_netcdf(file, dimensions, variables, attributes)


def _identity(grid: GridContent) -> str:
    """Ten characters that stand for the grid: a hash, so that equal grids have equal files."""
    from hashlib import sha256

    return sha256(grid.points.tobytes() + grid.triangles.tobytes()).hexdigest()[:10]
