"""Meshes of regions and of segments."""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
from typing import Any
from warnings import warn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_in_range,
    check_labels,
    check_non_negative,
    check_places,
    check_positive,
    check_that,
    hints_at_keywords,
    refuse,
)
from cvtimg._shared.extras import optional
from cvtimg._shared.progress import each, first_few, part, tell
from cvtimg.halfedges import edge_keys, measure_triangles
from cvtimg.meshes.anisotropy import MatrixFunction, MetricField
from cvtimg.meshes.borders import place_on_borders
from cvtimg.meshes.curves import Curves
from cvtimg.meshes.fields import Field
from cvtimg.meshes.interior import place_inside
from cvtimg.meshes.layers import Heights, Layers
from cvtimg.meshes.mending import mend
from cvtimg.meshes.outlines import Outline, label_outline, outline_of, with_points
from cvtimg.meshes.periodic import Pairs, Twins
from cvtimg.meshes.projection import project_to_borders
from cvtimg.meshes.quadratic import quadratic
from cvtimg.meshes.relaxation import Relaxed, relax
from cvtimg.meshes.result import Mesh
from cvtimg.meshes.sizes import SizeLike, size_field
from cvtimg.meshes.triangulation import Borders, PlaneTriangulation
from cvtimg.placement import as_region

Points = NDArray[np.float64]

#: Where nothing is said of sizes, edges are no longer than the diagonal of the region by this number.
_PARTS = 70
#: More vertices than this need more memory than machines have.
_MOST_VERTICES = 1 << 26
#: The number of vertices is met by scaling sizes, in so many rounds, until it is as near as this.
_ROUNDS, _NEAR = 8, 0.01
#: Where it falls by less than this, short edges on borders need them: then sizes grow faster, up to a limit.
_STUCK, _STEEPER, _STEEPEST = 0.8, 1.5, 1.0
#: Borders with more vertices than this multiple of all are not counted to the end.
_TOO_MANY = 1.5
#: Polygons are said to fit if details are left out until they have no more points than this part of all vertices.
_FITTING = 0.2
#: Where that leaves too many on borders, sizes are larger by the first of these factors that does not.
_COARSER = (1.1, 1.25, 1.5, 2.0, 4.0, 10.0, 100.0)


@dataclass(frozen=True, slots=True)
class MeshEffort:
    """Moves of vertices at most, when they rest, sweeps that even edges, trials of small meshes, rounds of mending."""

    moves: int
    tolerance: float
    sweeps: int
    trials: int
    mends: int


#: The registry: names for `effort`.
EFFORTS: dict[str, MeshEffort] = {
    "fast": MeshEffort(10, 1e-2, 2, 1, 4),
    "balanced": MeshEffort(15, 1e-3, 2, 4, 10),
    "best": MeshEffort(300, 1e-4, 5, 24, 20),
}
#: Part of the time of the best effort until vertices move with the balanced one.
_BEST = 0.75
#: Parts of the time until vertices are on borders, which takes longer if they are to be of a number, all are placed,
#: have moved, and edges are even.
_ON_BORDERS, _PLACED, _RELAXED, _EVEN = (0.2, 0.5), 0.5, 0.6, 0.7
#: How vertices come to the boundary.
BOUNDARIES = ("placed", "projected")
#: Logarithm of the ratio of metrics from which on sizes vary.
_VARIES = 0.4
#: How far contours of masks and labels are moved to make them smoother, in pixels.
_TOLERANCE = 0.7
#: Small meshes of one size take more moves and sweeps: as many as move this many vertices in all, at most.
_WORK, _MORE_MOVES, _MORE_SWEEPS = 600_000, 200, 20
#: Meshes of one size with at most so many vertices are tried several times, and the best is kept.
_SMALL = 1000
#: Sweeps before which a trial is compared, beside its end: some measures ask for even edges, others do not.
_CANDIDATES = (0, 2)
#: Vertices on borders of each trial, as a share of the number that sizes ask for.
_SHARES = (1.0, 0.95, 1.0, 0.9)
#: Where sizes vary, sweeps in the end lower the sum of this power of (sum of squared sides) / (4 3^(1/2) area) over
#: triangles, so that the worst counts most.
_SMOOTHING, _POWER = 2, 8
#: A mesh whose least angle is smaller, in degrees, and not at a corner of its border, is warned of.
_NARROW = 10.0
#: No edge on a border between pixels is made shorter than this, in pixels, to mend small angles.
_SHORTEST = 1.0
#: and a last sweep makes edges even again by this part of its steps: with 0 mean quality is best, with 1 lengths are.
_EVEN_AGAIN = 0.55


