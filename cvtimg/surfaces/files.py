"""Files of triangulated surfaces, read by trimesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_choice
from cvtimg._shared.extras import needs
from cvtimg._shared.messages import one_line
from cvtimg.files.whole import StrPath
from cvtimg.surfaces.triangulated import TriangulatedSurface

#: Suffixes of files that surfaces are read from.
SURFACE_SUFFIXES = (".obj", ".off", ".ply", ".stl")


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
    try:
        import trimesh
    except ImportError as error:
        raise ImportError(f"{path}: needs {needs('trimesh', 'surfaces')}") from error
    check_choice("suffix", Path(path).suffix.lower(), SURFACE_SUFFIXES)
    with Path(path).open("rb") as file:
        try:
            found: Any = trimesh.load_mesh(file, file_type=Path(path).suffix[1:].lower(), process=True)
            found.merge_vertices(merge_tex=True, merge_norm=True)
            found.update_faces(found.nondegenerate_faces(height=0))
            trimesh.repair.fix_winding(found)  # type: ignore[no-untyped-call]
        except Exception as error:  # trimesh's readers raise whatever a damaged file leads to
            raise OSError(f"{path}: cannot be read as a surface ({one_line(error)})") from error
    vertices, faces = np.asarray(found.vertices, np.float64), np.asarray(found.faces, np.int64)
    if not len(faces):
        raise OSError(f"{path}: has no triangles")
    return TriangulatedSurface(vertices, faces)
