"""Tetrahedra that fill a mask or labels of voxels. Experimental."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.budgets import MOST_IN_MEMORY
from cvtimg._shared.checks import check_count, check_in_range, check_positive, check_shape, check_that, refuse_type
from cvtimg._shared.choices import Row
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.sums import sum_by_label
from cvtimg._shared.types import Array, Bools, Floats, Indices, Ints, Points
from cvtimg.files.whole import StrPath
from cvtimg.meshes.files import MeshContent, write_mesh
from cvtimg.meshes.planning import NEAR, ROUNDS
from cvtimg.meshes.tetrahedra import (
    Filling,
    VoxelLevels,
    dihedral_angles,
    label_faces,
    moved,
    normals,
    pinched,
    qualities,
    stuff,
    volumes,
    widened,
)

_SUFFIXES = (".vtu", ".msh", ".inp", ".vtk", ".xdmf")


#: Vertices for each voxel at most: more show nothing that the voxels hold.
_MOST_PER_VOXEL = 16


@dataclass(frozen=True, slots=True)
class VolumeMeasures:
    """Measures of tetrahedra.

    Attributes
    ----------
    volume : float
        In voxels.
    least_angle, largest_angle : float
        Dihedral angles, in degrees; 70.5 for regular tetrahedra.
    below_20 : float
        Share of the tetrahedra with a dihedral angle below 20 degrees.
    least_quality, mean_quality : float
        3 r / R, for the radii of the inscribed and the circumscribed ball; 1 for regular tetrahedra.
    """

    volume: float
    least_angle: float
    largest_angle: float
    below_20: float
    least_quality: float
    mean_quality: float


@dataclass(frozen=True, slots=True, eq=False)
class VolumeMesh(ReadOnly):
    """Tetrahedra that fill a mask or labels of voxels.

    Attributes
    ----------
    points : (N, 3) float64 array
        Vertices (x, y, z) in voxels; the first voxel of a (D, H, W) mask covers [0, 1] in each.
    tetrahedra : (T, 4) int32 array
        Indices of points; volumes are positive.
    tags : (T,) int32 array
        Label of each tetrahedron; 1 in a mask.
    n_wanted : int or None
        The number of vertices that was asked for.
    """

    points: Points
    tetrahedra: Ints
    tags: Ints
    n_wanted: int | None

    def _claims(self) -> Claims:
        yield "volumes are positive", volumes(self.points, self.tetrahedra) > 0
        yield "each vertex is one of a tetrahedron", len(np.unique(self.tetrahedra)) == len(self.points)

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
        return self._measured(np.ones(len(self.tags), bool))

    def measures_by_label(self) -> dict[int, VolumeMeasures]:
        """Measure how good the tetrahedra of each label are."""
        return {tag: self._measured(self.tags == tag) for tag in np.unique(self.tags).tolist()}

    def _measured(self, chosen: Bools) -> VolumeMeasures:
        cells = self.tetrahedra[chosen]
        angles, quality = dihedral_angles(self.points, cells), qualities(self.points, cells)
        return VolumeMeasures(
            volume=float(volumes(self.points, cells).sum()),
            least_angle=float(angles.min()),
            largest_angle=float(angles.max()),
            below_20=float((angles.min(axis=1) < 20).mean()),
            least_quality=float(quality.min()),
            mean_quality=float(quality.mean()),
        )

    @property
    def surface(self) -> Ints:
        """Triangles (S, 3) that only one tetrahedron has, counter-clockwise seen from outside."""
        faces, _, beyond = label_faces(self.tetrahedra, self._numbers)
        return faces[beyond == 0]

    @property
    def interfaces(self) -> Ints:
        """Triangles (I, 3) between tetrahedra of two labels, counter-clockwise seen from the higher one."""
        faces, label, beyond = label_faces(self.tetrahedra, self._numbers)
        return faces[label < beyond]

    @property
    def is_manifold(self) -> bool:
        """Whether each edge of the surfaces of all and of each label has two triangles, as `mesh_volume` makes them."""
        return not len(pinched(self.tetrahedra, self._numbers, len(self.points)))

    @property
    def _numbers(self) -> Indices:
        """The labels, numbered from 1."""
        return np.unique(self.tags, return_inverse=True)[1] + 1

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the mesh, and labels as tags, to a file, which may replace one.

        That is .vtu, .msh (Gmsh's 2.2; labels as physical groups, and triangles of the groups "surface" and "between"),
        or .inp (sets of elements), .vtk, .xdmf by meshio.
        """
        content = MeshContent(self.points, self.tetrahedra, self.tags, self.surface, self.qualities)
        inner = self.interfaces
        if len(inner) and Path(path).suffix.lower() in (".msh", ".inp"):
            # Numbers of surfaces are beyond those of labels, which some readers mix up with them.
            most, n_outer = int(self.tags.max()), len(content.sides)
            names = {(3, tag): f"label-{tag}" for tag in np.unique(self.tags).tolist()}
            names |= {(2, most + 1): "surface", (2, most + 2): "between"}
            side_tags = np.repeat(np.array([most + 1, most + 2], np.int32), [n_outer, len(inner)])
            sides = np.concatenate([content.sides, inner])
            content = replace(content, sides=sides, side_tags=side_tags, names=names)
        write_mesh(path, content, overwrite, _SUFFIXES)

    def summary(self) -> Row:
        """Return what a table says of the result, by column."""
        return {
            "n": len(self.points),
            "n_wanted": self.n_wanted,
            "tetrahedra": len(self.tetrahedra),
            "triangles": len(self.surface),
            "volume": self.volume,
            "least_angle": float(self.dihedral_angles.min()),
            "mean_quality": float(self.qualities.mean()),
            "is_manifold": self.is_manifold,
        }

    def __repr__(self) -> str:
        asked = "" if self.n_wanted in (None, len(self.points)) else f" ({self.n_wanted} wanted)"
        kind = "" if self.is_manifold else ", whose surface meets itself"
        return f"VolumeMesh({len(self.points)} vertices{asked}, {len(self.tetrahedra)} tetrahedra{kind})"