@hints_at_keywords
def mesh_region(
    region: Any,
    *,
    n: int | None = None,
    edge_length: float | None = None,
    size: SizeLike | None = None,
    grade: float = 0.2,
    min_size: float = 0.0,
    fixed: ArrayLike | None = None,
    keep_points: bool = False,
    metric: MatrixFunction | None = None,
    boundary: str = "placed",
    order: int = 1,
    periodic: str | None = None,
    layers: ArrayLike | None = None,
    effort: str = "balanced",
    rng: int | np.random.Generator = 0,
) -> Mesh:
    """Divide a region of the plane into triangles whose vertices are generators of a centroidal Voronoi tessellation.

    Parameters
    ----------
    region : Region, bool array, polygon coordinates, GeoJSON or shapely geometry
        What `cvtimg.placement.as_region` takes. Corners of polygons, where the boundary turns by more than 30 degrees,
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
        The least size, and the size of details of polygons that are left out.
    fixed : (F, 2) array, optional
        Points of the region that become vertices.
    keep_points : bool
        Make all points of polygons vertices, and not only corners: none is cut off. `n` must be large enough for them.
        Angles are small where points are near to each other.
    metric : callable, optional
        From (M, 2) points to (M, 2, 2) positive definite matrices, by which all edges should have length 1, for edges
        that are longer in some directions; with `n`, only its ratios count. `HuangMetric` makes one of a Hessian.
        Instead of `edge_length` and `size`; `grade` and `min_size` do not limit it.
    boundary : {"placed", "projected"}
        How vertices come to the boundary: placed there first, by sizes; or, as in the lecture cited below, generators
        whose cells reach the boundary are projected to it after each round of Lloyd's method. The latter is there to be
        compared with: its meshes are less regular, and the number of vertices is met only nearly.
    order : {1, 2}
        With 2, triangles have six nodes, and sides on the boundary bend with it: `Mesh.quadratic`. `n` is still the
        number of vertices.
    periodic : {"x", "y", "xy"}, optional
        Borders on the left and right ("x"), or at the least and the greatest y, are copies by translation, and so are
        the vertices on them: `Mesh.pairs`. Sizes should be periodic, too. Not with `layers`.
    layers : (3,) array_like, optional
        Boundary layers: their number, the height of the first, and the growth of the next ones. Rows of vertices run
        parallel to the boundary; inside of them edges are as long as without. Where there is no room, as in thin
        places, layers are thinner, with a warning. Not with `metric`.
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
    TypeError, ValueError
        If an argument is invalid, or if the boundary needs more than `n` vertices; the message names it.
    ImportError
        If PythonCDT or shapely is not installed: ``pip install 'cvtimg[mesh]'``.

    Notes
    -----
    Vertices on the boundary are placed first, at equal steps by the sizes, and closer where two parts of the boundary
    are near to each other. A constrained Delaunay triangulation follows, in which inner vertices move to the centers
    of mass of their cells, with density size^-4, while edges flip. In the end vertices move a little so that edges are
    even; those on the boundary of a polygon slide along it, but for corners. Where angles below 30 degrees are left at
    borders, edges there are split, as in Delaunay refinement, and vertices inside move; with `n`, others are taken away
    where edges are short. Angles that the borders themselves have stay. Last, vertices move off the boundary of
    polygons, along its normals, by as much as edges cut off, so that areas stay; but not with ``order=2`` or
    ``boundary="projected"``. Small meshes of one size are made several times, with more or fewer vertices on the
    boundary, and the most regular one is returned.

    References
    ----------
    Q. Du, M. Gunzburger, Grid generation and optimization based on centroidal Voronoi tessellations, Applied
    Mathematics and Computation 133 (2002) 591-607, doi 10.1016/S0096-3003(01)00260-0.

    M. Gunzburger, Centroidal Voronoi tessellations, lecture.

    J. Ruppert, A Delaunay refinement algorithm for quality 2-dimensional mesh generation, Journal of Algorithms 18
    (1995) 548-585, doi 10.1006/jagm.1995.1021.

    Examples
    --------
    >>> from cvtimg import mesh_region
    >>> mesh = mesh_region([[0, 0], [3, 0], [3, 1], [0, 1]], n=100)
    >>> mesh, round(mesh.area, 9)
    (Mesh(100 vertices, 160 triangles), 3.0)
    """
    least = check_non_negative("min_size", min_size)
    optional("shapely", "mesh")  # the extra that has all that meshes need, before that of regions is named
    outline = outline_of(as_region(region), tolerance=_TOLERANCE, min_size=least, keep_points=keep_points)
    outline = _of_order(order, outline)
    check_choice("boundary", boundary, BOUNDARIES)
    wanted = _Wanted.checked(n, edge_length, size, grade, least, outline.diameter, metric)
    if layers is not None:
        check_that(
            "layers", metric is None and boundary == "placed", "not be given with metric or boundary='projected'"
        )
        wanted = replace(wanted, layers=Heights.checked(layers))
    if periodic is not None:
        is_fit = layers is None and boundary == "placed"
        check_that("periodic", is_fit, "not be given with layers or boundary='projected'")
        wanted = replace(wanted, periodic=periodic)
    if boundary == "projected":
        check_that("metric", metric is None, "not be given with boundary='projected'")
        return _bent(_projected(outline, wanted, fixed, np.random.default_rng(rng)), outline)
    return _bent(_mesh(outline, wanted, fixed, effort, rng), outline)


