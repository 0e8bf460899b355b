"""Results that contradict themselves are no results."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from reference import cube

import cvtimg
from cvtimg._shared.records import UnprovenError
from cvtimg.engine.tessellation import proven
from cvtimg.supports import support_radii
from cvtimg.tables import Table

ROWS = np.arange(12.0).reshape(6, 2) ** 2
LEVELS = np.repeat(np.uint8([[0, 90, 200]]), 4, axis=0).repeat(4, axis=1)
LABELS = 1 + (LEVELS > 99)
SQUARE = cvtimg.place_generators([[0, 0], [1, 0], [1, 1], [0, 1]], 12)


@pytest.mark.parametrize(
    ("result", "wrong", "claim"),
    [
        (lambda: cvtimg.tessellate(ROWS, 2), {"energies": (1.0, 2.0)}, "energies never rise"),
        (lambda: cvtimg.tessellate(ROWS, 2), {"labels": np.full(6, 2, np.int32)}, "labels are those of generators"),
        (lambda: cvtimg.segment(LEVELS, 3), {"masses": np.ones(3)}, "masses are numbers of pixels"),
        (lambda: cvtimg.segment_hierarchy(LEVELS), {"altitudes": np.float32([1, 0])}, "altitudes never fall"),
        (lambda: cvtimg.quantize(LEVELS, 2), {"indices": LEVELS}, "indices are those of colors"),
        (lambda: cvtimg.find_palette(LEVELS, 2), {"colors": np.ones((2, 1), np.uint8)}, "colors are distinct"),
        (lambda: cvtimg.stipple(LEVELS, 9), {"points": np.full((9, 2), -1.0)}, "dots are in the frame"),
        (lambda: cvtimg.restore([LEVELS] * 2, 2), {"labels": LABELS + 9}, "labels are those of colors"),
        (lambda: cvtimg.find_contours(LABELS), {"lines": ()}, "lines have two sides"),
        (lambda: SQUARE, {"masses": -SQUARE.masses}, "masses are not negative"),
        (lambda: support_radii(SQUARE.points, SQUARE.region), {"radii": np.zeros(12)}, "radii are above 0"),
        (lambda: cvtimg.mesh_region(LABELS > 1, n=9), {"points": np.zeros((9, 2))}, "triangles are counter-clockwise"),
        (lambda: cvtimg.sphere_grid(12), {"areas": np.ones(12)}, "areas add up to the sphere"),
        (lambda: cvtimg.sphere_grid(12).cells(), {"corners": np.zeros(60, np.int32)}, "three cells meet at each"),
        (lambda: cvtimg.surface_points(cube(), 60), {"masses": -np.ones(60)}, "masses are not negative"),
        (lambda: Table(("a", "b"), ROWS, None, np.ones(6, bool)), {"names": ("a",)}, "columns have names"),
    ],
)
def test_a_result_that_contradicts_itself_is_none(result: Callable[[], Any], wrong: dict[str, Any], claim: str) -> None:
    right = result()
    with pytest.raises(UnprovenError, match=f"{type(right).__name__}: {claim}"):
        replace(right, **wrong)


def test_a_tessellation_is_that_of_its_rows() -> None:
    right = cvtimg.tessellate(ROWS, 2)
    for wrong in ({"energy": 2 * right.energy}, {"masses": right.masses[::-1]}, {"labels": 1 - right.labels}):
        with pytest.raises(UnprovenError, match="Tessellation"):
            proven(replace(right, **wrong), ROWS, np.ones(6), True)