def mesh_volume(labels: ArrayLike, *, n: int | None = None, edge_length: float | None = None) -> VolumeMesh:
    """Fill a mask of voxels, or labels of voxels, with tetrahedra. Experimental.

    Labels share the triangles between them, and where three or more meet, they share a line of edges, or a vertex. The
    surface of each label is a manifold: where voxels touch along an edge only, they are joined or parted.

    Parameters
    ----------
    labels : (D, H, W) bool or integer array
        What is 0 or False stays empty. Surfaces are smoothed: parts thinner than about three voxels may be lost.
    n : int, optional
        Number of vertices, met within a few percent; at most 16 for each voxel that is filled.
    edge_length : float, optional
        Length of the longer edges inside, in voxels; the others have 0.87 of it. Give this or `n`.

    Returns
    -------
    VolumeMesh
        With the volume of each label within 1 %.

    Notes
    -----
    Inside, vertices are a body-centered cubic lattice, the centroidal Voronoi tessellation of space of the least energy
    that is known. Those near to the surface of a label are moved to it, and tetrahedra that it cuts are divided; those
    in which more than two labels meet are divided from a point inside. In the end vertices at dihedral angles below 15
    degrees move a little.

    References
    ----------
    Q. Du, D. Wang, The optimal centroidal Voronoi tessellations and the Gersho's conjecture in the three-dimensional
    space, Computers and Mathematics with Applications 49 (2005) 1355-1373, doi 10.1016/j.camwa.2004.12.008.

    F. Labelle, J. R. Shewchuk, Isosurface stuffing: fast tetrahedral meshes with good dihedral angles, ACM Transactions
    on Graphics 26 (2007) 57, doi 10.1145/1276377.1276448.

    J. Bronson, J. A. Levine, R. Whitaker, Lattice cleaving: a multimaterial tetrahedral meshing algorithm with
    guarantees, IEEE Transactions on Visualization and Computer Graphics 20 (2014) 223-237, doi 10.1109/TVCG.2013.115.

    Examples
    --------
    >>> from cvtimg.meshes import mesh_volume
    >>> z, y, x = np.mgrid[:24, :24, :24] - 11.5
    >>> ball = x * x + y * y + z * z < 100
    >>> mesh = mesh_volume(np.where(x < 0, 1, 2) * ball, edge_length=3)
    >>> bool(mesh.dihedral_angles.min() > 10), mesh.is_manifold, np.unique(mesh.tags).tolist()
    (True, True, [1, 2])
    >>> halves = mesh.measures_by_label()
    >>> [round(halves[label].volume / int(ball.sum()), 2) for label in (1, 2)]
    [0.5, 0.5]
    """
    voxels: Array = np.asarray(labels)
    check_shape("labels", voxels.shape, voxels.ndim == 3, "(D, H, W)")
    if voxels.dtype.kind not in "bui":
        refuse_type("labels", voxels.dtype, "bool or of integers")
    check_that("labels", bool((voxels != 0).any()), "not be empty: all are 0")
    most = np.iinfo(np.int32).max
    check_that("labels", bool(voxels.min() >= 0 and voxels.max() <= most), f"be in 0..{most}")
    check_that("what is given of n and edge_length", (n is None) != (edge_length is None), "be one of them")
    volume = np.count_nonzero(voxels)
    if edge_length is not None:
        levels = VoxelLevels(voxels, spacing := check_positive("edge_length", edge_length))
    else:
        assert n is not None
        n = check_count("n", n, MOST_IN_MEMORY, "what memory holds")
        check_in_range("n", n, n <= _MOST_PER_VOXEL * volume, f"at most {_MOST_PER_VOXEL} for each voxel")
        spacing = (volume * 2 / n) ** (1 / 3)  # the lattice has two vertices in a cube of this side
        levels = VoxelLevels(voxels, spacing)
        spacing = _spacing_for(levels, spacing, n)
    filling = stuff(levels, levels.low, levels.high, spacing)
    points = widened(filling.points, filling.cells, spacing)
    points = _with_wanted_volumes(points, filling, levels.wanted, spacing)
    filled = sum_by_label(filling.labels, volumes(points, filling.cells), len(levels.wanted) + 1)[1:]
    name = f"edge_length={edge_length}" if n is None else f"n={n}"
    for tag, error in zip(levels.tags[1:].tolist(), np.abs(filled / levels.wanted - 1).tolist(), strict=True):
        check_that(name, error < NEAR, f"let tetrahedra be smaller: they lose the shape of label {tag}")
    return VolumeMesh(points, filling.cells.astype(np.int32), levels.tags[filling.labels].astype(np.int32), n)


