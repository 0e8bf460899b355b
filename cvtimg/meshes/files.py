"""Mesh files: VTU, Gmsh's MSH, OBJ and STL are written here, others by meshio."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice
from cvtimg.files.whole import StrPath, scratch_folder, write_whole

#: What meshio is asked for, beside the formats below.
MESHIO_SUFFIXES = (".bdf", ".inp", ".med", ".mesh", ".off", ".ply", ".vtk", ".xdmf")


@dataclass(frozen=True, slots=True, eq=False)
class MeshContent:
    """What files hold of a mesh: the arrays of `Mesh`, and the qualities (T,) of its triangles."""

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
    """VTK's format of unstructured grids, in XML with binary arrays."""
    n, n_triangles = len(mesh.points), len(mesh.triangles)
    arrays = [
        ("points", _in_space(mesh.points).astype("<f8"), "Float64", 3),
        ("connectivity", mesh.triangles.astype("<i4"), "Int32", 1),
        ("offsets", (3 * np.arange(1, n_triangles + 1)).astype("<i4"), "Int32", 1),
        ("types", np.full(n_triangles, 5, np.uint8), "UInt8", 1),
        ("tag", mesh.tags.astype("<i4"), "Int32", 1),
        ("quality", mesh.qualities.astype("<f8"), "Float64", 1),
    ]
    lines, blocks, offset = {}, [], 0
    for name, array, kind, width in arrays:
        lines[name] = (
            f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" format="appended" offset="{offset}"/>'
        )
        block = array.tobytes()
        blocks += [np.array(len(block), "<u8").tobytes(), block]
        offset += 8 + len(block)
    head = "\n".join(
        [
            '<?xml version="1.0"?>',
            '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
            f'<UnstructuredGrid><Piece NumberOfPoints="{n}" NumberOfCells="{n_triangles}">',
            f"<Points>{lines['points']}</Points>",
            f"<Cells>{lines['connectivity']}{lines['offsets']}{lines['types']}</Cells>",
            f'<CellData Scalars="tag">{lines["tag"]}{lines["quality"]}</CellData>',
            "</Piece></UnstructuredGrid>",
            '<AppendedData encoding="raw">_',
        ]
    )
    return b"".join([head.encode(), *blocks, b"\n</AppendedData></VTKFile>\n"])


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
        _rows("%d %.17g %.17g %g\n", np.column_stack([np.arange(1, n + 1), _in_space(mesh.points)])),
        f"$EndNodes\n$Elements\n{n_edges + n_triangles}\n",
        _rows("%d %d %d %d %d %d %d\n", edges),
        _rows("%d %d %d %d %d %d %d %d\n", triangles),
        "$EndElements\n",
    ]
    return "".join(parts).encode()


def _obj(mesh: MeshContent) -> bytes:
    """Wavefront's format: a group for each tag."""
    parts = [_rows("v %.17g %.17g %g\n", _in_space(mesh.points))]
    for tag in np.unique(mesh.tags):
        parts.append(f"g {tag}\n" + _rows("f %d %d %d\n", mesh.triangles[mesh.tags == tag] + 1))
    return "".join(parts).encode()


def _stl(mesh: MeshContent) -> bytes:
    """Triangles with single precision, the normal up."""
    facets = np.zeros(len(mesh.triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    facets["normal"] = [0, 0, 1]
    facets["corners"] = _in_space(mesh.points)[mesh.triangles]
    return b"cvtimg".ljust(80) + np.array(len(facets), "<u4").tobytes() + facets.tobytes()


#: The registry of formats: suffix to the function that makes the content.
MESH_FORMATS: dict[str, Callable[[MeshContent], bytes]] = {".vtu": _vtu, ".msh": _msh, ".obj": _obj, ".stl": _stl}


def _by_meshio(mesh: MeshContent, path: StrPath, suffix: str) -> bytes:
    try:
        import meshio
    except ImportError as error:
        raise ImportError(f"{path}: {suffix} needs meshio: pip install meshio") from error
    with scratch_folder(path) as folder:
        part = folder / f"mesh{suffix}"
        points = _in_space(mesh.points)
        options = {"data_format": "XML"} if suffix == ".xdmf" else {}
        meshio.Mesh(points, [("triangle", mesh.triangles)], cell_data={"tag": [mesh.tags]}).write(part, **options)
        return part.read_bytes()


def _in_space(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([points, np.zeros(len(points))])


def _rows(form: str, rows: NDArray[np.generic]) -> str:
    return (form * len(rows)) % tuple(rows.ravel().tolist())
