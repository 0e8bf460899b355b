"""Placement of generators in any region: what is asked for decides how cells are integrated."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import ENOUGH_SAMPLES, GIVEN, MOST_POINTS
from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_in_range,
    check_needs,
    check_picture_density,
    check_places,
    check_shape,
    check_that,
)
from cvtimg._shared.choices import EffortName
from cvtimg._shared.iteration import Callback, Watch
from cvtimg._shared.types import Array, Floats32, Points
from cvtimg.engine.samples import MAX_ORDERED_DIMS, WeightedSamples, along_curve
from cvtimg.placement.cells import PolygonMoments
from cvtimg.placement.densities import Density, DensityLike, PictureDensity, as_density
from cvtimg.placement.descent import DESCENTS, Projection, Terms
from cvtimg.placement.moments import CellMoments, SampleMoments
from cvtimg.placement.pictures import EFFORTS, PlacementEffort, check_apart, picture_moments, place_by_levels
from cvtimg.placement.polygons import PictureRegion, as_region
from cvtimg.placement.regions import Box, Region
from cvtimg.placement.result import Placement

#: Candidates of a start for each generator.
_CANDIDATES = 32
#: Requirement for every density.
_NOT_0 = "not be 0 everywhere in the region"


def place_generators(
    region: object,
    n_generators: int,
    *,
    density: DensityLike = None,
    fixed: ArrayLike | None = None,
    on_boundary: ArrayLike | str | None = None,
    metric: float = 2,
    method: str | None = None,
    effort: EffortName = "balanced",
    rng: int | np.random.Generator = 0,
    callback: Callback | None = None,
) -> Placement:
    """Place generators in a region, each at the center of mass of its own Voronoi cell.

    Parameters
    ----------
    region : Region, bool array, polygon coordinates, GeoJSON, shapely geometry or None
        What `cvtimg.placement.as_region` takes; None for all of the image that `density` is.
    n_generators : int
        Number of generators K, those that are fixed or on the boundary among them.
    density : None, float, (H, W) array or callable
        What `cvtimg.placement.as_density` takes: 1 everywhere, a number, an image, or a function of (N, D) points.
    fixed : (L, D) array, optional
        Generators that stay in place: the first L of the K.
    on_boundary : (B, D) array or "auto", optional
        Points of the boundary, which stay, such as some of `Region.boundary_points`; or "auto" to let generators whose
        cells meet the boundary move along it. These follow the fixed ones; with "auto" they may be any, and the energy
        may rise at some moves.
    metric : float
        Power p of the p-norm, by which places are nearest and which is squared in the energy: 2, the Euclidean, 1, 20,
        numpy.inf.
    method : {"l-bfgs", "over-relaxed", "lloyd"}, optional
        How generators move: "lloyd" by default with ``on_boundary="auto"``, else "l-bfgs".
    effort : {"fast", "balanced", "best"}
        How long. "best" takes the lowest of 8 starts unless the region is an image.
    rng : int or numpy.random.Generator
        Seed. The same seed gives the same bits, whatever the number of threads.
    callback : callable, optional
        Called before each move with its number and the energy; it stops by returning True.

    Returns
    -------
    Placement

    Notes
    -----
    Cells are integrated exactly over the pixels of an image; as polygons in other regions of the plane, exactly for
    a constant density; and over samples for other dimensions and metrics. There are about density^(D / (D + 2))
    generators in a part of space. In an image, the callback is given the energies of coarser levels at first, and
    points that are not fixed are in about the order of a curve.

    References
    ----------
    Q. Du, V. Faber, M. Gunzburger, SIAM Review 41 (1999) 637-676, doi 10.1137/S0036144599352836.

    Examples
    --------
    >>> from cvtimg import place_generators
    >>> from cvtimg.placement import Box
    >>> placement = place_generators(Box([0, 0], [2, 1]), 2)
    >>> sorted(placement.points.round(3).tolist())
    [[0.5, 0.5], [1.5, 0.5]]
    """
    weight, shape = as_density(density), np.shape(density)  # type: ignore[arg-type]
    check_needs("region=None", region is None, "an image as density", len(shape) > 0)
    where = as_region(np.ones(shape, bool) if region is None else region)
    check_in_range("metric", metric, metric >= 1, ">= 1, the power of a p-norm")
    n_generators = check_count("n_generators", n_generators, MOST_POINTS, "what memory holds")
    settings, random = EFFORTS[check_choice("effort", effort, EFFORTS)], np.random.default_rng(rng)
    auto = isinstance(on_boundary, str)
    if isinstance(on_boundary, str):
        check_choice("on_boundary", on_boundary, ("auto",))
    descend = DESCENTS[check_choice("method", method or ("lloyd" if auto else "l-bfgs"), DESCENTS)]
    still = _still(where, n_generators, fixed, None if auto else on_boundary)
    terms = Terms(
        settings.elsewhere,
        free=np.arange(n_generators) >= len(still) if len(still) else None,
        project=_projection(where, n_generators if auto else None),
        may_rise=auto,
        watch=Watch(callback),
    )
    if isinstance(where, PictureRegion) and where.n_dims == 2 and metric == 2:
        moments, watch = picture_moments(_on_pixels(where, weight), n_generators), terms.watch
        end = place_by_levels(moments, n_generators, still, descend, settings, random, watch)
        if auto:
            end = descend(moments, end.generators, replace(terms, stopping=settings.in_picture))
        return Placement.of(end, where)
    cells: CellMoments
    if where.is_polygonal and metric == 2:
        cells = PolygonMoments(where, weight)
    else:
        cells = SampleMoments(_samples(where, weight, n_generators, settings, random), metric, where)
    ends = []
    for _ in range(settings.n_starts):
        start = np.concatenate([still, draw_start(where, weight, n_generators - len(still), random)])
        ends.append(descend(cells, start, terms))
        if terms.watch.stopped:
            break
    return Placement.of(min(ends, key=lambda end: end.energies[-1]), where)


def _projection(region: Region, n_on_boundary: int | None) -> Projection | None:
    """Keep points in the region, and bring them to its boundary if asked to; around a periodic box they may go."""
    if n_on_boundary is not None:
        return _to_boundary(region, n_on_boundary)
    if isinstance(region, Box):  # a descent compares places that are not wrapped
        ends = zip((-np.inf, np.inf), region.bounds, strict=True)
        low, high = (np.where(region.periodic, far, end) for far, end in ends)
        return lambda there, before: np.clip(there, low, high)
    return lambda there, before: region.project(there)


def _to_boundary(region: Region, n_generators: int) -> Projection:
    """Bring to a corner the generator whose cell held it, and to the boundary those whose cells met it.

    The energy may rise at a move. M. Gunzburger's lecture on centroidal Voronoi tessellations has the recipe.
    """
    from scipy.spatial import cKDTree

    spacing, corners = (region.measure / n_generators) ** (1 / region.n_dims), region.corners
    boundary = region.boundary_points(spacing / 8)
    check_needs("on_boundary='auto'", True, f"a region with a boundary, not {region!r}", len(boundary) > 0)

    def project(there: Points, before: Points) -> Points:
        tree, moved = cKDTree(before), region.project(there)
        meets = np.unique(tree.query(boundary)[1])
        moved[meets] = region.to_boundary(moved[meets])
        if len(corners):
            gaps, owner = tree.query(corners)
            # The nearest corner last, so that it wins where a cell holds several.
            for corner in np.argsort(-gaps, kind="stable"):
                moved[owner[corner]] = corners[corner]
        return moved

    return project


def _still(region: Region, n_generators: int, fixed: ArrayLike | None, on_boundary: Any) -> Points:
    """Return the generators that stay: those fixed, then those on the boundary."""
    parts = [np.empty((0, region.n_dims))]
    if fixed is not None:
        parts.append(check_places("fixed", fixed, region.n_dims))
    if on_boundary is not None:
        points = check_places("on_boundary", on_boundary, region.n_dims)
        off = np.linalg.norm(region.to_boundary(points) - points, axis=1)
        size = float(np.linalg.norm(region.bounds[1] - region.bounds[0]))
        worst = points[off.argmax()].tolist()
        check_in_range("on_boundary", worst, off.max() <= GIVEN * size, f"on the boundary, which is {off.max():g} away")
        parts.append(points)
    still = np.concatenate(parts)
    name = "fixed" if on_boundary is None else "fixed and on_boundary"
    check_that(name, len(still) < n_generators, f"have fewer than n_generators={n_generators}, not {len(still)}")
    check_apart(name, still, region.bounds)
    return still


def _on_pixels(region: PictureRegion, density: Density) -> Floats32:
    shape = region.mask.shape
    if isinstance(density, PictureDensity):
        values: Array = density.picture
        check_shape("density", values.shape, values.shape == shape, f"{shape}, as the region")
    else:
        y, x = np.indices(shape) + 0.5
        values = density(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(shape)
    inside = np.where(region.mask, values, values.dtype.type(0))
    check_that("density", inside.any(), _NOT_0)
    return check_picture_density("density", inside)


def _samples(
    region: Region, density: Density, n_generators: int, effort: PlacementEffort, rng: np.random.Generator
) -> WeightedSamples:
    n = int(np.clip(effort.samples * n_generators, ENOUGH_SAMPLES // 8, effort.most_samples * ENOUGH_SAMPLES))
    n = max(n, 4 * n_generators)
    samples = region.sample(n, density=density, rng=rng)
    check_that("density", samples.density.any(), _NOT_0)
    return samples


def draw_start(region: Region, density: Density, n_generators: int, rng: np.random.Generator) -> Points:
    """Draw K starting points with density rho^(D / (D + 2)), sorted along a curve in few dimensions."""
    n_dims = region.n_dims
    points = region.draw(max(_CANDIDATES * n_generators, 1024), rng)
    if n_dims <= MAX_ORDERED_DIMS:
        points = points[along_curve(points)]
    weights = np.cumsum(density(points) ** (n_dims / (n_dims + 2)))
    check_that("density", weights[-1] > 0, _NOT_0)
    chosen = np.searchsorted(weights, (np.arange(n_generators) + rng.random()) / n_generators * weights[-1])
    return points[np.minimum(chosen, len(points) - 1)]