def _spacing_for(levels: VoxelLevels, spacing: float, n: int) -> float:
    """Find the spacing with which there are about n vertices."""
    best, least = spacing, np.inf
    for _ in range(ROUNDS):
        ratio = max(len(stuff(levels, levels.low, levels.high, spacing).points), 1) / n
        if abs(ratio - 1) < least:
            least, best = abs(ratio - 1), spacing
        if least < NEAR:
            break
        spacing *= min(max(ratio, 0.2), 5.0) ** (1 / 3)
    return best


def _with_wanted_volumes(points: Points, filling: Filling, wanted: Floats, spacing: float) -> Points:
    """Move surfaces along their normals until volumes are a tenth of `NEAR` off, as far as dihedral angles let them."""
    for _ in range(ROUNDS):
        heights, is_near = _heights(points, filling.cells, filling.labels, wanted)
        if is_near:
            break
        faces, label, beyond = label_faces(filling.cells, filling.labels)
        areas = normals(points[faces])
        weights = np.maximum(sum_by_label(faces.ravel(), np.linalg.norm(areas, axis=1).repeat(3), len(points)), 1e-300)
        areas *= np.clip(heights[label] - heights[beyond], -0.1 * spacing, 0.1 * spacing)[:, None]
        moves = sum_by_label(faces.ravel(), areas.repeat(3, axis=0), len(points)) / weights[:, None]
        points = moved(points, filling.cells, moves)
    return points


def _heights(
    points: Points, cells: NDArray[np.integer], labels: NDArray[np.integer], wanted: Floats
) -> tuple[Floats, bool]:
    """Return heights (L + 1,) by whose differences surfaces between labels must move, and if volumes are near."""
    lacking = wanted - sum_by_label(labels, volumes(points, cells), len(wanted) + 1)[1:]
    faces, label, beyond = label_faces(cells, labels)
    areas = np.zeros((len(wanted) + 1,) * 2)
    np.add.at(areas, (label, beyond), np.linalg.norm(normals(points[faces]), axis=1) / 2)
    flows = (np.diag(areas.sum(axis=1)) - areas)[1:, 1:]
    heights = np.append(0, np.linalg.lstsq(flows, lacking)[0])
    return heights, bool((np.abs(lacking) < NEAR / 10 * wanted).all())
