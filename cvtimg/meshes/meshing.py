"""Meshes of regions and of segments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import (
    check_choice,
    check_in_range,
    check_labels,
    check_non_negative,
    check_places,
    check_that,
)
from cvtimg._shared.extras import shapely
from cvtimg._shared.messages import warn
from cvtimg._shared.progress import each, part
from cvtimg._shared.types import ImageLike, Points
from cvtimg.halfedges import EdgeTable, edges_around, measure_triangles
from cvtimg.meshes.anisotropy import MatrixFunction
from cvtimg.meshes.mending import mend
from cvtimg.meshes.outlines import TOLERANCE, Outline, StraightParts, label_outline, with_points
from cvtimg.meshes.periodic import periodic_mesh, with_paired_middles
from cvtimg.meshes.planning import Plan, Wanted, place_inside, plan_mesh
from cvtimg.meshes.polygons import Cleaning, outline_of, outline_of_parts
from cvtimg.meshes.projection import LocalProjection
from cvtimg.meshes.quadratic import quadratic
from cvtimg.meshes.relaxation import relax
from cvtimg.meshes.result import Mesh
from cvtimg.meshes.sizes import SizeLike
from cvtimg.meshes.triangulation import PlaneTriangulation
from cvtimg.placement import as_region


@dataclass(frozen=True, slots=True)
class MeshEffort:
    """How long vertices of a mesh move."""

    moves: int  # at most
    tolerance: float  # they rest when this near to the centers of mass, as a part of the length of edges
    sweeps: int  # that make edges even
    mendings: int  # rounds that mend small angles
    trials: int = 1  # of small meshes of one size, of which the most regular one is kept,
    small: int = 1000  # while they have no more vertices in all
    most_sweeps: int = 20  # of meshes of one size
    one_size: bool = False

    def of(self, n: int) -> MeshEffort:
        """Return the effort for n vertices whose distances are the same everywhere: more, while these are few."""
        moves, sweeps = (min(most, 600_000 // n) for most in (200, self.most_sweeps))
        return replace(self, moves=max(self.moves, moves), sweeps=max(self.sweeps, sweeps), one_size=True)


#: The registry: names for `effort`.
EFFORTS: dict[str, MeshEffort] = {
    "fast": MeshEffort(10, 1e-2, 2, 4),
    "balanced": MeshEffort(15, 1e-3, 2, 10, trials=4),
    "best": MeshEffort(300, 1e-4, 5, 20, trials=24, small=24_000),
}
#: A mesh whose least angle is smaller, in degrees, and not at a corner of its border, is warned of.
_NARROW = 10.0


def mesh_region(
    region: object,
    *,
    n: int | None = None,
    edge_length: float | None = None,
    size: SizeLike | None = None,
    grade: float = 0.2,
    min_size: float = 0.0,
    snap: float | None = None,
    simplify: float = 0.0,
    project: str | None = None,
    fixed: ArrayLike | None = None,
    keep_points: bool = False,
    metric: MatrixFunction | None = None,
    order: int = 1,
    periodic: str | None = None,
    effort: str = "balanced",
    rng: int | np.random.Generator = 0,
) -> Mesh:
    """Divide a region of the plane into triangles whose vertices are generators of a centroidal Voronoi tessellation.

    Parameters
    ----------
    region : Region, bool array, polygon coordinates, GeoJSON, shapely geometry, or dict of names and regions
        What `cvtimg.placement.as_region` takes; or names and polygons that do not overlap, which share the vertices on
        their borders and have the tags 1, 2, ... Corners of polygons, where the boundary turns by more than 30 degrees,
        or by 10 between long sides, become vertices. The contour of a mask is smoothed by up to 0.7 pixels, and keeps
        its area.
    n : int, optional
        Number of vertices. With `size`, only the ratios of sizes count then. If nothing is said of sizes, edges are up
        to 1/70 of the diagonal long, and shorter where borders need that for angles of 30 degrees: the number of
        vertices fits the region.
    edge_length : float, optional
        Length of edges, the same everywhere, but shorter where borders need that.
    size : (H, W) array or callable, optional
        Length of edges at each place: an image, at places (x, y) in pixels; or a function from (M, 2) points to (M,)
        sizes, such as a `MeshSize`. Give `n`, `edge_length`, `size`, `n` and `size`, or none of them.
    grade : float
        How much sizes may grow for each unit of length, > 0; more where `n` is too small for that.
    min_size : float
        The least size. Islands and holes of polygons that a circle of this diameter holds are left out, and so are
        narrow parts and points that would make edges shorter than half of it.
    snap : float, optional
        Points of polygons nearer to each other than this, or to an edge, are one, so that cracks and spikes that are
        thinner vanish: 1e-5 of the diameter by default. 0 keeps all, but for points within 1e-9 of the diameter.
    simplify : float
        Draw polygons with fewer points, moving the lines by about this at most; areas are kept.
    project : {"auto"}, optional
        Coordinates are longitudes and latitudes in degrees, perhaps across the date line: they are projected to km
        about their middle, by `LocalProjection`, so that sizes, `snap` and `simplify` are in km. The vertices of the
        mesh are in degrees again, and so are its measures; ``mesh.projection.to_km(mesh.points)`` has them in km.
    fixed : (F, 2) array, optional
        Points of the region that become vertices.
    keep_points : bool
        Make all points of polygons vertices, and not only corners: none is cut off. `n` must be large enough for them.
        Angles are small where points are near to each other.
    metric : callable, optional
        From (M, 2) points to (M, 2, 2) positive definite matrices, by which all edges should have length 1, for edges
        that are longer in some directions; with `n`, only its ratios count. `HuangMetric` makes one of a Hessian.
        Instead of `edge_length` and `size`; `grade` and `min_size` do not limit it.
    order : {1, 2}
        With 2, triangles have six nodes, and sides on the boundary bend with it: `Mesh.quadratic`. `n` is still the
        number of vertices.
    periodic : {"x", "y", "xy"}, optional
        Borders on the left and right ("x"), or at the least and the greatest y, are copies by translation, and so are
        the vertices on them: `Mesh.pairs`. Sizes should be periodic, too.
    effort : {"fast", "balanced", "best"}
        How long vertices move.
    rng : int or numpy.random.Generator
        Seed. The same seed gives the same bits.

    Returns
    -------
    Mesh
        With exactly `n` vertices, if that is given, and with the area of the region within 1e-6, as in the notes.

    Raises
    ------
    ValueError
        If the boundary needs more than `n` vertices, among others; the message says how many.

    Notes
    -----
    Vertices on the boundary come first, closer where two parts of it are near to each other. In a constrained Delaunay
    triangulation, inner vertices move to the centers of mass of their cells, with density size^-4, while edges
    flip. Edges are made even; those at angles below 30 degrees are split, as in Delaunay refinement, and with `n` other
    vertices are taken away; angles that the borders themselves have stay. Last, vertices move off the boundary of
    polygons by as much as edges cut off, so that areas stay. Small meshes of one size are made several times, more
    often with effort "best", and the most regular one is returned.

    References
    ----------
    Q. Du, M. Gunzburger, Grid generation and optimization based on centroidal Voronoi tessellations, Applied
    Mathematics and Computation 133 (2002) 591-607, doi 10.1016/S0096-3003(01)00260-0.

    J. Ruppert, A Delaunay refinement algorithm for quality 2-dimensional mesh generation, Journal of Algorithms 18
    (1995) 548-585, doi 10.1006/jagm.1995.1021.

    Examples
    --------
    >>> from cvtimg import mesh_region
    >>> mesh = mesh_region([[0, 0], [3, 0], [3, 1], [0, 1]], n=100)
    >>> len(mesh.points), round(mesh.area, 9)
    (100, 3.0)
    """
    least = check_non_negative("min_size", min_size)
    how = Cleaning(snap, check_non_negative("simplify", simplify), least, keep_points)
    parts = dict(region) if isinstance(region, Mapping) and "type" not in region else {}
    local, regions = None, [as_region(part) for part in (parts.values() if parts else [region])]
    if project is not None:
        check_choice("project", project, ("auto",))
        check_in_range("order", order, order == 1, "1 with project")
        shapes = [part.outline() for part in regions]
        local = LocalProjection.about(shapely.GeometryCollection(shapes))
        regions = [local.region(shape) for shape in shapes]
        fixed = None if fixed is None else local.to_km(check_places("fixed", fixed, 2))
    outline = outline_of_parts(regions, how) if parts else outline_of(regions[0], how)
    if n and size is None and metric is None and outline.polygons is not None:  # which asks for edges of this length
        edge = (2 / 3**0.5 * outline.polygons.area / n) ** 0.5
        if edge < least / 2:
            warn(f"n={n} vertices have edges of about {edge:.2g}, shorter than half of min_size={least:g}: leave n out")
        least = min(least, edge)
    wanted = Wanted.checked(n, edge_length, size, grade, least, outline.diameter, metric)
    mesh = _mesh(outline, wanted, fixed, order, periodic, effort, rng)
    if local is not None:
        mesh = replace(mesh, points=local.to_degrees(mesh.points), projection=local)
    return mesh.named(regions=dict(enumerate(parts, 1))) if parts else mesh


def mesh_labels(
    labels: ArrayLike,
    image: ImageLike | None = None,
    *,
    n: int | None = None,
    edge_length: float | None = None,
    size: SizeLike | None = None,
    grade: float = 0.2,
    min_size: float = 0.0,
    tolerance: float = TOLERANCE,
    order: int = 1,
    periodic: str | None = None,
    effort: str = "balanced",
    rng: int | np.random.Generator = 0,
) -> Mesh:
    """Divide all segments of an image into triangles; segments side by side share the vertices on their border.

    Parameters
    ----------
    labels : (H, W) integer array
        Segment of each pixel; 0 for what is not meshed.
    image : (H, W) or (H, W, C) array, optional
        The segmented image, for borders between the centers of pixels, as `cvtimg.find_contours` has them.
    n, edge_length, size, grade, min_size, order, periodic, effort, rng
        As in `mesh_region`.
    tolerance : float
        How far borders may be moved to make them smoother, in pixels; 0 for the sides of pixels.

    Returns
    -------
    Mesh
        With the label of each triangle in `tags`. Each connected piece of a segment has the area of its pixels, or that
        of its contour in `image`.

    Examples
    --------
    >>> from cvtimg import mesh_labels
    >>> mesh = mesh_labels(np.repeat([[1, 2]], 8, axis=0).repeat(8, axis=1), n=60)
    >>> len(mesh.points), sorted(set(mesh.tags.tolist())), round(mesh.area, 9)
    (60, [1, 2], 128.0)
    """
    segments = check_labels("labels", labels)
    least = check_non_negative("min_size", min_size)
    outline = label_outline(segments, image, check_non_negative("tolerance", tolerance))
    wanted = Wanted.checked(n, edge_length, size, grade, least, outline.diameter)
    return _mesh(outline, wanted, None, order, periodic, effort, rng)


def _mesh(
    outline: Outline, wanted: Wanted, fixed: ArrayLike | None, order: int, periodic: str | None, effort: str,
    rng: int | np.random.Generator,
) -> Mesh:  # fmt: skip
    """Make a mesh, whose sides may be periodic, and bend its sides."""
    check_in_range("order", order, order in (1, 2), "1 or 2")
    check_choice("effort", effort, EFFORTS)
    places = np.empty((0, 2)) if fixed is None else check_places("fixed", fixed, 2)
    outline, alone = with_points(outline, places)
    make = partial(_best, wanted=wanted, alone=alone, effort=EFFORTS[effort], random=np.random.default_rng(rng))
    if periodic is None:
        best = make(outline)
    else:
        best, outline = periodic_mesh(outline, periodic, lambda given: plan_mesh(given, wanted, alone).borders, make)
    if len(alone):
        from scipy.spatial import cKDTree

        lost = alone[cKDTree(best.points).query(alone)[0] > 0]
        near = f"fixed has {lost[:1].ravel().tolist()}, near which edges on the border"
        check_that(near, not len(lost), "be shorter: give more vertices, or smaller sizes")
    if wanted.n is not None and fixed is None and wanted.metric is None and np.isscalar(wanted.size):
        _warn_of_small_angles(best)
    if order == 1:
        return best
    six = quadratic(best.points, best.triangles, best.edges, outline)
    six = six if best.pairs is None else with_paired_middles(six, best)
    return replace(best, points=six.nodes[: len(best.points)], quadratic=six)


def _best(outline: Outline, wanted: Wanted, alone: Points, effort: MeshEffort, random: np.random.Generator) -> Mesh:
    """Plan a mesh, and make it, or some of which the best is kept."""
    with part(0, 1 / 2):
        plan = plan_mesh(outline, wanted, alone)
        n = plan.number if wanted.n is None else wanted.n
        place = partial(place_inside, plan.borders, plan.field, n - plan.n_on_borders, random)
        inner = place()
    varies = plan.varies(inner)
    trials = enumerate(each(_trials(varies, n, effort)))
    with part(1 / 2, 1):
        meshes = [_made(outline, plan, wanted, trial, place() if k else inner) for k, trial in trials]
    if len(meshes) == 1:
        return meshes[0]
    if varies:
        return max(meshes, key=lambda mesh: float(mesh.qualities.mean()))
    # By the product of the eight measures that are less where cells are more regular.
    return min(meshes, key=lambda mesh: float(np.log(np.maximum(astuple(mesh.measures())[:8], 1e-300)).sum()))


def _trials(varies: bool, n: int, effort: MeshEffort) -> list[MeshEffort]:
    """Return the efforts of meshes of which the best is kept: of one size, their edges differ in how even they are."""
    n_trials = 1 if varies else min(effort.trials, effort.small // n)
    tried = [replace(effort, most_sweeps=effort.most_sweeps if k % 3 else k % 2, sweeps=0) for k in range(n_trials)]
    trials = tried if n_trials > 1 else [effort]
    # More moves are not always better: what less effort makes is among the meshes of the best.
    less = _trials(varies, n, EFFORTS["balanced"]) if effort is EFFORTS["best"] else []
    return [*less, *(trials if varies else [each.of(n) for each in trials])]


def _made(outline: Outline, plan: Plan, wanted: Wanted, effort: MeshEffort, inner: Points) -> Mesh:
    """Make a mesh of a plan and vertices inside: let them move, and finish."""
    mesh = PlaneTriangulation.constrained(plan.borders, inner)
    with part(0, 1 / 2):
        energies, converged = relax(mesh, plan.field, most=effort.moves, tolerance=effort.tolerance)
    with part(1 / 2, 1):
        mesh = _finished(mesh, outline, plan, wanted, effort)
    about = energies, converged, wanted.n
    return Mesh(mesh.points, mesh.triangles, mesh.tags, mesh.border_edges(), *about, changes=outline.changes)


def _finished(
    mesh: PlaneTriangulation, outline: Outline, plan: Plan, wanted: Wanted, effort: MeshEffort
) -> PlaneTriangulation:
    """Make edges even, and triangles regular; mend small angles, and give polygons the areas that edges cut off."""
    field = plan.field
    if field.isotropic:
        lines = None if outline.mask is not None else StraightParts.of(outline.lines)
        for _ in each(range(effort.sweeps)):
            mesh.even(field.metric(mesh.points), lines)
            mesh.flip(None)
        if not effort.one_size:
            for _ in range(2):
                mesh.smooth()
                mesh.flip(None)
            # A part of an even step: with 0 the mean quality is best, with 1 lengths are.
            mesh.even(field.metric(mesh.points), lines, 0.55)
            mesh.flip(None)
        for _ in range(6):  # vertices of narrow triangles alone
            mesh.smooth(among=mesh.has_angles_below(40.0))
            mesh.flip(None)
        # Where sizes are given, as for the error of a solution, they decide: vertices leave no part for another.
        mesh = mend(
            mesh, field, wanted.grade, effort.mendings if np.isscalar(wanted.size) else 0,
            shortest=wanted.least / 2 if outline.mask is None else 1.0,  # no edge between pixels is shorter than these
            keep_number=wanted.n is not None,
            )  # fmt: skip
    if outline.mask is None:
        _keep_areas(outline, mesh)
    return mesh


def _keep_areas(outline: Outline, mesh: PlaneTriangulation) -> None:
    """Move vertices along their normals, so that polygons lose nothing to edges that cut curves.

    Corners stay, and so do vertices on straight sides, unless one edge cuts off the turn from a side to the next.
    """
    assert outline.areas is not None
    parts, half_edges = StraightParts.of(outline.lines), mesh.half_edges_on_borders()
    edges = mesh.edges[half_edges]
    a, b = mesh.points[edges].transpose(1, 0, 2)
    is_cut = np.linalg.norm(parts.feet((a + b) / 2) - (a + b) / 2, axis=1) > 1e-7 * np.linalg.norm(b - a, axis=1)
    # An edge is on the line that those of its ends are nearest to which are no corners, and goes in its direction.
    inner = np.where(mesh.corners[edges[:, :1]], b, a)
    inner[mesh.corners[edges].all(axis=1)] = ((a + b) / 2)[mesh.corners[edges].all(axis=1)]
    of_line = parts.of_line[parts.nearest(inner)[0]]
    back = mesh.tags[half_edges // 3] != outline.sides[of_line, 0]
    edges[back] = edges[back, ::-1]
    free = ~mesh.corners
    free[edges[~is_cut]] = False
    alone = edges[is_cut & ~free[edges].any(axis=1)]
    free[alone] = ~mesh.corners[alone]
    for _ in range(3 if free[edges].any() else 0):  # where triangles would turn over, they go a part of the way
        moved = outline.areas.kept(mesh.points, edges, of_line, np.empty(0, np.intp), np.flatnonzero(~free))
        mesh.move(moved - mesh.points, free)


def _warn_of_small_angles(mesh: Mesh) -> None:
    """Warn of triangles that are narrow although no corner of a border is, because there are too few vertices."""
    angles = measure_triangles(mesh.points, mesh.triangles).least_angles
    narrow = mesh.triangles[angles < _NARROW]
    # Each is where the two longer sides meet.
    sides = edges_around(narrow)
    lengths = np.linalg.norm(np.subtract(*mesh.points[sides.T]), axis=1).reshape(-1, 3)
    is_longer = lengths > lengths.min(axis=1, keepdims=True)
    on_border = EdgeTable(mesh.edges, len(mesh.points)).find(sides).reshape(-1, 3) >= 0
    wrong = angles[angles < _NARROW][(is_longer & ~on_border).any(axis=1)]
    if len(wrong):
        about = f"the least angle is {wrong.min():.1f} degrees; leave n out for as many as it needs"
        warn(f"the border needs more than n={mesh.n_wanted} vertices: {about}")
