"""What must not change when a surface comes as scanners and programs write it: soups, doubled and flipped faces."""

import numpy as np
import pytest
from reference import cube
from relations.relation import Relation, equal, quick_and_wide

from cvtimg import surface_points
from cvtimg._shared.types import Floats, Ints
from cvtimg.surfaces import ImplicitSurface, measure_surface
from cvtimg.surfaces.files import as_surface

Surface = tuple[Floats, Ints]


def solid(random: np.random.Generator) -> Surface:
    """Return a cube or a bumpy ball, turned and of any size."""
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0] * 10 ** random.uniform(-2, 2)
    if random.random() < 0.5:
        corners, faces = cube()
    else:
        bumps = 0.1 * random.random(3)
        ball = ImplicitSurface(
            lambda p: np.linalg.norm(p, axis=1) - 1 - (bumps * np.sin(3 * p)).sum(axis=1),
            [-1.5] * 3,
            [1.5] * 3,
            spacing=0.3,
        ).triangulation
        corners, faces = ball.points, ball.triangles
    return corners @ axes, np.asarray(faces, np.int32)


def soup(surface: Surface, shake: float = 0) -> Surface:
    """Give each face vertices of its own, up to `shake` times the diagonal away."""
    corners, faces = surface
    places = corners[faces].reshape(-1, 3)
    noise = np.random.default_rng(0).uniform(-0.5, 0.5, places.shape)
    return places + shake * float(np.linalg.norm(np.ptp(corners, axis=0))) * noise, np.arange(3 * len(faces)).reshape(
        -1, 3
    )


def doubled(surface: Surface) -> Surface:
    """Add a tenth of the faces once more, and as many the other way around."""
    corners, faces = surface
    return corners, np.concatenate([faces, faces[::10], faces[1::10, ::-1], faces[:1, [0, 1, 1]]])


def flipped(surface: Surface) -> Surface:
    """Turn a third of the faces over."""
    corners, faces = surface
    return corners, np.where(np.arange(len(faces))[:, None] % 3 == 0, faces[:, ::-1], faces)


def shape(surface: Surface) -> tuple[int, int, bool, float]:
    """Return what a surface is when it is read: vertices, faces, whether it is closed, and its area and volume."""
    mesh = as_surface(surface).triangulation
    measures = measure_surface(mesh.points, mesh.triangles)
    volume = abs(np.linalg.det(mesh.points[mesh.triangles] - mesh.points.mean(axis=0)).sum())
    figures = float(f"{mesh.areas().sum():.4g}"), float(f"{volume:.4g}")
    return measures.euler_characteristic, len(mesh.triangles), measures.is_closed, *figures


RELATIONS = [
    Relation("surface_points", name, solid, shape, change, equal, since="2026-11-27")
    for name, change in {
        "a soup of triangles": soup,
        "cracks of rounding": lambda surface: soup(surface, 1e-7),
        "doubled faces": doubled,
        "flipped faces": flipped,
    }.items()
]
test_a_result_follows_its_input, test_a_result_follows_any_input = quick_and_wide(RELATIONS)


def test_repairs_are_counted_and_points_are_those_of_the_mended_surface() -> None:
    repairs = as_surface(doubled(flipped(soup(cube())))).repairs
    assert (repairs.n_joined, repairs.n_degenerate, repairs.n_doubled) == (28, 1, 4)
    assert repairs.n_flipped == 4
    found = surface_points(doubled(cube()), 300, effort="fast")
    assert found.measures().least_angle > 30


@pytest.mark.slow
def test_a_surface_may_stay_split() -> None:
    corners, faces = soup(cube())
    with pytest.raises(ValueError, match="at least") as caught:
        surface_points((corners, faces), 20, weld=-1)
    surface_points((corners, faces), int(str(caught.value).split("at least ")[1].split(":")[0]), weld=-1)  # is enough
