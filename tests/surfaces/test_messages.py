"""What is no surface, and points that it cannot have, are refused by name."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reference import cube

from cvtimg import surface_points
from cvtimg.surfaces import ImplicitSurface, TriangulatedSurface, VertexDensity, torus

CORNERS, FACES = cube()


def placed(surface: Any, n: int = 50, **options: Any) -> Callable[[], Any]:
    return lambda: surface_points(surface, n, **options)


def implicit(function: Callable[[Any], Any], **options: Any) -> Callable[[], Any]:
    return lambda: ImplicitSurface(function, [-2] * 3, [2] * 3, **options)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (placed((CORNERS * np.nan, FACES)), "vertices must be finite"),
        (placed((CORNERS, FACES + 1)), r"faces in 1\.\.8 must be in 0\.\.7"),
        (lambda: TriangulatedSurface(CORNERS, np.concatenate([FACES, [[0, 1, 1]]])), r"faces\[12\] must have an area"),
        (lambda: TriangulatedSurface(CORNERS, np.concatenate([FACES[:1, ::-1], FACES[1:]])), "must go around"),
        (placed((CORNERS, FACES), weld=-2), "weld=-2 must be"),
        (placed("a.xyz"), r"suffix='\.xyz' must be one of"),
        (placed(3), "surface of type int must be a Surface, a path"),
        (placed(cube(), 3), "n=3 must be an integer >= 4"),
        (placed(cube(), 7), r"n=7 must be at least 8: .* a larger feature_angle keeps fewer"),
        (placed(cube(), 1 << 30), r"n=\d+ must be at most"),
        (placed(cube(), feature_angle=200), r"feature_angle=200 must be in 0\.\.180 degrees"),
        (placed(cube(), density=lambda p: 0 * p[:, 0]), "density must be > 0 somewhere"),
        (placed(cube(), density=[1, 2]), "density of type list must be a number or a function"),
        (placed(cube(), effort="long"), "effort='long' must be one of"),
        (implicit(lambda p: p[:, 0] ** 2 + 1), "it has one sign"),
        (implicit(lambda p: p[:, 0] * np.nan), r"function at .*=nan must be a number"),
        (implicit(lambda p: p[:, 0], gradient=lambda p: p[:, 0]), r"gradient of shape \(.*\) must be"),
        (lambda: torus(1, 2), r"minor=2\.0 must be less than major=1"),
        (lambda: VertexDensity(CORNERS, FACES, np.ones(3)), r"values of shape \(3,\) must be \(8,\)"),
    ],
)
def test_wrong_arguments_are_named(make: Callable[[], Any], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        make()


def test_files_without_a_surface_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(b"solid nothing")
    with pytest.raises(OSError, match=r"a\.stl"):
        surface_points(tmp_path / "a.stl", 50)
