"""Placement of generators in any region: what is asked for decides how cells are integrated."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_fewer,
    check_in_range,
    check_places,
    check_shape,
    check_that,
    hints_at_keywords,
)
from cvtimg._shared.choices import EffortName
from cvtimg._shared.iteration import Callback, Watch
from cvtimg.engine.samples import MAX_ORDERED_DIMS, along_curve
from cvtimg.placement.boundaries import ToBoundary, checked_boundary, spread_along_boundary
from cvtimg.placement.cells import PolygonMoments
from cvtimg.placement.densities import Density, DensityLike, PictureDensity, Points, as_density
from cvtimg.placement.descent import DESCENTS, Projection, Terms
from cvtimg.placement.metrics import LpGauge, MetricLike, PolygonGauge, as_gauge
from cvtimg.placement.moments import CellMoments
from cvtimg.placement.pictures import EFFORTS, MOST_GENERATORS, check_apart, picture_moments, place_by_levels
from cvtimg.placement.polygons import PictureRegion, as_region
from cvtimg.placement.regions import Box, Region
from cvtimg.placement.result import Placement
from cvtimg.placement.samples import FigureMoments, Figures, SampleMoments

#: Candidates of a start for each generator.
_CANDIDATES = 32
#: Least and greatest density of pixels, whose sums are kept in single precision.
_FAINTEST, _GREATEST = 1e-30, 1e30
_FOR_PIXELS = f"in {_FAINTEST:g}..{_GREATEST:g} where the region is a mask"
#: Requirement for every density.
_NOT_0 = "not be 0 everywhere in the region"
#: Samples where cells are not integrated exactly, at least.
_FEWEST_SAMPLES = 1 << 14


@hints_at_keywords
def place_generators(
    region: Any,
    n_generators: int,
    *,
    density: DensityLike = None,
    fixed: ArrayLike | None = None,
    on_boundary: ArrayLike | str | None = None,
    metric: MetricLike = 2,
    generators: str | Figures = "points",
    method: str | None = None,
    effort: EffortName = "balanced",
    rng: int | np.random.Generator = 0,
    callback: Callback | None = None,
) -> Placement:
    """Place generators in a region, each at the center of mass of its own Voronoi cell.

    Parameters
    ----------
    region : Region, bool array, polygon coordinates, GeoJSON or shapely geometry
        What `cvtimg.placement.as_region` takes.
    n_generators : int
        Number of generators K, those that are fixed or on the boundary among them.
    density : None, float, (H, W) array or callable
        What `cvtimg.placement.as_density` takes: 1 everywhere, a number, an image, or a function of (N, D) points.
    fixed : (L, D) array, optional
        Generators that stay in place: the first L of the K.
    on_boundary : (B, D) array, int or "auto", optional
        Points of the boundary, which stay; or how many to spread along it, corners first, before the others are
        placed (in the plane); or "auto" to let generators whose cells meet the boundary move along it. These follow
        the fixed ones; with "auto" they may be any, and the energy may rise at some moves.
    metric : float, str or (M, 2) array
        Power p of the p-norm, by which places are nearest and which is squared in the energy: 2, the Euclidean, 1, 20,
        numpy.inf; "triangle"; or the corners of a convex polygon around the origin, where the distance is 1.
    generators : "points" or Figures
        `Segments` or `Circles` in place of points, in the plane.
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

    See Also
    --------
    cvtimg.placement.place_in_picture, cvtimg.placement.place_by_draws, cvtimg.tessellate, cvtimg.support_radii

    Notes
    -----
    Cells are integrated exactly over the pixels of an image; as polygons in other regions of the plane, exactly for
    a constant density; and over samples for other dimensions, metrics and figures.

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
    where, weight, gauge = as_region(region), as_density(density), as_gauge(metric)
    flat = not isinstance(gauge, PolygonGauge) or where.n_dims == 2
    check_in_range("metric", metric, flat, "the power of a p-norm where the region is not in the plane")
    check_count("n_generators", n_generators, MOST_GENERATORS, "what memory holds")
    check_choice("effort", effort, EFFORTS)
    auto = isinstance(on_boundary, str)
    if isinstance(on_boundary, str):
        check_choice("on_boundary", on_boundary, ("auto",))
    name = check_choice("method", method or ("lloyd" if auto else "l-bfgs"), DESCENTS)
    random = np.random.default_rng(rng)
    if isinstance(generators, str):
        check_choice("generators", generators, ("points",))
    else:
        plain = fixed is None and on_boundary is None and gauge == LpGauge(2) and where.n_dims == 2
        allowed = "in the plane, with metric=2, none fixed or on the boundary"
        check_in_range("generators", generators, plain, allowed)
        # Around points that stand apart: figures that cross at the start would stay so.
        samples, first = _samples(where, weight, n_generators, effort, random), Terms(EFFORTS["fast"].elsewhere)
        drawn = draw_start(where, weight, n_generators, random)
        apart = DESCENTS[name](SampleMoments(samples, LpGauge(2)), drawn, first).generators
        begin = generators.start(apart, (where.measure / n_generators) ** 0.5, random)
        terms = Terms(EFFORTS[effort].elsewhere, project=generators.project, watch=Watch(callback))
        return Placement.of(DESCENTS[name](FigureMoments(samples, generators), begin, terms), where, generators)
    still = _still(where, weight, n_generators, fixed, None if auto else on_boundary)
    settings = EFFORTS[effort]
    terms = Terms(
        settings.elsewhere,
        free=np.arange(n_generators) >= len(still) if len(still) else None,
        project=_projection(where, n_generators if auto else None),
        may_rise=auto,
        watch=Watch(callback),
    )
    if isinstance(where, PictureRegion) and where.n_dims == 2 and gauge == LpGauge(2):
        moments, watch = picture_moments(_on_pixels(where, weight), n_generators), terms.watch
        end = place_by_levels(moments, n_generators, still, name, settings, random, watch)
        if auto:
            end = DESCENTS[name](moments, end.generators, replace(terms, stopping=settings.in_picture))
        return Placement.of(end, where)
    if where.is_polygonal and gauge == LpGauge(2):
        cells: CellMoments = PolygonMoments(where, weight)
    else:
        cells = SampleMoments(_samples(where, weight, n_generators, effort, random), gauge, where)
    ends = []
    for _ in range(settings.n_starts):
        start = np.concatenate([still, draw_start(where, weight, n_generators - len(still), random)])
        ends.append(DESCENTS[name](cells, start, terms))
        if terms.watch.stopped:
            break
    return Placement.of(min(ends, key=lambda end: end.energies[-1]), where)


