"""What can be taken for a surface."""

from __future__ import annotations

import os
from typing import Any

from cvtimg._shared.checks import refuse_type
from cvtimg.surfaces.base import Surface
from cvtimg.surfaces.files import read_surface
from cvtimg.surfaces.triangulated import TriangulatedSurface


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
