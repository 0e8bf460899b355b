"""Files of tetrahedra: VTU and Gmsh's MSH."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice
from cvtimg.files.vtu import TETRAHEDRON, vtu_content
from cvtimg.files.whole import StrPath, write_whole
from cvtimg.meshes.files import rows_of

Points = NDArray[np.float64]
Cells = NDArray[np.int32]


def write_volume(path: StrPath, points: Points, tetrahedra: Cells, surface: Cells, overwrite: bool) -> None:
    """Write a mesh in the format that the suffix picks."""
    suffix = Path(path).suffix.lower()
    check_choice("suffix", suffix, VOLUME_FORMATS)
    write_whole(path, VOLUME_FORMATS[suffix](points, tetrahedra, surface), overwrite=overwrite)


def _vtu(points: Points, tetrahedra: Cells, surface: Cells) -> bytes:
    ends = 4 * np.arange(1, len(tetrahedra) + 1)
    return vtu_content(points, tetrahedra, ends, TETRAHEDRON, {})


def _msh(points: Points, tetrahedra: Cells, surface: Cells) -> bytes:
    """Gmsh's format 2.2: the surface is the physical group 1 of dimension 2, the inside that of dimension 3."""
    n, n_faces, n_cells = len(points), len(surface), len(tetrahedra)
    faces = np.column_stack([np.arange(1, n_faces + 1), np.tile([2, 2, 1, 1], (n_faces, 1)), surface + 1])
    numbers = np.arange(n_faces + 1, n_faces + n_cells + 1)
    cells = np.column_stack([numbers, np.tile([4, 2, 1, 1], (n_cells, 1)), tetrahedra + 1])
    parts = [
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n",
        '$PhysicalNames\n2\n2 1 "surface"\n3 1 "inside"\n$EndPhysicalNames\n',
        f"$Nodes\n{n}\n",
        rows_of("%d %.17g %.17g %.17g\n", np.column_stack([np.arange(1, n + 1), points])),
        f"$EndNodes\n$Elements\n{n_faces + n_cells}\n",
        rows_of("%d %d %d %d %d %d %d %d\n", faces),
        rows_of("%d %d %d %d %d %d %d %d %d\n", cells),
        "$EndElements\n",
    ]
    return "".join(parts).encode()


#: The registry of formats: suffix to the function that makes the content.
VOLUME_FORMATS: dict[str, Callable[[Points, Cells, Cells], bytes]] = {".vtu": _vtu, ".msh": _msh}