def _projection(region: Region, n_on_boundary: int | None) -> Projection | None:
    """Keep points in the region, and bring them to its boundary if asked to; around a periodic box they may go."""
    if n_on_boundary is not None:
        return ToBoundary(region, n_on_boundary)
    if isinstance(region, Box):
        return None  # centers of mass lie inside, and a descent compares places that are not wrapped
    return lambda there, before: region.project(there)


def _still(region: Region, density: Density, n_generators: int, fixed: ArrayLike | None, on_boundary: Any) -> Points:
    """Return the generators that stay: those fixed, then those on the boundary."""
    parts = [np.empty((0, region.n_dims))]
    if fixed is not None:
        parts.append(check_places("fixed", fixed, region.n_dims))
    if on_boundary is not None and np.ndim(on_boundary) == 0:
        n = check_count("on_boundary", on_boundary, n_generators, "n_generators")
        parts.append(spread_along_boundary(region, n, density))
    elif on_boundary is not None:
        parts.append(checked_boundary(on_boundary, region))
    still = np.concatenate(parts)
    check_fewer("fixed and on_boundary", len(still), n_generators)
    check_apart("fixed and on_boundary" if on_boundary is not None else "fixed", still, region.bounds)
    return still


def _on_pixels(region: PictureRegion, density: Density) -> NDArray[np.float32]:
    """Density of each pixel of a mask."""
    height, width = region.mask.shape
    if isinstance(density, PictureDensity):
        values, shape = density.picture, region.mask.shape
        check_shape("density", values.shape, values.shape == shape, f"{shape}, as the region")
    else:
        y, x = np.mgrid[:height, :width] + 0.5
        exact = density(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(height, width)
        largest = float(exact[region.mask].max())
        check_that("density", largest > 0, _NOT_0)
        check_in_range("the largest density", largest, _FAINTEST <= largest <= _GREATEST, _FOR_PIXELS)
        values = exact.astype(np.float32)
    inside = np.where(region.mask, values, np.float32(0))
    check_that("density", inside.any(), _NOT_0)
    return inside


def _samples(region: Region, density: Density, n_generators: int, effort: EffortName, rng: np.random.Generator) -> Any:
    settings = EFFORTS[effort]
    n = int(np.clip(settings.samples * n_generators, _FEWEST_SAMPLES, settings.most_samples))
    samples = region.sample(max(n, 4 * n_generators), density=density, rng=rng)
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
    own = np.searchsorted(weights, (np.arange(n_generators) + rng.random()) / n_generators * weights[-1])
    return points[np.minimum(own, len(points) - 1)]
