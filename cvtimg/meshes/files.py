"""Mesh files: VTU with names and OBJ with groups are written here, others by meshio.

Names of regions and of borders are physical groups in MSH, arrays of 0 and 1 in VTU, sets of elements and of nodes in
INP.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice
from cvtimg._shared.extras import optional
from cvtimg._shared.types import Floats, Ints
from cvtimg.files.vtu import LINE, LINE3, TETRAHEDRON, TRIANGLE, TRIANGLE6, vtu_content
from cvtimg.files.whole import StrPath, scratch_folder, whole_file

#: What meshio is asked for, beside the formats below, and how.
_MESHIO: dict[str, dict[str, Any]] = {
    ".msh": {"file_format": "gmsh22", "binary": False},
    ".stl": {"binary": True},
    ".bdf": {},
    ".inp": {},
    ".med": {},
    ".mesh": {},
    ".off": {},
    ".ply": {},
    ".su2": {},
    ".vtk": {},
    ".xdmf": {"data_format": "XML"},
}
#: Those that have no triangles with six nodes.
_STRAIGHT = (".obj", ".ply", ".stl", ".su2", ".mesh", ".off")
#: Names that formats have for other things.
TAKEN = ("border", "connectivity", "offsets", "points", "quality", "tag", "types")
#: Cells, and what is on their sides: VTK's number and meshio's name.
_CELLS = {"triangle": (TRIANGLE, "line"), "tetra": (TETRAHEDRON, "triangle"), "triangle6": (TRIANGLE6, "line3")}


@dataclass(frozen=True, slots=True, eq=False)
class MeshContent:
    """What files hold of a mesh of triangles or tetrahedra."""

    points: Floats  # (N, 2) or (N, 3)
    cells: Ints  # (T, 3), (T, 4), or (T, 6) for triangles with nodes in the middle of edges
    tags: Ints  # (T,)
    sides: Ints  # (E, 2) or (E, 3): edges on borders, with their middle, or triangles of the surface
    qualities: Floats  # (T,)
    side_tags: Ints | None = None  # (E,): 1 by default
    names: Mapping[tuple[int, int], str] = field(default_factory=dict)  # Of the dimension and the tag of cells

    @property
    def kind(self) -> str:
        """What cells are, as meshio calls them."""
        return {3: "triangle", 4: "tetra", 6: "triangle6"}[self.cells.shape[1]]

    @property
    def places(self) -> Floats:
        """Points (N, 3), where those of the plane have z = 0."""
        return np.pad(self.points, ((0, 0), (0, 3 - self.points.shape[1])))


def suffixes(kind: str = "triangle") -> tuple[str, ...]:
    """Return the suffixes of files that meshes of triangles, or of "triangle6", are written to."""
    names = (*MESH_FORMATS, *_MESHIO)
    return names if kind == "triangle" else tuple(suffix for suffix in names if suffix not in _STRAIGHT)


def write_mesh(path: StrPath, mesh: MeshContent, overwrite: bool, allowed: tuple[str, ...] | None = None) -> None:
    """Write a mesh in the format that the suffix picks."""
    suffix = check_choice("suffix", Path(path).suffix.lower(), allowed or suffixes())
    content = MESH_FORMATS[suffix](mesh) if suffix in MESH_FORMATS else _by_meshio(mesh, path, suffix)
    with whole_file(path, overwrite=overwrite) as file:
        file.write(content)


def _vtu(mesh: MeshContent) -> bytes:
    cells, tags, qualities, sides = mesh.cells, mesh.tags, mesh.qualities, mesh.sides
    kind, corners = _CELLS[mesh.kind][0], cells.shape[1] * np.arange(1, len(cells) + 1)
    if mesh.side_tags is None:
        return vtu_content(mesh.places, cells, corners, kind, {"tag": tags, "quality": qualities})
    # Lines follow, and each name has 1 in its cells.
    kinds = np.repeat([kind, LINE if mesh.kind == "triangle" else LINE3], [len(cells), len(sides)])
    ends = np.append(corners, corners[-1] + sides.shape[1] * np.arange(1, len(sides) + 1))
    dimensions, tags = np.repeat([2, 1], [len(cells), len(sides)]), np.append(tags, mesh.side_tags)
    values = {"tag": tags, "quality": np.append(qualities, np.full(len(sides), np.nan))}
    values |= {name: (dimensions == of) & (tags == tag) for (of, tag), name in mesh.names.items()}
    return vtu_content(mesh.places, np.append(cells, sides), ends, kinds, values)


def _obj(mesh: MeshContent) -> bytes:
    """Wavefront's format: a group for each tag."""
    parts = [rows_of("v %.17g %.17g %g\n", mesh.places)]
    for tag in np.unique(mesh.tags):
        parts.append(f"g {tag}\n" + rows_of("f %d %d %d\n", mesh.cells[mesh.tags == tag] + 1))
    return "".join(parts).encode()


