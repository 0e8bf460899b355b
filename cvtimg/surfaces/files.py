"""Files of triangulated surfaces, read by trimesh, and what else can be taken for a surface."""

from __future__ import annotations

import os
from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice, check_that, refuse_type
from cvtimg._shared.extras import needs
from cvtimg._shared.messages import one_line
from cvtimg.files.remote import local_copy
from cvtimg.files.whole import StrPath
from cvtimg.surfaces.surface import Surface, TriangulatedSurface, VertexDensity

#: Suffixes of files that surfaces are read from.
SURFACE_SUFFIXES = (".obj", ".off", ".ply", ".stl")


def as_surface(surface: Any) -> Surface:
    """Make a surface of what stands for one.

    Parameters
    ----------
    surface : Surface, path, pair of arrays or mesh
        A Surface as it is; the path of a file that `read_surface` reads; arrays (vertices, faces); or an object with
        the attributes vertices and faces, as trimesh has.

    Returns
    -------
    Surface

    Raises
    ------
    TypeError, ValueError
        If it is none of these, or no surface.
    """
    if isinstance(surface, Surface):
        return surface
    if isinstance(surface, (str, os.PathLike)):
        return read_surface(surface)
    if hasattr(surface, "vertices") and hasattr(surface, "faces"):
        return TriangulatedSurface(surface.vertices, surface.faces)
    if isinstance(surface, (tuple, list)) and len(surface) == 2:
        return TriangulatedSurface(*surface)
    return refuse_type(
        "surface", type(surface).__name__, "a Surface, a path, (vertices, faces), or a mesh that has them"
    )


def read_surface(path: StrPath) -> TriangulatedSurface:
    """Read a surface; vertices at the same place are merged, and faces without area are left out.

    Parameters
    ----------
    path : str or path-like
        .stl, .obj, .ply or .off.

    Returns
    -------
    TriangulatedSurface

    Raises
    ------
    ImportError
        If trimesh is not installed.
    OSError, ValueError
        If the file cannot be read, or holds no surface.
    """
    found = _loaded(path, process=True)
    vertices, faces = np.asarray(found.vertices, np.float64), np.asarray(found.faces, np.int64)
    return TriangulatedSurface(vertices, faces)


def read_vertex_density(path: StrPath, name: str) -> VertexDensity:
    """Read a density from a property of the vertices in a PLY file, such as the quality of MeshLab.

    Parameters
    ----------
    path : str or path-like
        .ply.
    name : str
        Of the property.

    Returns
    -------
    VertexDensity

    Raises
    ------
    ImportError
        If trimesh is not installed.
    OSError, ValueError
        If the file cannot be read, has no such property, or its values are no density.
    """
    suffix = Path(path).suffix.lower()
    check_that("vertex properties", suffix == ".ply", f"be in a PLY file, not {suffix}")
    found = _loaded(path, process=False)
    data = found.metadata["_ply_raw"]["vertex"]["data"]
    names = [*(data if isinstance(data, dict) else data.dtype.names)]
    check_choice("vertex property", name, names)
    values = np.asarray(data[name], np.float64).ravel()
    return VertexDensity(np.asarray(found.vertices, np.float64), np.asarray(found.faces, np.int64), values)


def read_features(path: StrPath) -> NDArray[np.float64]:
    """Read edges that `surface_points` is to keep.

    Parameters
    ----------
    path : str or path-like
        .obj, of which lines and edges between groups or materials count; or text (.csv, .txt) with the six coordinates
        of both ends of an edge in each row.

    Returns
    -------
    (E, 2, 3) array

    Raises
    ------
    OSError, ValueError
        If the file cannot be read, or holds no edges.
    """
    suffix = check_choice("suffix of features", Path(path).suffix.lower(), (".obj", ".csv", ".txt"))
    with local_copy(path) as copy:
        text = copy.read_text(encoding="utf-8", errors="replace")
    try:
        edges = _obj_features(text) if suffix == ".obj" else np.loadtxt(text.replace(",", " ").splitlines(), ndmin=2)
        found = edges.reshape(-1, 2, 3)
    except (ValueError, IndexError) as error:
        raise ValueError(f"{path}: holds no edges of six coordinates each ({one_line(error)})") from error
    check_that(str(path), len(found) > 0, "have lines, or faces of several groups")
    return found


def _obj_features(text: str) -> NDArray[np.float64]:
    """Return the lines (E, 2, 3) of a file of Wavefront, and edges of faces in different groups or materials."""
    places: list[list[float]] = []
    ends: list[tuple[int, int]] = []
    groups: dict[frozenset[int], set[tuple[str, str]]] = defaultdict(set)
    group = material = ""
    for line in text.splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "v":
            places.append([float(word) for word in rest.split()[:3]])
        elif kind in ("g", "o"):
            group = rest.strip()
        elif kind == "usemtl":
            material = rest.strip()
        elif kind in ("l", "f"):
            # Numbers are from 1, and those below 0 from the end.
            numbers = [int(word.split("/")[0]) for word in rest.split()]
            corners = [number - 1 if number > 0 else len(places) + number for number in numbers]
            if kind == "l":
                ends += pairwise(corners)
            else:
                for a, b in pairwise([*corners, corners[0]]):
                    groups[frozenset((a, b))].add((group, material))
    ends += [(min(edge), max(edge)) for edge, names in groups.items() if len(names) > 1]
    return np.array(places).reshape(-1, 3)[np.array(ends, np.intp).reshape(-1, 2)]


def _loaded(path: StrPath, *, process: bool) -> Any:
    """Return a mesh of trimesh, with vertices merged and faces turned in one direction if it is to be processed."""
    try:
        import trimesh
    except ImportError as error:
        raise ImportError(f"{path}: needs {needs('trimesh', 'surfaces')}") from error
    check_choice("suffix", Path(path).suffix.lower(), SURFACE_SUFFIXES)
    with local_copy(path) as copy, copy.open("rb") as file:
        try:
            found: Any = trimesh.load_mesh(file, file_type=Path(path).suffix[1:].lower(), process=process)
            if process:
                found.merge_vertices(merge_tex=True, merge_norm=True)
                found.update_faces(found.nondegenerate_faces(height=0))
                trimesh.repair.fix_winding(found)  # type: ignore[no-untyped-call]
        except Exception as error:  # trimesh's readers raise whatever a damaged file leads to
            raise OSError(f"{path}: cannot be read as a surface ({one_line(error)})") from error
    if not len(found.faces):
        raise OSError(f"{path}: has no triangles")
    return found
