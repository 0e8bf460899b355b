"""Tetrahedra that fill a mask of voxels. Experimental."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_count, check_in_range, check_positive, check_shape, check_that
from cvtimg._shared.records import ReadOnly
from cvtimg.files.whole import StrPath
from cvtimg.meshes.files import MeshContent, write_mesh
from cvtimg.meshes.measures import boundary_faces
from cvtimg.meshes.tetrahedra import dihedral_angles, qualities, stuff, volumes, widened

Points = NDArray[np.float64]

#: The distance to the surface is smoothed by a Gaussian of this many voxels.
_SMOOTHNESS = 1.0
_MOST_VERTICES = 1 << 26
#: Rounds by which the number of vertices is met, and how near is near enough.
_ROUNDS, _NEAR = 8, 0.01
#: Rounds by which the volume is met, when it is, and what is not near enough.
_VOLUME_ROUNDS, _VOLUME_NEAR, _VOLUME_ERROR = 6, 0.001, 0.01
#: More vertices for each voxel show nothing that the voxels hold.
_MOST_PER_VOXEL = 16
#: Vertices in a volume of 1 where the longer edges have length 1.
_PER_VOLUME = 2


@dataclass(frozen=True, slots=True)
class VolumeMeasures:
    """Measures of tetrahedra.

    Attributes
    ----------
    least_angle, largest_angle : float
        Dihedral angles, in degrees; 70.5 for regular tetrahedra.
    below_20 : float
        Share of the tetrahedra with a dihedral angle below 20 degrees.
    least_quality, mean_quality : float
        3 r / R, for the radii of the inscribed and the circumscribed ball; 1 for regular tetrahedra.
    """

    least_angle: float
    largest_angle: float
    below_20: float
    least_quality: float
    mean_quality: float


@dataclass(frozen=True, slots=True, eq=False)
class VolumeMesh(ReadOnly):
    """Tetrahedra that fill a mask of voxels.

    Attributes
    ----------
    points : (N, 3) float64 array
        Vertices (x, y, z) in voxels; the first voxel of a (D, H, W) mask covers [0, 1] in each.
    tetrahedra : (T, 4) int32 array
        Indices of points; volumes are positive.
    n_wanted : int or None
        The number of vertices that was asked for.
    """

    points: Points
    tetrahedra: NDArray[np.int32]
    n_wanted: int | None

    @property
    def volume(self) -> float:
        """Volume of all tetrahedra."""
        return float(volumes(self.points, self.tetrahedra).sum())

    @property
    def dihedral_angles(self) -> Points:
        """The six angles (T, 6) between the faces of each tetrahedron, in degrees."""
        return dihedral_angles(self.points, self.tetrahedra)

    @property
    def qualities(self) -> Points:
        """3 r / R of each tetrahedron (T,), for the radii of the balls in and around it; 1 if it is regular."""
        return qualities(self.points, self.tetrahedra)

    def measures(self) -> VolumeMeasures:
        """Measure how good the tetrahedra are."""
        angles, quality = self.dihedral_angles, self.qualities
        below = float((angles.min(axis=1) < 20).mean())
        extremes = float(angles.min()), float(angles.max())
        return VolumeMeasures(*extremes, below, float(quality.min()), float(quality.mean()))

    @property
    def surface(self) -> NDArray[np.int32]:
        """Triangles (S, 3) that only one tetrahedron has, counter-clockwise seen from outside."""
        return boundary_faces(self.tetrahedra).astype(np.int32)

    @property
    def is_manifold(self) -> bool:
        """Whether each edge of the surface has two triangles, as in all meshes of `mesh_volume`."""
        edges = np.sort(self.surface[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the mesh to a file.

        Parameters
        ----------
        path : str or path-like
            .vtu, or .msh (Gmsh's 2.2, with the surface as triangles).
        overwrite : bool
            Replace an existing file.
        """
        tags = np.ones(len(self.tetrahedra), np.int32)
        write_mesh(path, MeshContent(self.points, self.tetrahedra, tags, self.surface), overwrite, (".vtu", ".msh"))

    def __repr__(self) -> str:
        asked = "" if self.n_wanted in (None, len(self.points)) else f" ({self.n_wanted} wanted)"
        kind = "" if self.is_manifold else ", whose surface meets itself"
        return f"VolumeMesh({len(self.points)} vertices{asked}, {len(self.tetrahedra)} tetrahedra{kind})"