#: The registry of formats: suffix to the function that makes the content.
MESH_FORMATS: dict[str, Callable[[MeshContent], bytes]] = {".vtu": _vtu, ".obj": _obj}


def _by_meshio(mesh: MeshContent, path: StrPath, suffix: str) -> bytes:
    meshio = optional("meshio", "mesh", f"{path}: {suffix} needs")
    cells, data = [(mesh.kind, mesh.cells)], {"tag": [mesh.tags]}
    names: dict[str, Any] = {}
    sets: dict[str, Any] = {}
    dimension, name, inside = (2, "surface", "inside") if mesh.kind == "tetra" else (1, "border", None)
    if suffix == ".msh" and len(mesh.sides):  # borders or the surface are a physical group, and so are tags
        cells = [(_CELLS[mesh.kind][1], mesh.sides), *cells]
        of_sides = np.ones(len(mesh.sides), np.int32) if mesh.side_tags is None else mesh.side_tags
        # Readers tell groups by their numbers alone: sides without a name have one beyond all others.
        beyond = max(int(mesh.tags.max()), int(of_sides.max())) + 1
        of_sides = np.where(of_sides == 1, beyond, of_sides).astype(np.int32)
        tags = [of_sides, mesh.tags]
        data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
        keys = [(dimension + inner, tag) for inner, of in enumerate(tags) for tag in np.unique(of)]
        usual = {dimension: name, dimension + 1: inside}
        names = {mesh.names.get(key) or usual[key[0]] or str(key[1]): np.array(key[::-1]) for key in keys}
    elif suffix == ".inp" and mesh.side_tags is not None:
        inner, sides = ([(k, t) for (of, t), k in mesh.names.items() if of == dimension + at] for at in (1, 0))
        regions = {name: [np.flatnonzero(mesh.tags == tag)] for name, tag in inner}
        nodes = {name: np.unique(mesh.sides[mesh.side_tags == tag]) for name, tag in sides}
        sets = {"cell_sets": regions, "point_sets": nodes}
    with scratch_folder(path) as folder:
        part = folder / f"mesh{suffix}"
        # FEniCS takes what has three coordinates for a surface.
        places = mesh.points if suffix in (".xdmf", ".su2") else mesh.places
        if suffix == ".bdf":  # whose fields have 16 signs
            places = np.array([f"{value:.9e}" for value in places.ravel()], np.float64).reshape(places.shape)
        try:
            meshio.Mesh(places, cells, cell_data=data, field_data=names, **sets).write(part, **_MESHIO[suffix])
        except ModuleNotFoundError as error:
            raise ImportError(f"{path}: {suffix} needs {error.name}: pip install {error.name}") from error
        content = part.read_bytes()
    if suffix == ".ply":  # without the time, so that the same mesh has the same bytes
        return re.sub(rb"Created by meshio[^\n]*", b"cvtimg", content, count=1)
    if suffix == ".inp":  # of the plane, where meshio has rigid elements and shells
        content = content.replace(b"TYPE=R3D3\n", b"TYPE=CPS3\n", 1).replace(b"TYPE=STRI65\n", b"TYPE=CPS6\n", 1)
    return content


def rows_of(form: str, rows: NDArray[np.generic]) -> str:
    """Write each row of numbers by a form."""
    return (form * len(rows)) % tuple(rows.ravel().tolist())
