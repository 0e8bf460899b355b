"""Files of triangulated surfaces, read by trimesh, and what else can be taken for a surface."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_choice, check_that, refuse_type
from cvtimg._shared.extras import optional
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
        Of the property, whose values are >= 0.
    """
    suffix = Path(path).suffix.lower()
    check_that("vertex properties", suffix == ".ply", f"be in a PLY file, not {suffix}")
    found = _loaded(path, process=False)
    data = found.metadata["_ply_raw"]["vertex"]["data"]
    names = [*(data if isinstance(data, dict) else data.dtype.names)]
    check_choice("vertex property", name, names)
    values = np.asarray(data[name], np.float64).ravel()
    return VertexDensity(np.asarray(found.vertices, np.float64), np.asarray(found.faces, np.int64), values)


def _loaded(path: StrPath, *, process: bool) -> Any:
    """Return a mesh of trimesh, with vertices merged and faces turned in one direction if it is to be processed."""
    trimesh = optional("trimesh", "surfaces", f"{path}: needs")
    check_choice("suffix", Path(path).suffix.lower(), SURFACE_SUFFIXES)
    with local_copy(path) as copy, copy.open("rb") as file:
        try:
            found: Any = trimesh.load_mesh(file, file_type=Path(path).suffix[1:].lower(), process=process)
            if process:
                found.merge_vertices(merge_tex=True, merge_norm=True)
                found.update_faces(found.nondegenerate_faces(height=0))
                trimesh.repair.fix_winding(found)
        except Exception as error:  # trimesh's readers raise whatever a damaged file leads to
            raise OSError(f"{path}: cannot be read as a surface ({one_line(error)})") from error
    if not len(found.faces):
        raise OSError(f"{path}: has no triangles")
    return found
