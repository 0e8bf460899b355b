"""Place points on a surface: collapse edges of fine triangles, then move points and flip edges (Lloyd's method).

Creases and boundaries are curves of points that stay, along which the surface is cut.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

import cvtimg.surfaces._surfaces as _surfaces
from cvtimg._shared.budgets import MOST_IN_MEMORY
from cvtimg._shared.checks import check_at_least, check_choice, check_in_range, check_that, refuse_type
from cvtimg._shared.choices import EffortName
from cvtimg._shared.messages import warn
from cvtimg._shared.types import Floats, Indices, Points, Triangles
from cvtimg.meshes.planning import NEAR
from cvtimg.meshes.trees import limited_along_edges
from cvtimg.placement import ConstantDensity, as_density
from cvtimg.placement.densities import Density
from cvtimg.surfaces.features import extra_points, find_features, place_on_curves
from cvtimg.surfaces.files import as_surface
from cvtimg.surfaces.result import SurfacePoints
from cvtimg.surfaces.surface import Surface, VertexDensity
from cvtimg.surfaces.triangulation import SurfaceTriangulation, split_long_edges


@dataclass(frozen=True, slots=True)
class SurfaceEffort:
    """How long points move."""

    moves: int  # at most
    offset: float  # they rest when the offset is no more


#: Multiple of the step to the center of mass by which points move: with 1 they rest later, with more than 2 never.
_BEYOND = 1.7
#: Area of a regular hexagon whose neighbors are at distance 1.
HEXAGON = 0.75**0.5
#: Distances where the density is largest that points are apart at most: with more, cells at its zeros are wider.
SPARSEST = 30.0
#: Growth of distances for each unit of length: with more, cells differ more from their neighbors.
_GRADE = 0.3
#: Part of what they should be that distances may have before they are found anew.
_NEARLY = 0.8
#: The registry of efforts.
EFFORTS: dict[str, SurfaceEffort] = {
    "fast": SurfaceEffort(50, 0.01),
    "balanced": SurfaceEffort(150, 0.001),
    "best": SurfaceEffort(1000, 0.0001),
}


def surface_points(
    surface: object,
    n: int,
    *,
    density: float | Callable[[Points], ArrayLike] | None = None,
    feature_angle: float = 40.0,
    weld: float | None = None,
    effort: EffortName = "balanced",
) -> SurfacePoints:
    """Place points on a surface as generators of a centroidal Voronoi tessellation, and join them by triangles.

    Parameters
    ----------
    surface : Surface, path, pair of arrays or mesh
        What `cvtimg.surfaces.as_surface` takes: an implicit surface, the path of an STL, OBJ, PLY or OFF file, arrays
        (vertices, faces), or a mesh of trimesh. Triangles are mended, as `cvtimg.surfaces.read_surface` says.
    n : int
        Number of points.
    density : callable or float, optional
        From (N, 3) points to (N,) densities >= 0. Distances of points are about in proportion to density^(-1/4).
    feature_angle : float
        Creases, where faces of a triangulated surface meet at more than this angle from flat, in degrees in 0..180, are
        kept: their corners are points, and edges of triangles lie along them. 180 keeps none. Boundaries are kept in
        the same way.
    weld : float, optional
        Vertices nearer to each other than this are one: a millionth of the diagonal by default; -1 for none.
    effort : {"fast", "balanced", "best"}
        How long points are moved.

    Returns
    -------
    SurfacePoints

    Notes
    -----
    Distances are those of space, not along the surface, and centers of mass are projected to it. Angles opposite to an
    edge add up to at most 180 degrees.

    Creases, boundaries, and edges of three faces or more are features, but for creases shorter than the distance of
    points. Points at their corners stay; others divide the curves between by the same density, and the rest is placed
    while these stay.

    References
    ----------
    Q. Du, M. Gunzburger, L. Ju, Constrained centroidal Voronoi tessellations for surfaces, SIAM Journal on Scientific
    Computing 24 (2003) 1488-1506, doi 10.1137/S1064827501391576.

    Examples
    --------
    >>> from cvtimg import surface_points
    >>> from cvtimg.surfaces import torus
    >>> found = surface_points(torus(), 500)
    >>> found, found.measures().euler_characteristic, found.measures().least_angle > 30
    (SurfacePoints(500 points, 1000 triangles), 0, True)
    """
    shape = as_surface(surface, weld)
    n = check_at_least("n", n, 4, "the corners of a tetrahedron")
    check_in_range("n", n, n <= MOST_IN_MEMORY, f"at most {MOST_IN_MEMORY}")
    check_choice("effort", effort, EFFORTS)
    if not (density is None or callable(density) or np.ndim(density) == 0):
        refuse_type("density", type(density).__name__, "a number or a function of points")
    check_in_range("feature_angle", feature_angle, 0 <= feature_angle <= 180, "in 0..180 degrees")
    how = EFFORTS[effort]
    # The density is looked at at 4096 places at least.
    apart = float(shape.triangulation.areas().sum() / (HEXAGON * 4096)) ** 0.5
    mesh = split_long_edges(shape.triangulation, ConstantDensity(apart), shape.on_surface)
    angle = 180.0 if shape.is_smooth else feature_angle
    start, least = partial(_Start.of, shape, mesh, density=as_density(density), angle=angle), n
    # With more points there may be more edges that they have to follow.
    while (chosen := start(least)).n_least > least:
        least = chosen.n_least + chosen.n_least // 50
    allowed = f"at least {least}: fewer points do not make triangles of this shape, with its edges"
    hint = "" if shape.is_smooth else "; a larger feature_angle keeps fewer of these"
    check_in_range("n", n, least == n, allowed + hint)
    return _placed(shape, chosen, how)


class Sizes:
    """Distances of n points by a density, looked at on a mesh."""

    def __init__(self, mesh: SurfaceTriangulation, n: int, density: Density) -> None:
        from scipy.optimize import brentq

        self._n, self.given, self._lower = n, density, None
        values = density(mesh.points)
        self._top = float(values.max())
        check_that("density", self._top > 0, "be > 0 somewhere on the surface")
        if (zeros := float((values <= 0).mean())) > NEAR:
            gap = f"cells there are up to {SPARSEST:g} times as wide as the finest"
            warn(f"the density is 0 on about {zeros:.0%} of the surface: {gap}")
        areas, relative = mesh.vertex_areas(), self.relative(mesh.points)
        self.distance = _scale(areas, relative, n)
        wanted = self.distance * relative
        if (limited_along_edges(mesh, wanted, _GRADE) >= _NEARLY * wanted).all():
            return

        def graded(power: float) -> Floats:
            return limited_along_edges(mesh, np.exp(power) * wanted, _GRADE)

        power = brentq(lambda power: np.log(_scale(areas, graded(power), n)), -1, 20, xtol=NEAR)
        self.distance, sizes = float(self.distance * np.exp(power)), graded(power)
        self._lower = VertexDensity(mesh.points, mesh.triangles, sizes / self.distance)

    def relative(self, places: Points) -> Floats:
        """Return the distances (N,) of points around (N, 3) places, by that where the density is largest."""
        sizes = np.minimum((np.maximum(self.given(places), 0) / self._top + SPARSEST**-4) ** -0.25, SPARSEST)
        return sizes if self._lower is None else np.minimum(sizes, self._lower(places))

    def __call__(self, places: Points) -> Floats:
        """Return the distances (N,) of points around (N, 3) places."""
        return self.distance * self.relative(places)

    def density(self, places: Points) -> Floats:
        """Return the density (N,) by which points have these distances."""
        return self.given(places) if self._lower is None else self.relative(places) ** -4

    def fits(self, mesh: SurfaceTriangulation) -> bool:
        """Tell whether distances come to the number of points on a finer mesh, too; make them shorter otherwise."""
        factor = _scale(mesh.vertex_areas(), self(mesh.points), self._n)
        is_near = factor > _NEARLY
        self.distance *= 1 if is_near else factor
        return is_near


def _scale(areas: Floats, sizes: Floats, n: int) -> float:
    """Return by how much sizes (N,) have to be longer for n points."""
    return float((areas / sizes**2).sum() / (HEXAGON * n)) ** 0.5


@dataclass(frozen=True, slots=True, eq=False)
class _Start:
    """The points that are placed, before they move."""

    fine: SurfaceTriangulation  # cut along features
    sizes: Sizes
    goals: Points  # of vertices (N, 3) before the cut,
    sites: Indices  # which are these of those after it
    used: Indices  # those that are points
    triangles: Triangles
    n_least: int  # how many points there have to be

    @classmethod
    def of(cls, surface: Surface, mesh: SurfaceTriangulation, n: int, density: Density, angle: float) -> _Start:
        sizes = Sizes(mesh, n, density)
        # Edges are shorter than half of the distances of points. The density may vary within triangles of the mesh:
        # what they hold is measured again on finer ones.
        for _ in range(2):
            whole = split_long_edges(mesh, lambda places: sizes(places) / 2, surface.on_surface)
            if sizes.fits(whole):
                break
        apart = sizes(whole.points)
        apart = apart * (n / max(n - extra_points(whole, apart), n / 2)) ** 0.5
        features = find_features(whole, angle, apart, len(surface.triangulation.triangles))
        kept, places = place_on_curves(whole, features, apart, angle)
        fine, sites = whole.cut(features) if len(kept) else (whole, np.arange(len(whole.points)))
        goals = whole.points.copy()
        goals[kept] = surface.on_surface(places) if len(kept) else places
        return cls(fine, sizes, goals, sites, *_collapsed(fine, apart[sites], n, kept, sites))


def _placed(surface: Surface, start: _Start, effort: SurfaceEffort) -> SurfacePoints:
    sites = start.sites[start.used]
    mesh = SurfaceTriangulation(start.goals[sites], start.triangles)
    offset, n_iter = _relax(surface, start, mesh, effort)
    # The sides of a cut become one again.
    _, first, joined = np.unique(sites, return_index=True, return_inverse=True)
    points, triangles = mesh.points[first], joined.astype(np.int32)[mesh.triangles]
    masses, energy = _measured(start.fine, points, start.sizes.given)
    return SurfacePoints(points, triangles, masses, energy, offset, n_iter)


def _collapsed(
    fine: SurfaceTriangulation, sizes: Floats, n: int, kept: Indices, sites: Indices
) -> tuple[Indices, Triangles, int]:
    """Collapse the shortest edges, of 0.4 distances and then more, until n sites are left, those kept among them.

    New edges have 1.5 times the length at most. Returns the vertices that are left, triangles of these, and how many
    have to be left.
    """
    ranks = fine.on_boundary().astype(np.uint8)
    ranks[np.isin(sites, kept)] = 2
    mesh = SurfaceTriangulation(fine.points, fine.triangles.copy(), fine.twins.copy())
    normals, part, most = fine.normals(), 0.4, n - len(kept)
    n_left, n_on_curves, _ = np.bincount(ranks, minlength=3)
    while (n_left > most or n_on_curves) and part < SPARSEST:
        gone = _surfaces.collapse(mesh, normals, sizes, ranks, part, 1.5, max(n_left - most, 0))
        n_left, n_on_curves = n_left - gone[0], n_on_curves - gone[1]
        mesh.flip(normals)
        part *= 1.1
    left = mesh.triangles[:, 0] >= 0
    used, corners = np.unique(mesh.triangles[left], return_inverse=True)
    if n_on_curves:  # those that one side cannot do without stay on all
        return _collapsed(fine, sizes, n, np.union1d(kept, sites[used[ranks[used] == 1]]), sites)
    return used.astype(np.intp), corners.reshape(-1, 3).astype(np.int32), n_left + len(kept)


def _relax(surface: Surface, start: _Start, mesh: SurfaceTriangulation, effort: SurfaceEffort) -> tuple[float, int]:
    """Move points to the centers of mass of their cells, projected to the surface.

    Those on its boundary stay. Returns the offset and the moves.
    """
    move, last, fine, used = 0, effort.moves, start.fine, start.used
    fixed = mesh.on_boundary()
    goals, outward = mesh.points[fixed], fine.normals()[used[fixed]]
    mesh.points, normals, faces = surface.nearest(mesh.points, fine.face_of_each()[used], fine)
    mesh.points[fixed], normals[fixed] = goals, outward
    while True:
        mesh.flip(normals)
        _, steps = mesh.moments(start.sizes.density(mesh.points))
        if move % 10 == 0:
            sizes = np.sqrt(mesh.vertex_areas())
        lengths = np.linalg.norm(steps, axis=1)
        factor = _BEYOND if move < last - 5 else 1.0  # at the end, cells settle
        # By longer steps, triangles turn over.
        share = np.minimum(factor, 0.3 * sizes / np.maximum(lengths, 1e-300))
        there, directions, near = surface.nearest(mesh.points + share[:, None] * steps, faces, fine)
        there[fixed], directions[fixed] = goals, outward
        # What a cell is off by its size; sums over the cells of folded triangles may lead anywhere.
        off = np.minimum(np.linalg.norm(there - mesh.points, axis=1) / (share * sizes), 1)
        offset = float(np.sqrt(np.mean(off**2)))
        if offset <= effort.offset:
            last = min(last, move + 5)
        if move >= last:
            return offset, move
        # Points whose triangles would fold stay, and those around them if that folds others.
        for _ in range(4):
            back = _surfaces.find_inward(mesh, there, directions)
            if not back.any():
                break
            there[back], directions[back], near[back] = mesh.points[back], normals[back], faces[back]
        mesh.points, normals, faces = there, directions, near
        move += 1


def _measured(fine: SurfaceTriangulation, points: Points, density: Density) -> tuple[Floats, float]:
    """Return masses and energy of the cells of points.

    They are integrated by the middles of the sides of fine triangles, which is exact for squares within a cell.
    """
    from scipy.spatial import KDTree

    areas, tree, masses, energy = fine.areas() / 3, KDTree(points), np.zeros(len(points)), 0.0
    for k in range(3):
        middles = (fine.points[fine.triangles[:, k]] + fine.points[fine.triangles[:, k - 1]]) / 2
        distances, nearest = tree.query(middles)
        parts = areas * density(middles)
        masses += np.bincount(nearest, parts, len(points))
        energy += float(parts @ distances**2)
    return masses, energy
