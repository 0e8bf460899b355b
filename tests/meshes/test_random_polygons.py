"""Random polygons with holes, and random labels, have a mesh of the whole, or one clear error."""

import time
from functools import reduce

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from reference import ring as regular

from cvtimg import mesh_labels, mesh_region
from cvtimg._shared.types import Floats

#: What may be said of polygons, or of a number of vertices.
ERRORS = (
    "the vertices that the border needs",
    "cross themselves",
    "a hole at",
    "must be a polygon with area > 0",
    "be valid",
    "the border leaves no room",
    "not cross or touch",
    "suit a region",
    "N >= 3",
)

pytestmark = pytest.mark.filterwarnings("ignore:the border needs more than")


def hard_polygon(random: np.random.Generator) -> shapely.Geometry | Floats:
    """Make a hard region of 1 to 5,000 points.

    It is a noisy ring, a wedge, a box that is long or has a slit, rings in each other, perhaps with holes, and near or
    repeated points; or a few points anywhere.
    """

    def ring(n: int, noise: float, size: float, at: Floats) -> Floats:
        return at + size * np.maximum(1 + noise * random.normal(size=n), 0.05)[:, None] * regular(n)

    kind = random.integers(6)
    if kind == 0:
        points = ring(int(10 ** random.uniform(0.5, 3.7)), 10 ** random.uniform(-4, -0.7), 1.0, np.zeros(2))
    elif kind == 1:
        angle = 10 ** random.uniform(-2, 0)
        points = np.array([[0, 0], [1, 0], [np.cos(angle), np.sin(angle)]])
    elif kind in (2, 3):
        height, slit = 10 ** random.uniform(-3, 0), 10 ** random.uniform(-5, -1)
        points = np.array([[0, 0], [1, 0], [1, height], [0, height]])
        if kind == 3:
            points = np.concatenate([points[:3], [[0.5 + slit, height], [0.5, height / 5], [0.5, height]], points[3:]])
    elif kind == 4:
        ratio, n = 1 - 10 ** random.uniform(-3, -0.3), random.integers(3, 60)
        rings = [shapely.Polygon(ring(n, 0.02, ratio**depth, np.zeros(2))) for depth in range(random.integers(2, 8))]
        return reduce(shapely.symmetric_difference, map(shapely.make_valid, rings))
    else:
        return random.integers(0, 4, (random.integers(1, 8), 2)) * 10 ** random.uniform(-3, 3)
    if random.random() < 0.4:
        where = random.integers(0, len(points), 4)
        near = points[where] + 10 ** random.uniform(-12, -3) * random.normal(size=(4, 2)) * random.integers(0, 2)
        points = np.insert(points, where, near, axis=0)
    whole = shapely.make_valid(shapely.Polygon(points @ [[0.8, 0.6], [-0.6, 0.8]] * 10 ** random.uniform(-3, 3)))
    for _ in range(random.integers(3) if whole.area > 0 else 0):
        if whole.is_empty:
            break
        center = np.array(whole.representative_point().coords[0]) * random.uniform(0.9, 1)
        hole = ring(int(random.integers(3, 40)), 0.1, 0.1 * whole.length * random.random(), center)
        whole = shapely.difference(whole, shapely.make_valid(shapely.Polygon(hole)))
    return whole


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32))
@example(481065441)  # whose region has no room between its borders
@example(2675704)  # whose borders alone need nearly as many vertices as there are
def test_a_hard_polygon_has_a_mesh_or_one_clear_error_in_ten_seconds(seed: int) -> None:
    random = np.random.default_rng(seed)
    region, n, start = hard_polygon(random), int(10 ** random.uniform(0.5, 3.7)), time.process_time()
    message = None
    try:
        mesh = mesh_region(region, n=n, effort="fast")
        assert len(mesh.points) == n
        assert all(map(shapely.is_ccw, shapely.linearrings(mesh.points[mesh.triangles])))
        area = (region if isinstance(region, shapely.Geometry) else shapely.Polygon(region)).area
        assert mesh.area == pytest.approx(area, rel=0.3)
    except ValueError as error:
        message = str(error)
    assert message is None or any(words in message for words in ERRORS), message
    assert time.process_time() - start < 10


@pytest.mark.slow
def test_noise_is_refused_with_a_size_that_fits() -> None:
    noisy = (1 + 0.01 * np.random.default_rng(0).normal(size=3000))[:, None] * regular(3000)
    with pytest.raises(ValueError, match=r"n=2000 must be at least \d+, .* or give min_size=") as caught:
        mesh_region(noisy, n=2000)
    size = float(str(caught.value).split("min_size=")[1].split(",")[0])
    assert mesh_region(noisy, n=2000, min_size=size, effort="fast").measures().mean_quality > 0.9


@st.composite
def rings(draw: st.DrawFn) -> list[list[tuple[float, float]]]:
    """Draw a ring and up to two holes of any points on a coarse grid, so that they cross, touch and repeat."""
    at = st.integers(0, 8).map(float)
    ring = st.lists(st.tuples(at, at), min_size=3, max_size=7)
    return [draw(ring), *draw(st.lists(ring, max_size=2))]


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(rings())
def test_any_rings_have_a_mesh_or_one_clear_error(given_rings: list[list[tuple[float, float]]]) -> None:
    whole = shapely.Polygon(given_rings[0], given_rings[1:])
    mended = shapely.make_valid(whole, method="structure", keep_collapsed=False)  # what doubles back has no area
    if not (abs(mended.area - whole.area) < 1e-6 and whole.area > 0):
        with pytest.raises(ValueError, match=r"cross themselves|must be a polygon with area > 0"):
            mesh_region(given_rings, edge_length=3.0, effort="fast")
    else:
        mesh = mesh_region(given_rings, edge_length=3.0, effort="fast")
        assert mesh.area == pytest.approx(whole.area, abs=0.15 * whole.length)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.6, 1.5, 4.0]), st.sampled_from([0, 0.7]))
def test_any_labels_have_a_mesh(seed: int, edge_length: float, tolerance: float) -> None:
    random = np.random.default_rng(seed)
    labels = random.integers(0, random.integers(2, 5), random.integers(1, 9, 2))
    labels.flat[0] = 1
    mesh = mesh_labels(labels, edge_length=edge_length, tolerance=tolerance, effort="fast")
    assert mesh.area == pytest.approx((labels > 0).sum(), rel=1e-4)
