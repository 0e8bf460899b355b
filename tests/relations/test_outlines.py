"""What must not change in a mesh when an outline comes as people have it: doubled points, cracks, another start."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import shapely
from reference import ring
from relations.relation import Relation, close, quick_and_wide
from relations.remembering import beside, remembered
from relations.test_objects import not_fewer

from cvtimg import mesh_region
from cvtimg._shared.types import Array, Bools, Floats
from cvtimg.cli.meshing import read_region
from cvtimg.meshes import measure_triangles

Points = Floats


def smooth(random: np.random.Generator) -> Points:
    """Return 100 to 400 points of a star with three round arms, anywhere and of any size."""
    places = ring(int(random.integers(100, 400)))
    star = (1 + 0.3 * np.sin(3 * np.arctan2(*places.T)))[:, None] * places
    return random.normal(size=2) + 10 ** random.uniform(-3, 3) * star


def size(points: Points) -> float:
    """Return the diagonal of the bounds."""
    return float(np.hypot(*np.ptp(points, axis=0)))


def doubled(points: Points) -> Points:
    """Add a point beside each tenth one, a millionth of the size away."""
    at = np.arange(0, len(points), 10)
    steps = 1e-6 * size(points) * np.stack([np.cos(at), np.sin(at)], axis=1)
    return np.insert(points, at, points[at] + steps, axis=0)


def cracked(points: Points) -> Points:
    """Cut a crack towards the middle that is a millionth of the size wide, and add a spike as thin."""
    middle, thin = points.mean(axis=0), 1e-6 * size(points) * np.array([0.0, 1.0])
    tips = points[:1] + 0.2 * (points[:1] - middle), points[:1] - 0.2 * (points[:1] - middle)
    return np.concatenate([points, points[:1] - thin, tips[0], points[:1], tips[1], points[:1] + thin])


@remembered
def figures(points: Points) -> tuple[float, float, bool]:
    """Return the area, the vertices, and whether all angles are regular."""
    mesh = mesh_region(points, effort="fast")
    return mesh.area, len(mesh.points), mesh.measures().least_angle > 25


def alike(before: Any, after: Any) -> None:
    """Assert figures of the same region: areas within 1e-6, nearly as many vertices, angles as regular."""
    close(1e-6)(before[0], after[0])
    close(0.2)(before[1], after[1])
    assert before[2] == after[2]


def parts(random: np.random.Generator) -> list[Points]:
    """Return two halves of a square, the border between which is a line of points."""
    line = np.stack([1 + 0.1 * np.sin(9 * np.linspace(0, 1, 12)), np.linspace(0, 1, 12)], axis=1)
    line[[0, -1], 0] = 1
    halves, scale = ([[0, 0], *line, [0, 1]], [[2, 0], [2, 1], *line[::-1]]), 10 ** random.uniform(-3, 3)
    return [scale * np.array(half, float) for half in halves]


def shaken(halves: list[Points]) -> list[Points]:
    """Move the points of the second half by a millionth of its size: there are gaps and overlaps."""
    noise = np.random.default_rng(0).uniform(-1, 1, halves[1].shape)
    return [halves[0], halves[1] + 1e-6 * size(halves[1]) * noise]


def seams(halves: list[Points]) -> tuple[float, float, int]:
    """Return the areas of both halves, and the holes between them."""
    mesh = mesh_region(dict(zip("ab", halves, strict=True)), effort="fast")
    triangles = shapely.polygons(mesh.points[mesh.triangles])
    first, second = (float(shapely.area(triangles[mesh.tags == tag]).sum()) for tag in (1, 2))
    return first, second, len(shapely.coverage_union_all(triangles).interiors)


#: How a ring (N, 2) is written as it stands, open or closed, by the suffix of the file.
FILES: dict[str, Callable[[Points], bytes]] = {
    ".geojson": lambda ring: json.dumps({"type": "Polygon", "coordinates": [ring.tolist()]}).encode(),
    ".wkt": lambda ring: f"POLYGON (({', '.join(f'{x!r} {y!r}' for x, y in ring.tolist())}))".encode(),
    ".wkb": lambda ring: struct.pack("<BIII", 1, 3, 1, len(ring)) + ring.astype("<f8").tobytes(),
}


def left_open(suffix: str) -> Callable[[Points], Any]:
    """Return what reads a file of outlines whose last point is the first but for rounding, as that of 2 pi is."""

    def region(points: Points) -> Any:
        with TemporaryDirectory() as folder:
            path = Path(folder, f"a{suffix}")
            path.write_bytes(FILES[suffix](np.concatenate([points, np.nextafter(points[:1], np.inf)])))
            return read_region(path, "")

    return region


def least_angle(points: Points) -> float:
    return mesh_region(points, effort="fast").measures().least_angle


def least_angle_of_triangle(points: Points) -> float:
    """Return the least angle of the mesh of Triangle, J. R. Shewchuk's, for no angle below 30 degrees."""
    triangle = pytest.importorskip("triangle")
    at = np.arange(len(points))
    mesh = triangle.triangulate({"vertices": points, "segments": np.stack([at, np.roll(at, -1)], axis=1)}, "pq30")
    return float(measure_triangles(mesh["vertices"], mesh["triangles"]).least_angles.min())


RELATIONS = [
    Relation("mesh_region", "points doubled within rounding", smooth, figures, doubled, alike, since="2026-11-27"),
    Relation("mesh_region", "a crack and a spike", smooth, figures, cracked, alike, since="2026-11-27"),
    Relation(
        "mesh_region", "another start", smooth, figures, lambda p: np.roll(p, 7, axis=0), alike, since="2026-11-27"
    ),
    Relation("mesh_region", "the other way around", smooth, figures, lambda p: p[::-1], alike, since="2026-11-27"),
    Relation("mesh_region", "gaps between parts", parts, seams, shaken, close(2e-5), since="2026-11-27"),
    *(
        Relation(
            "mesh_region", f"a ring that is open, {suffix}", smooth, figures, left_open(suffix), alike, "2026-11-28"
        )
        for suffix in FILES
    ),
    beside(
        "mesh_region", "Triangle's least angle", smooth, least_angle, least_angle_of_triangle, not_fewer, "2026-11-27"
    ),
]
test_a_result_follows_its_input, test_a_result_follows_any_input = quick_and_wide(RELATIONS)


@pytest.mark.slow
def test_simpler_outlines_keep_their_areas_and_straight_sides() -> None:
    noisy = np.random.default_rng(0).normal(0, 0.01, 300)
    side = np.stack([1 + noisy, np.linspace(0, 1, 302)[1:-1]], axis=1)
    outline = np.concatenate([[[0, 0], [1, 0]], side, [[1, 1], [0, 1]]])
    mesh, all_of_it = (mesh_region(outline, simplify=simplify, effort="fast") for simplify in (0.02, 0.0))
    np.testing.assert_allclose(mesh.area, shapely.Polygon(outline).area, rtol=1e-6)
    assert len(mesh.points) < 0.8 * len(all_of_it.points)
    assert (mesh.points[:, 0] == 0).sum() > 10


_meshed = remembered(lambda mask: mesh_region(mask, n=30, effort="fast").points)


@pytest.mark.parametrize(
    "form", [lambda m: m * np.uint8(255), lambda m: m * 1, lambda m: m * 0.5, lambda m: np.dstack([m * 9] * 3)]
)
def test_a_mask_is_one_in_any_numbers(form: Callable[[Bools], Array]) -> None:
    disk = np.hypot(*(np.mgrid[:30, :40] - 14.6)) < 12
    assert (mesh_region(form(disk), n=30, effort="fast").points == _meshed(disk)).all()
