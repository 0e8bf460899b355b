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
from cvtimg.files.vtu import TETRAHEDRON, TRIANGLE, vtu_content
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


@dataclass(frozen=True, slots=True, eq=False)
class MeshContent:
    """What files hold of a mesh of triangles or tetrahedra."""

    points: NDArray[np.float64]  # (N, 2) or (N, 3)
    cells: NDArray[np.int32]  # (T, 3) or (T, 4)
    tags: NDArray[np.int32]  # (T,)
    sides: NDArray[np.int32]  # (E, 2) or (E, 3): edges on borders, or triangles of the surface
    qualities: NDArray[np.float64] | None = None  # (T,)
    side_tags: NDArray[np.int32] | None = None  # (E,): 1 by default
    names: Mapping[tuple[int, int], str] = field(default_factory=dict)  # Of the dimension and the tag of cells

    @property
    def places(self) -> NDArray[np.float64]:
        """Points (N, 3), where those of the plane have z = 0."""
        return np.pad(self.points, ((0, 0), (0, 3 - self.points.shape[1])))


def suffixes() -> tuple[str, ...]:
    """Return the suffixes of files that meshes of triangles are written to."""
    return (*MESH_FORMATS, *_MESHIO)


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
    return vtu_content(mesh.places, mesh.cells, ends, TRIANGLE if n_corners == 3 else TETRAHEDRON, values)


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
    cells, data, names = [("triangle" if mesh.cells.shape[1] == 3 else "tetra", mesh.cells)], {"tag": [mesh.tags]}, {}
    if suffix == ".msh" and len(
        mesh.sides
    ):  # borders or the surface are the physical group 1 of their dimension, and tags are groups
        kind, name, inside = ("line", "border", None) if mesh.cells.shape[1] == 3 else ("triangle", "surface", "inside")
        cells = [(kind, mesh.sides), *cells]
        of_sides = np.ones(len(mesh.sides), np.int32) if mesh.side_tags is None else mesh.side_tags
        tags = [of_sides, mesh.tags]
        data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
        dimension = mesh.sides.shape[1] - 1
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
