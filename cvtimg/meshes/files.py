"""Mesh files: VTU, Gmsh's MSH, OBJ, PLY and STL are written here, others by meshio."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice
from cvtimg._shared.extras import needs
from cvtimg.files.vtu import TRIANGLE, vtu_content
from cvtimg.files.whole import StrPath, scratch_folder, write_whole

#: What meshio is asked for, beside the formats below.
MESHIO_SUFFIXES = (".bdf", ".inp", ".med", ".mesh", ".off", ".vtk", ".xdmf")


@dataclass(frozen=True, slots=True, eq=False)
class MeshContent:
    """What files hold of a mesh: the arrays of `Mesh`, with points of the plane or of space, and qualities (T,)."""

    points: NDArray[np.float64]
    triangles: NDArray[np.int32]
    tags: NDArray[np.int32]
    edges: NDArray[np.int32]
    qualities: NDArray[np.float64]


def suffixes() -> tuple[str, ...]:
    """Return the suffixes of files that meshes are written to."""
    return (*MESH_FORMATS, *MESHIO_SUFFIXES)


def write_mesh(path: StrPath, mesh: MeshContent, overwrite: bool) -> None:
    """Write a mesh in the format that the suffix picks."""
    suffix = Path(path).suffix.lower()
    check_choice("suffix", suffix, suffixes())
    content = MESH_FORMATS[suffix](mesh) if suffix in MESH_FORMATS else _by_meshio(mesh, path, suffix)
    write_whole(path, content, overwrite=overwrite)


def _vtu(mesh: MeshContent) -> bytes:
    """VTK's format of unstructured grids."""
    ends = 3 * np.arange(1, len(mesh.triangles) + 1)
    values: dict[str, NDArray[Any]] = {"tag": mesh.tags, "quality": mesh.qualities}
    return vtu_content(_in_space(mesh.points), mesh.triangles, ends, TRIANGLE, values)


def _msh(mesh: MeshContent) -> bytes:
    """Gmsh's format 2.2, which most readers know: border edges, then triangles; the physical group is the tag.

    Border edges are in one group of dimension 1; its number is 1.
    """
    n, n_edges, n_triangles = len(mesh.points), len(mesh.edges), len(mesh.triangles)
    tags = np.unique(mesh.tags)
    names = ['1 1 "border"', *(f'2 {tag} "{tag}"' for tag in tags)]
    edges = np.column_stack([np.arange(1, n_edges + 1), np.tile([1, 2, 1, 1], (n_edges, 1)), mesh.edges + 1])
    kinds = np.column_stack([np.full(n_triangles, 2), np.full(n_triangles, 2), mesh.tags, mesh.tags])
    numbers = np.arange(n_edges + 1, n_edges + n_triangles + 1)
    triangles = np.column_stack([numbers, kinds, mesh.triangles + 1])
    parts = [
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n",
        f"$PhysicalNames\n{len(names)}\n" + "\n".join(names) + "\n$EndPhysicalNames\n",
        f"$Nodes\n{n}\n",
        rows_of("%d %.17g %.17g %g\n", np.column_stack([np.arange(1, n + 1), _in_space(mesh.points)])),
        f"$EndNodes\n$Elements\n{n_edges + n_triangles}\n",
        rows_of("%d %d %d %d %d %d %d\n", edges),
        rows_of("%d %d %d %d %d %d %d %d\n", triangles),
        "$EndElements\n",
    ]
    return "".join(parts).encode()


def _obj(mesh: MeshContent) -> bytes:
    """Wavefront's format: a group for each tag."""
    parts = [rows_of("v %.17g %.17g %g\n", _in_space(mesh.points))]
    for tag in np.unique(mesh.tags):
        parts.append(f"g {tag}\n" + rows_of("f %d %d %d\n", mesh.triangles[mesh.tags == tag] + 1))
    return "".join(parts).encode()


def _stl(mesh: MeshContent) -> bytes:
    """Triangles with single precision."""
    corners = _in_space(mesh.points)[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facets = np.zeros(len(mesh.triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    facets["normal"] = normals / np.where(lengths > 0, lengths, 1)
    facets["corners"] = corners
    return b"cvtimg".ljust(80) + np.array(len(facets), "<u4").tobytes() + facets.tobytes()


def _ply(mesh: MeshContent) -> bytes:
    """Stanford's format, binary, with double precision; without tags, which not all readers skip."""
    head = [
        "ply\nformat binary_little_endian 1.0\ncomment cvtimg",
        f"element vertex {len(mesh.points)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(mesh.triangles)}",
        "property list uchar int vertex_indices\nend_header\n",
    ]
    faces = np.empty(len(mesh.triangles), [("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, mesh.triangles
    return "\n".join(head).encode() + _in_space(mesh.points).astype("<f8").tobytes() + faces.tobytes()


#: The registry of formats: suffix to the function that makes the content.
MESH_FORMATS: dict[str, Callable[[MeshContent], bytes]] = {
    ".vtu": _vtu,
    ".msh": _msh,
    ".obj": _obj,
    ".ply": _ply,
    ".stl": _stl,
}


def _by_meshio(mesh: MeshContent, path: StrPath, suffix: str) -> bytes:
    try:
        import meshio
    except ImportError as error:
        raise ImportError(f"{path}: {suffix} needs {needs('meshio', 'mesh')}") from error
    with scratch_folder(path) as folder:
        part = folder / f"mesh{suffix}"
        points = _in_space(mesh.points)
        options = {"data_format": "XML"} if suffix == ".xdmf" else {}
        meshio.Mesh(points, [("triangle", mesh.triangles)], cell_data={"tag": [mesh.tags]}).write(part, **options)
        return part.read_bytes()


def _in_space(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) points, where those of the plane have z = 0."""
    return points if points.shape[1] == 3 else np.column_stack([points, np.zeros(len(points))])


def rows_of(form: str, rows: NDArray[np.generic]) -> str:
    """Write each row of numbers by a form."""
    return (form * len(rows)) % tuple(rows.ravel().tolist())