def mesh_volume(mask: ArrayLike, *, n: int | None = None, edge_length: float | None = None) -> VolumeMesh:
    """Fill a mask of voxels with tetrahedra. Experimental.

    The surface is a manifold: where parts of the mask touch along an edge, or nearly, they grow together.

    Parameters
    ----------
    mask : (D, H, W) bool array
        The surface is smoothed: parts thinner than about three voxels may be lost.
    n : int, optional
        Number of vertices, met within a few percent; at most 16 for each voxel of the mask.
    edge_length : float, optional
        Length of the longer edges inside, in voxels; the others have 0.87 of it. Give this or `n`.

    Returns
    -------
    VolumeMesh
        With the volume of the mask, within 1 %.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or if tetrahedra so large lose the shape; the message names it.

    Notes
    -----
    Inside, vertices are a body-centered cubic lattice. It is a centroidal Voronoi tessellation, and none of space is
    known that has less energy. Vertices near to the surface are moved to it, and tetrahedra that it cuts are divided.
    In the end vertices at dihedral angles below 15 degrees move a little.

    References
    ----------
    Q. Du, D. Wang, The optimal centroidal Voronoi tessellations and the Gersho's conjecture in the three-dimensional
    space, Computers and Mathematics with Applications 49 (2005) 1355-1373, doi 10.1016/j.camwa.2004.12.008.

    F. Labelle, J. R. Shewchuk, Isosurface stuffing: fast tetrahedral meshes with good dihedral angles, ACM Transactions
    on Graphics 26 (2007) 57, doi 10.1145/1276377.1276448.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.meshes import mesh_volume
    >>> z, y, x = np.mgrid[:24, :24, :24] - 11.5
    >>> ball = x * x + y * y + z * z < 100
    >>> mesh = mesh_volume(ball, edge_length=3)
    >>> bool(mesh.dihedral_angles.min() > 14), mesh.is_manifold, round(float(mesh.volume / ball.sum()), 2)
    (True, True, 1.0)
    """
    voxels = np.asarray(mask)
    check_shape("mask", voxels.shape, voxels.ndim == 3, "(D, H, W)")
    check_that("mask", voxels.dtype == bool, "be a bool array")
    check_that("mask", voxels.any(), "not be empty")
    check_that("what is given of n and edge_length", (n is None) != (edge_length is None), "be one of them")
    level = _Level(voxels)
    if edge_length is not None:
        spacing = check_positive("edge_length", edge_length)
    else:
        assert n is not None
        check_count("n", n, _MOST_VERTICES, "what memory holds")
        check_in_range("n", n, n <= _MOST_PER_VOXEL * level.volume, f"at most {_MOST_PER_VOXEL} for each voxel")
        _with_volume(level, _spacing_for(level, n), n)  # which moves the surface
        spacing = _spacing_for(level, n)
    mesh = _with_volume(level, spacing, n)
    mesh = VolumeMesh(widened(mesh.points, mesh.tetrahedra.astype(np.int64), spacing), mesh.tetrahedra, n)
    name = "edge_length" if n is None else "n"
    suits = abs(mesh.volume / level.volume - 1) < _VOLUME_ERROR
    check_that(f"{name}={edge_length if n is None else n}", suits, "let tetrahedra be smaller: they lose the shape")
    return mesh


def _spacing_for(level: _Level, n: int) -> float:
    """Find the spacing with which there are about n vertices."""
    spacing = best = float((level.volume * _PER_VOLUME / n) ** (1 / 3))
    least = np.inf
    for _ in range(_ROUNDS):
        ratio = max(len(stuff(level, level.low, level.high, spacing)[0]), 1) / n
        if abs(ratio - 1) < least:
            least, best = abs(ratio - 1), spacing
        if least < _NEAR:
            break
        spacing *= min(max(ratio, 0.2), 5.0) ** (1 / 3)
    return best


class _Level:
    """The smoothed signed distance to the surface of a mask, with an offset by which volumes are met."""

    def __init__(self, mask: NDArray[np.bool_]) -> None:
        from scipy import ndimage

        self.volume = int(mask.sum())
        self._margin = int(np.ceil(4 * _SMOOTHNESS)) + 1
        padded = np.pad(mask, self._margin)
        outside, inside = ndimage.distance_transform_edt(~padded), ndimage.distance_transform_edt(padded)
        distance = np.where(padded, 0.5 - inside, outside - 0.5)
        self._values = ndimage.gaussian_filter(distance, _SMOOTHNESS)
        check_that("mask", (self._values < 0).any(), "have parts at least three voxels thick")
        self.offset = 0.0
        z, y, x = np.nonzero(padded)
        self.low = np.array([x.min(), y.min(), z.min()]) - self._margin - 1.0
        self.high = np.array([x.max(), y.max(), z.max()]) - self._margin + 2.0

    def __call__(self, points: Points) -> NDArray[np.float64]:
        from scipy.ndimage import map_coordinates

        at = points[:, ::-1].T + (self._margin - 0.5)
        return map_coordinates(self._values, at, order=1, mode="nearest") - self.offset


def _with_volume(level: _Level, spacing: float, n: int | None) -> VolumeMesh:
    """Make a mesh, and move its surface outwards until it has the volume of the mask."""
    for _ in range(_VOLUME_ROUNDS):
        points, cells = stuff(level, level.low, level.high, spacing)
        mesh = VolumeMesh(points, cells.astype(np.int32), n)
        if not len(cells) or abs(mesh.volume / level.volume - 1) < _VOLUME_NEAR:
            break
        a, b, c = (points[mesh.surface[:, k]] for k in range(3))
        area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2
        level.offset += min(max((level.volume - mesh.volume) / area, -0.2 * spacing), 0.2 * spacing)
    return mesh
