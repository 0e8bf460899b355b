"""Files of triangulated surfaces, read by trimesh, and what else can be taken for a surface."""

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import GIVEN
from cvtimg._shared.checks import check_choice, check_in_range, check_places, check_that, check_triangles, refuse_type
from cvtimg._shared.extras import optional
from cvtimg._shared.messages import one_line
from cvtimg._shared.types import Bools, Ints
from cvtimg.files.remote import local_copy
from cvtimg.files.whole import StrPath
from cvtimg.halfedges import connected_parts, edges_around, joined_points, measure_triangles, unique_edges
from cvtimg.surfaces.surface import Surface, SurfaceRepairs, TriangulatedSurface

#: Suffixes of files that surfaces are read from.
SURFACE_SUFFIXES = (".obj", ".off", ".ply", ".stl")


def as_surface(surface: object, weld: float | None = None) -> Surface:
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
        return read_surface(surface, weld)
    if hasattr(surface, "vertices") and hasattr(surface, "faces"):
        return mended(surface.vertices, surface.faces, weld)
    if isinstance(surface, (tuple, list)) and len(surface) == 2:
        vertices, faces = surface
        return mended(vertices, faces, weld)
    allowed = "a Surface, a path, (vertices, faces), or a mesh that has them"
    return refuse_type("surface", type(surface).__name__, allowed)


def read_surface(path: StrPath, weld: float | None = None) -> TriangulatedSurface:
    """Read a surface and mend it: `TriangulatedSurface.repairs` counts what was wrong.

    Vertices at the same place are one, faces are there once and go around in one direction, and those without area are
    left out.

    Parameters
    ----------
    path : str or path-like
        .stl, .obj, .ply or .off.
    weld : float, optional
        Vertices nearer to each other than this are one, so that cracks are closed: a millionth of the diagonal by
        default. With 0, only those at the same place are; with -1 none, so that a surface may be split.

    Returns
    -------
    TriangulatedSurface
    """
    trimesh = optional("trimesh", "surfaces", f"{path}: needs")
    check_choice("suffix", Path(path).suffix.lower(), SURFACE_SUFFIXES)
    with local_copy(path) as copy, copy.open("rb") as file:
        try:
            mesh: Any = trimesh.load_mesh(file, file_type=Path(path).suffix[1:].lower(), process=False)
            if len(mesh.faces):
                return mended(mesh.vertices, mesh.faces, weld)
        except Exception as error:  # trimesh's readers raise whatever a damaged file leads to
            raise OSError(f"{path}: cannot be read as a surface ({one_line(error)})") from error
    raise OSError(f"{path}: has no triangles")


def mended(vertices: ArrayLike, faces: ArrayLike, weld: float | None = None) -> TriangulatedSurface:
    """Join vertices, leave out faces that are there twice or have no area, and turn those that are flipped."""
    points = check_places("vertices", vertices, 3)
    given = triangles = check_triangles("faces", faces, len(points))
    apart = GIVEN * float(np.linalg.norm(np.ptp(points, axis=0))) if weld is None else float(weld)
    check_in_range("weld", weld, apart == -1 or 0 <= apart < np.inf, "a finite number >= 0, or -1")
    joined = joined_points(points, apart) if apart >= 0 else np.arange(len(points))
    triangles = joined[triangles].astype(np.int32)
    has_area = measure_triangles(points, triangles).areas > 0
    has_area &= (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    check_that("faces", has_area.any(), "have an area")
    triangles = triangles[has_area]
    first = np.sort(np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)[1])
    n_doubled, triangles = len(triangles) - len(first), triangles[first]
    is_flipped = _flipped(triangles)
    triangles[is_flipped] = triangles[is_flipped, ::-1]
    n_joined = len(np.unique(given)) - len(np.unique(joined[given]))
    repairs = SurfaceRepairs(n_joined, int((~has_area).sum()), n_doubled, int(is_flipped.sum()))
    return TriangulatedSurface(points, triangles, repairs)


def _flipped(triangles: Ints) -> Bools:
    """Tell which of (T, 3) triangles go around in another direction than most of those that they are connected to."""
    n, steps = len(triangles), edges_around(triangles)
    _, which, counts = unique_edges(steps)
    order = np.argsort(which, kind="stable")
    order = order[counts[which[order]] == 2].reshape(-1, 2)
    a, b = order.T // 3
    # Each triangle is there twice, as it is and turned; those that fit together are connected.
    turned = n * (steps[order[:, 0], 0] == steps[order[:, 1], 0])
    links = np.concatenate([a, a + n]), np.concatenate([b + turned, b + n - turned])
    n_parts, part = connected_parts(links, 2 * n)
    size = np.bincount(part[:n], minlength=n_parts)  # how many are as they are
    as_is, other = size[part[:n]], size[part[n:]]
    # Of equal parts, the one with the first triangle is as it is.
    is_first = np.full(n_parts, 2 * n)
    np.minimum.at(is_first, part, np.arange(2 * n))
    return np.asarray((as_is < other) | ((as_is == other) & (is_first[part[:n]] > is_first[part[n:]])))