@hints_at_keywords
def mesh_labels(
    labels: ArrayLike,
    image: Any = None,
    *,
    n: int | None = None,
    edge_length: float | None = None,
    size: SizeLike | None = None,
    grade: float = 0.2,
    min_size: float = 0.0,
    tolerance: float = _TOLERANCE,
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

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or if borders need more than `n` vertices; the message names it.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import mesh_labels
    >>> mesh = mesh_labels(np.repeat([[1, 2]], 8, axis=0).repeat(8, axis=1), n=60)
    >>> len(mesh.points), sorted(set(mesh.tags.tolist())), round(mesh.area, 9)
    (60, [1, 2], 128.0)
    """
    segments = check_labels("labels", labels)
    least = check_non_negative("min_size", min_size)
    outline = _of_order(order, label_outline(segments, image, check_non_negative("tolerance", tolerance)))
    wanted = _Wanted.checked(n, edge_length, size, grade, least, outline.diameter)
    if periodic is not None:
        wanted = replace(wanted, periodic=periodic)
    return _bent(_mesh(outline, wanted, None, effort, rng), outline)


@dataclass(frozen=True, slots=True, eq=False)
class _Wanted:
    """How many vertices, or how long edges."""

    n: int | None
    size: SizeLike
    grade: float
    least: float
    metric: MatrixFunction | None
    layers: Heights | None = None
    periodic: str | None = None

    @property
    def rows(self) -> int:
        """The number of vertices for each one on the border."""
        return 1 if self.layers is None else 1 + self.layers.number

    @classmethod
    def checked(
        cls,
        n: int | None,
        edge_length: float | None,
        size: SizeLike | None,
        grade: float,
        least: float,
        diameter: float,
        metric: MatrixFunction | None = None,
    ) -> _Wanted:
        if n is not None:
            check_count("n", n, _MOST_VERTICES, "what memory holds")
        ways = {"n": n, "edge_length": edge_length, "size": size, "metric": metric}
        given = [name for name, value in ways.items() if value is not None]
        is_clear = given in ([], ["n"], ["edge_length"], ["size"], ["metric"], ["n", "size"], ["n", "metric"])
        check_that(" and ".join(given), is_clear, "be n, edge_length, size, metric, n and size, or n and metric")
        if edge_length is not None:
            check_positive("edge_length", edge_length)
        check_positive("grade", grade)
        otherwise = 1.0 if given else diameter / _PARTS
        wanted = next((each for each in (edge_length, size) if each is not None), otherwise)
        return cls(n, wanted, float(grade), least, metric)


def _of_order(order: int, outline: Outline) -> Outline:
    check_in_range("order", order, order in (1, 2), "1 or 2")
    return replace(outline, on_lines=order == 2)


def _bent(mesh: Mesh, outline: Outline) -> Mesh:
    """Give triangles six nodes where sides shall bend with an outline."""
    if not outline.on_lines:
        return mesh
    found = quadratic(mesh.points, mesh.triangles, mesh.edges, outline, mesh.pairs, mesh.below)
    return replace(mesh, points=found.nodes[: len(mesh.points)], quadratic=found)


def _mesh(
    outline: Outline, wanted: _Wanted, fixed: ArrayLike | None, effort: str, rng: int | np.random.Generator
) -> Mesh:
    check_choice("effort", effort, EFFORTS)
    settings = EFFORTS[effort]
    random = np.random.default_rng(rng)
    still = np.empty((0, 2)) if fixed is None else check_places("fixed", fixed, 2)
    outline, alone = with_points(outline, still)
    if wanted.periodic is not None:
        lines, twins = Twins.of(outline.lines, outline.sides, outline.bounds, wanted.periodic)
        outline = replace(outline, lines=lines, twins=twins)
    curves = Curves(outline, still) if outline.mask is None and not outline.on_lines else None
    meshes: list[tuple[Mesh, Layers | None]] = []
    is_small = wanted.n is not None and wanted.n <= _SMALL  # else there is one trial, or it is short
    for trial in each(range(settings.trials)) if is_small else range(settings.trials):
        with part(0, 1 if is_small or effort != "best" else _BEST):
            meshes += _made(outline, curves, wanted, alone, settings, random, _SHARES[trial % len(_SHARES)])
        if len(meshes) == 1 and effort == "best":  # where sizes vary, more moves are not always better
            with part(_BEST, 1):
                meshes += _made(outline, curves, wanted, alone, EFFORTS["balanced"], np.random.default_rng(rng), 1.0)
            return _whole(*max(meshes, key=lambda made: float(made[0].qualities.mean())))
        if len(meshes) == 1:
            break
    best, layers = meshes[0] if len(meshes) == 1 else min(meshes, key=lambda made: _irregularity(made[0]))
    if wanted.n is not None and fixed is None and wanted.metric is None and np.isscalar(wanted.size):
        _warn_of_small_angles(best)
    return _whole(best, layers)


def _whole(mesh: Mesh, layers: Layers | None) -> Mesh:
    """Put layers around a mesh, and warn where they are thinner than wanted."""
    if layers is None:
        return mesh
    if layers.thin:
        share = f"{100 * layers.thin:.0f} %" if layers.thin > 0.01 else "1 %"
        warn(f"layers are thinner along {share} of the border, at thin places or corners", stacklevel=5)
    return layers.around(mesh)


def _warn_of_small_angles(mesh: Mesh) -> None:
    """Warn of triangles that are narrow although no corner of a border is, because there are too few vertices."""
    angles, n = measure_triangles(mesh.points, mesh.triangles).least_angles, len(mesh.points)
    narrow = mesh.triangles[angles < _NARROW]
    # Each is where the two longer sides meet.
    sides = np.linalg.norm(mesh.points[narrow] - mesh.points[np.roll(narrow, -1, axis=1)], axis=2)
    longer = sides > sides.min(axis=1, keepdims=True)
    keys = [edge_keys(narrow[:, [k, (k + 1) % 3]], n) for k in range(3)]
    is_corner = (np.isin(np.stack(keys, axis=1), edge_keys(mesh.edges, n)) | ~longer).all(axis=1)
    if not is_corner.all():
        least = angles[angles < _NARROW][~is_corner].min()
        hint = "leave n out for as many as it needs"
        warn(
            f"the border needs more than n={mesh.n_wanted} vertices: the least angle is {least:.1f} degrees; {hint}",
            stacklevel=5,
        )


def _made(
    outline: Outline,
    curves: Curves | None,
    wanted: _Wanted,
    alone: Points,
    settings: MeshEffort,
    random: np.random.Generator,
    share: float,
) -> list[tuple[Mesh, Layers | None]]:
    """Make a mesh once, with a share of the vertices that borders should have, and the layers that belong around it.

    Small meshes of one size are returned as they are before edges are even, too.
    """
    with part(0, _ON_BORDERS[wanted.n is not None]):
        borders, field = _borders(outline, wanted, alone, share)
    n = wanted.n if wanted.n is not None else _number(borders, field, wanted.layers)
    layers: Layers | None = None
    if wanted.layers is not None:
        if curves is not None:  # layers are parallel to where vertices end
            frame = PlaneTriangulation.constrained(borders, np.empty((0, 2)))
            curves.keep_areas(frame)
            borders, curves = replace(borders, points=frame.points), None
        layers = Layers.of(borders, wanted.layers)
        borders, field = layers.inner(borders, field, wanted.grade)
        least = layers.number + len(borders.points)
        check_in_range("n", n, wanted.n is None or n >= least, f"at least {least}, the vertices of layers")
        n = max(n - layers.number, len(borders.points))
    inner = place_inside(borders, field, n - len(borders.points), random)
    mesh = PlaneTriangulation.constrained(borders, inner)
    _check_inside(alone, mesh.points)
    varies = field.isotropic and float(np.ptp(np.log(field.metric(mesh.points)[:, 0]))) > _VARIES
    is_tried = field.isotropic and not varies and n <= _SMALL
    moves = settings.moves if varies else max(settings.moves, min(_MORE_MOVES, _WORK // n))
    with part(_PLACED, _RELAXED if field.isotropic else 1):
        relaxed = relax(mesh, field.metric, isotropic=field.isotropic, most=moves, tolerance=settings.tolerance)
    made: list[tuple[Mesh, Layers | None]] = []
    if field.isotropic:
        n_sweeps = settings.sweeps if varies else max(settings.sweeps, min(_MORE_SWEEPS, _WORK // n))
        for sweep in range(n_sweeps):
            tell(_RELAXED + (_EVEN - _RELAXED) * sweep / n_sweeps)
            if is_tried and sweep in _CANDIDATES:
                made.append((_result(mesh, curves, relaxed, wanted.n, borders.pairs), layers))
            mesh.even(field.metric(mesh.points))
            mesh.flip(None)
        for _ in range(_SMOOTHING if varies else 0):
            mesh.smooth(field.metric(mesh.points), _POWER)
            mesh.flip(None)
        if varies:
            mesh.even(field.metric(mesh.points), _EVEN_AGAIN)
            mesh.flip(None)
        shortest = np.inf if layers is not None else 0.0 if outline.mask is None else _SHORTEST
        # Where sizes are given, as for the error of a solution, they decide: vertices leave no part for another.
        rounds = settings.mends if np.isscalar(wanted.size) else 0
        with part(_EVEN, 1):
            whole = np.empty(0, np.int32) if borders.pairs is None else borders.pairs.vertices
            keeps = wanted.n is not None
            mesh = mend(mesh, field, wanted.grade, shortest=shortest, rounds=rounds, keep_number=keeps, whole=whole)
    return [*made, (_result(mesh, curves, relaxed, wanted.n, borders.pairs), layers)]


def _result(
    mesh: PlaneTriangulation, curves: Curves | None, relaxed: Relaxed, n: int | None, pairs: Pairs | None
) -> Mesh:
    state = mesh.state()
    if curves is not None:
        curves.keep_areas(mesh)
    if pairs is not None:
        pairs.align(mesh.points)
    found = Mesh(
        mesh.points.copy(),
        mesh.triangles.copy(),
        mesh.tags,
        mesh.border_edges(),
        relaxed.energies,
        relaxed.converged,
        n,
        pairs=None if pairs is None else pairs.vertices,
    )
    mesh.restore(state)
    return found


def _projected(outline: Outline, wanted: _Wanted, fixed: ArrayLike | None, rng: np.random.Generator) -> Mesh:
    """Make a mesh in whose rounds vertices are projected to borders."""
    outline, alone = with_points(outline, np.empty((0, 2)) if fixed is None else check_places("fixed", fixed, 2))
    placed, field = _borders(outline, wanted, alone, 1.0)
    n = wanted.n if wanted.n is not None else _number(placed, field, None)
    ends = [line[[0, -1]] for line in outline.lines if (line[0] != line[-1]).any()]
    corners = np.unique(np.concatenate([alone, *ends]), axis=0)
    borders, inner = project_to_borders(outline, field, n, corners, rng)
    mesh = PlaneTriangulation.constrained(replace(borders, points=np.concatenate([borders.points, alone])), inner)
    rest = relax(mesh, field.metric, isotropic=True, most=0, tolerance=0.0)
    return Mesh(mesh.points, mesh.triangles, mesh.tags, mesh.border_edges(), rest.energies, rest.converged, n)


def _irregularity(mesh: Mesh) -> float:
    """Sum the logarithms of the eight measures."""
    measures = astuple(mesh.measures())[:8]
    return float(np.log(np.maximum(measures, 1e-300)).sum())


def _borders(outline: Outline, wanted: _Wanted, alone: Points, share: float) -> tuple[Borders, Field]:
    """Place vertices on borders, with sizes that come to the wanted number of vertices.

    The number on borders is by a share of what sizes ask for.
    """
    ends = np.concatenate([alone, *(line[[0, -1]] for line in outline.lines)])
    most = np.inf if wanted.n is None else wanted.n / wanted.rows
    _check_fits(outline, wanted, len(np.unique(ends, axis=0)))
    start: Field
    if wanted.metric is not None:
        start = MetricField.of(wanted.metric, outline, wanted.n, ends)
    else:
        start = size_field(outline, wanted.size, wanted.n, wanted.least, ends)
        fits = start.count <= _MOST_VERTICES
        check_that(
            "sizes", fits, f"ask for at most {_MOST_VERTICES} vertices, which memory holds, not {start.count:.3g}"
        )
    factor, grade, before, on_curves = 1.0, wanted.grade, np.inf, 2
    for _ in first_few(range(_ROUNDS), 0.5):
        field = start.scaled(factor).limited(grade, wanted.least)
        borders, field = place_on_borders(outline, field, grade, wanted.least, share, _TOO_MANY * most, on_curves)
        borders, field = _with_alone(borders, field, alone, grade)
        if wanted.n is None:
            return borders, field
        ratio = _number(borders, field, wanted.layers) / wanted.n
        if abs(ratio - 1) < _NEAR:
            break
        if len(borders.points) > most and on_curves == 2:  # areas are given up before angles
            on_curves = 1
            continue
        factor *= ratio**0.5
        if len(borders.points) > most:
            if grade >= _STEEPEST or ratio > _TOO_MANY:
                break
            grade = _STEEPEST
        elif ratio > _STUCK * before:
            grade = min(grade * _STEEPER, max(grade, _STEEPEST))
        before = ratio
    # The coarsest first: where the border needs too many by any sizes, that is known at once.
    for coarser in first_few((_COARSER[-1], *_COARSER) if len(borders.points) > most else ()):
        field = start.scaled(coarser * factor)
        borders, field = place_on_borders(outline, field, _STEEPEST, wanted.least, share, most, on_curves=1)
        borders, field = _with_alone(borders, field, alone, _STEEPEST)
        if (len(borders.points) > most) == (coarser == _COARSER[-1]):
            break
    _check_fits(outline, wanted, len(borders.points))
    return borders, field


def _check_fits(outline: Outline, wanted: _Wanted, n_least: int) -> None:
    """Refuse fewer vertices than there must be, and say by how large details there would be less."""
    if wanted.n is None or wanted.rows * n_least <= wanted.n:
        return
    size = outline.detail_for(int(_FITTING * wanted.n))
    hint = f"; or give min_size={size:.1g}, to leave out details of the border" if size > wanted.least else ""
    refuse("n", wanted.n, f"at least {wanted.rows * n_least}, the vertices that the border needs{hint}")


def _with_alone(borders: Borders, field: Field, alone: Points, grade: float) -> tuple[Borders, Field]:
    """Add fixed points that are on no border; sizes around them are no larger than their distances."""
    if not len(alone):
        return borders, field
    from scipy.spatial import cKDTree

    points = np.concatenate([borders.points, alone])
    gaps = cKDTree(points).query(alone, 2)[0][:, 1]
    return replace(borders, points=points), field.lowered(alone, gaps, grade)


def _check_inside(alone: Points, points: Points) -> None:
    """Check that no edge on the border cuts off a fixed point."""
    from scipy.spatial import cKDTree

    lost = alone[cKDTree(points).query(alone)[0] > 0] if len(alone) else alone
    near = f"fixed has {lost[:1].ravel().tolist()}, near which edges on the border"
    check_that(near, not len(lost), "be shorter: give more vertices, or smaller sizes")


def _number(borders: Borders, field: Field, layers: Heights | None) -> int:
    """About how many vertices a mesh has: two triangles for each inner vertex, by Euler's formula."""
    n_boundary = int((borders.sides.min(axis=1) <= 0).sum())
    more = 0.0 if layers is None else layers.more(borders, field)
    return max(round(field.count + n_boundary / 2 + 1 + more), len(borders.points))
