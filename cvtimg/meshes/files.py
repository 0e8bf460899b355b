"""Mesh files: VTU, OBJ with groups and PLY are written here, others by meshio."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice
from cvtimg._shared.extras import needs
from cvtimg.files.vtu import TETRAHEDRON, TRIANGLE, TRIANGLE6, vtu_content
from cvtimg.files.whole import StrPath, scratch_folder, write_whole

#: What meshio is asked for, beside the formats below, and how.
_MESHIO: dict[str, dict[str, Any]] = {
    ".msh": {"file_format": "gmsh22", "binary": False},
    ".stl": {"binary": True},
    ".bdf": {},
    ".inp": {},
    ".med": {},
    ".mesh": {},
    ".off": {},
    ".vtk": {},
    ".xdmf": {"data_format": "XML"},
}
#: Those that have no triangles with six nodes.
_STRAIGHT = (".obj", ".ply", ".stl", ".mesh", ".off")
#: Cells, and what is on their sides: VTK's number and meshio's name.
_CELLS = {"triangle": (TRIANGLE, "line"), "tetra": (TETRAHEDRON, "triangle"), "triangle6": (TRIANGLE6, "line3")}


@dataclass(frozen=True, slots=True, eq=False)
class MeshContent:
    """What files hold of a mesh of triangles or tetrahedra."""

    points: NDArray[np.float64]  # (N, 2) or (N, 3)
    cells: NDArray[np.int32]  # (T, 3), (T, 4), or (T, 6) for triangles with nodes in the middle of edges
    tags: NDArray[np.int32]  # (T,)
    sides: NDArray[np.int32]  # (E, 2) or (E, 3): edges on borders, with their middle, or triangles of the surface
    qualities: NDArray[np.float64] | None = None  # (T,)
    side_tags: NDArray[np.int32] | None = None  # (E,): 1 by default
    names: Mapping[tuple[int, int], str] = field(default_factory=dict)  # Of the dimension and the tag of cells

    @property
    def kind(self) -> str:
        """What cells are, as meshio calls them."""
        return {3: "triangle", 4: "tetra", 6: "triangle6"}[self.cells.shape[1]]

    @property
    def places(self) -> NDArray[np.float64]:
        """Points (N, 3), where those of the plane have z = 0."""
        return np.pad(self.points, ((0, 0), (0, 3 - self.points.shape[1])))


def suffixes(kind: str = "triangle") -> tuple[str, ...]:
    """Return the suffixes of files that meshes of triangles, or of "triangle6", are written to."""
    found = (*MESH_FORMATS, *_MESHIO)
    return found if kind == "triangle" else tuple(suffix for suffix in found if suffix not in _STRAIGHT)


def write_mesh(path: StrPath, mesh: MeshContent, overwrite: bool, allowed: tuple[str, ...] | None = None) -> None:
    """Write a mesh in the format that the suffix picks."""
    suffix = check_choice("suffix", Path(path).suffix.lower(), allowed or suffixes())
    content = MESH_FORMATS[suffix](mesh) if suffix in MESH_FORMATS else _by_meshio(mesh, path, suffix)
    write_whole(path, content, overwrite=overwrite)


def _vtu(mesh: MeshContent) -> bytes:
    """VTK's format of unstructured grids."""
    n_corners = mesh.cells.shape[1]
    values: dict[str, NDArray[Any]] = {} if mesh.qualities is None else {"tag": mesh.tags, "quality": mesh.qualities}
    ends = n_corners * np.arange(1, len(mesh.cells) + 1)
    return vtu_content(mesh.places, mesh.cells, ends, _CELLS[mesh.kind][0], values)


def _obj(mesh: MeshContent) -> bytes:
    """Wavefront's format: a group for each tag."""
    parts = [rows_of("v %.17g %.17g %g\n", mesh.places)]
    for tag in np.unique(mesh.tags):
        parts.append(f"g {tag}\n" + rows_of("f %d %d %d\n", mesh.cells[mesh.tags == tag] + 1))
    return "".join(parts).encode()


def _ply(mesh: MeshContent) -> bytes:
    """Stanford's format, binary, with double precision; without tags, which not all readers skip."""
    head = [
        "ply\nformat binary_little_endian 1.0\ncomment cvtimg",
        f"element vertex {len(mesh.points)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(mesh.cells)}",
        "property list uchar int vertex_indices\nend_header\n",
    ]
    faces = np.empty(len(mesh.cells), [("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, mesh.cells
    return "\n".join(head).encode() + mesh.places.astype("<f8").tobytes() + faces.tobytes()


#: The registry of formats: suffix to the function that makes the content.
MESH_FORMATS: dict[str, Callable[[MeshContent], bytes]] = {".vtu": _vtu, ".obj": _obj, ".ply": _ply}


def _by_meshio(mesh: MeshContent, path: StrPath, suffix: str) -> bytes:
    try:
        import meshio
    except ImportError as error:
        raise ImportError(f"{path}: {suffix} needs {needs('meshio', 'mesh')}") from error
    cells, data, names = [(mesh.kind, mesh.cells)], {"tag": [mesh.tags]}, {}
    if suffix == ".msh" and len(
        mesh.sides
    ):  # borders or the surface are the physical group 1 of their dimension, and tags are groups
        cells = [(_CELLS[mesh.kind][1], mesh.sides), *cells]
        dimension, name, inside = (2, "surface", "inside") if mesh.kind == "tetra" else (1, "border", None)
        of_sides = np.ones(len(mesh.sides), np.int32) if mesh.side_tags is None else mesh.side_tags
        tags = [of_sides, mesh.tags]
        data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
        keys = [
            *((dimension, tag) for tag in np.unique(of_sides)),
            *((dimension + 1, tag) for tag in np.unique(mesh.tags)),
        ]
        usual = {dimension: name, dimension + 1: inside}
        names = {mesh.names.get(key) or usual[key[0]] or str(key[1]): np.array(key[::-1]) for key in keys}
    with scratch_folder(path) as folder:
        part = folder / f"mesh{suffix}"
        meshio.Mesh(mesh.places, cells, cell_data=data, field_data=names).write(part, **_MESHIO[suffix])
        return part.read_bytes()


def rows_of(form: str, rows: NDArray[np.generic]) -> str:
    """Write each row of numbers by a form."""
    return (form * len(rows)) % tuple(rows.ravel().tolist())
