"""Regions of every kind, by what all of them promise, and each against what is known of it."""

from typing import Any

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from cvtimg.placement import Box, ImplicitRegion, PictureRegion, PolygonRegion, Region, as_density, as_region

STAR = [
    [(1 + 0.3 * np.cos(5 * a)) * np.cos(a), (1 + 0.3 * np.cos(5 * a)) * np.sin(a)]
    for a in np.linspace(0, 2 * np.pi, 600, endpoint=False)
]
HOLE = [[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]]


def disk_mask(side: int, n_dims: int = 2) -> Any:
    at = np.moveaxis(np.indices((side,) * n_dims), 0, -1) + 0.5 - side / 2
    return (at**2).sum(axis=-1) < (0.4 * side) ** 2


REGIONS: dict[str, Region] = {
    "box": Box([0, -1], [3, 1]),
    "interval": Box(0, 2),
    "box in 4 dimensions": Box([0] * 4, [1, 2, 3, 4]),
    "tube": Box([0, 0], [2, 1], periodic=[True, False]),
    "polygon": PolygonRegion([STAR, HOLE]),
    "two polygons": PolygonRegion(shapely.union(shapely.box(0, 0, 1, 1), shapely.box(2, 0, 3, 2))),
    "pixels": PictureRegion(disk_mask(40)),
    "voxels": PictureRegion(disk_mask(16, 3)),
    "disk": ImplicitRegion(lambda p: np.hypot(p[:, 0], p[:, 1]) - 1, [-1.5, -1.2], [1.2, 1.5]),
    "ball": ImplicitRegion(lambda p: (p**2).sum(axis=1) - 1, [-1] * 3, [1] * 3),
}
EVERY = pytest.mark.parametrize("region", REGIONS.values(), ids=REGIONS)


def around(region: Region, n: int = 500) -> Any:
    low, high = region.bounds
    return low + (high - low) * (np.random.default_rng(0).random((n, region.n_dims)) * 1.6 - 0.3)


@EVERY
def test_drawn_points_lie_inside_and_fill_it(region: Region) -> None:
    points = region.draw(4000, rng=1)
    assert points.shape == (4000, region.n_dims)
    assert region.contains(points).all()
    # What share lies in a part of the bounds is what share of other points does.
    half = points[:, 0] < region.bounds[:, 0].mean()
    assert half.mean() == pytest.approx((region.draw(4000, rng=2)[:, 0] < region.bounds[:, 0].mean()).mean(), abs=0.03)


@EVERY
def test_projected_points_lie_inside_and_those_inside_stay(region: Region) -> None:
    places = around(region)
    inside = region.contains(places)
    ends = region.project(places)
    low, high = region.bounds
    shrunk = ends + 1e-6 * ((low + high) / 2 - ends)
    assert (region.contains(ends) | region.contains(shrunk)).all()
    if not isinstance(region, Box) or not any(region.periodic):
        assert (ends[inside] == places[inside]).all()


@EVERY
def test_points_go_to_the_nearest_point_of_the_boundary(region: Region) -> None:
    places = region.project(around(region, 200))
    ends = region.to_boundary(places)
    spacing = float((region.bounds[1] - region.bounds[0]).max()) / (60 if region.n_dims < 3 else 6)
    boundary = region.boundary_points(spacing)
    nearest = cKDTree(boundary).query(places)[0]
    found = np.linalg.norm(ends - places, axis=1)
    assert (found <= nearest + 1e-9).all()
    assert (found >= nearest - 1.5 * max(spacing, isinstance(region, PictureRegion) * 0.5)).all()
    np.testing.assert_allclose(region.to_boundary(ends), ends, atol=1e-6)


@EVERY
def test_its_measure_and_samples_of_a_density_are_those_of_places_in_its_bounds(region: Region) -> None:
    low, high = region.bounds
    places = low + (high - low) * np.random.default_rng(0).random((80000, region.n_dims))
    inside = region.contains(places)
    assert region.measure == pytest.approx(inside.mean() * (high - low).prod(), rel=0.03)
    samples = region.sample(20000, density=lambda p: p[:, 0] - low[0])
    expected = ((places[:, 0] - low[0]) * inside).mean() * (high - low).prod()
    assert samples.density.sum() == pytest.approx(expected, rel=0.02)


def test_corners() -> None:
    assert len(Box([0] * 3, [1] * 3).corners) == 8
    assert len(Box([0, 0], [1, 1], periodic=True).corners) == 0
    assert len(PolygonRegion([STAR, HOLE]).corners) == 4
    assert len(PictureRegion(np.ones((3, 5), bool)).corners) == 4
    assert len(PictureRegion(disk_mask(9)).corners) == 0


def test_a_mask_has_the_polygons_of_its_contours() -> None:
    mask = disk_mask(40)
    mask[18:22, 18:22] = False
    assert PictureRegion(mask).outline().area == mask.sum()
    assert PictureRegion(~mask).outline().area == (~mask).sum()


RING = {"type": "Polygon", "coordinates": [[[0, 0], [2, 0], [2, 2], [0, 2], [0, 0]]]}
PAIR = {"type": "MultiPolygon", "coordinates": [[[[5, 0], [6, 0], [6, 1], [5, 0]]]]}
FEATURES: list[dict[str, Any]] = [{"type": "Feature", "geometry": shape} for shape in (RING, PAIR)]


@pytest.mark.parametrize(
    ("given", "measure"),
    [
        *((RING, 4), (FEATURES[1], 0.5), ({"type": "FeatureCollection", "features": FEATURES}, 4.5)),
        *((Box(0, 1), 1), (np.ones((2, 2), bool), 4), (shapely.box(0, 0, 2, 3), 6), ([[0, 0], [2, 0], [0, 2]], 2)),
    ],
    ids=str,
)
def test_as_region_takes_what_stands_for_one(given: Any, measure: float) -> None:
    assert as_region(given).measure == measure


def test_a_picture_is_interpolated_between_the_centers_of_pixels() -> None:
    picture = np.random.default_rng(0).random((4, 5))
    density = as_density(picture)
    y, x = np.mgrid[:4, :5]
    np.testing.assert_allclose(density(np.stack([x.ravel(), y.ravel()], 1) + 0.5), picture.ravel(), rtol=1e-6)
    between = density(np.array([[2.0, 0.5], [2.5, 2.0], [-9.0, 0.5]]))
    np.testing.assert_allclose(between, [picture[0, 1:3].mean(), picture[1:3, 2].mean(), picture[0, 0]], rtol=1e-6)
