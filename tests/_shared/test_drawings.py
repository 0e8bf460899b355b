"""Results of physical space show themselves in notebooks."""

from __future__ import annotations

import re
from io import BytesIO
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

import cvtimg
from cvtimg._shared.svg import MOST_SHAPES, draw_dots, draw_lines, draw_solid, seen_from
from cvtimg.placement import PictureRegion
from cvtimg.surfaces import torus

CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
TETRAHEDRON = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
NUMBER = r"-?[\d.]+"


def parsed(page: str) -> tuple[str, ElementTree.Element]:
    """Return the caption and the drawing; browsers are more forgiving than this parser."""
    caption, drawing = ElementTree.fromstring(f"<div>{page}</div>")
    return caption.text or "", drawing


def places(drawing: ElementTree.Element) -> np.ndarray[Any, Any]:
    found = [
        [float(number) for number in pair]
        for path in drawing.iter("path")
        for pair in re.findall(rf"[ML]({NUMBER}) ({NUMBER})", path.attrib["d"])
    ]
    return np.array(found)


def test_lines_keep_their_shape_and_stay_within_the_drawing() -> None:
    lines = np.array([[[0, 0], [10, 0]], [[10, 0], [10, 5]], [[10, 5], [0, 0.0]]])
    caption, drawing = parsed(draw_lines("a < b", lines))
    assert caption == "a < b"
    drawn = places(drawing).reshape(3, 2, 2)
    lengths = np.linalg.norm(drawn[:, 1] - drawn[:, 0], axis=1)
    np.testing.assert_allclose(lengths / lengths[0], [1, 0.5, np.hypot(1, 0.5)], atol=0.002)
    assert (drawn >= 0).all()
    assert (drawn <= [float(drawing.attrib["width"]), float(drawing.attrib["height"])]).all()
    assert drawn[1, 1, 1] < drawn[1, 0, 1]  # y points up


def test_y_points_down_in_images() -> None:
    drawn = places(parsed(draw_dots("", np.array([[0, 0], [0, 9.0]]), y_down=True))[1])
    assert drawn[1, 1] > drawn[0, 1]


@pytest.mark.parametrize(("n_dims", "n_panels"), [(1, 1), (2, 1), (3, 3), (4, 6), (7, 6)])
def test_points_are_drawn_in_each_pair_of_the_first_axes(n_dims: int, n_panels: int) -> None:
    points = np.random.default_rng(0).random((20, n_dims))
    _, drawing = parsed(draw_dots("", points))
    assert len(drawing.findall("rect")) == n_panels
    assert len(places(drawing)) == 20 * n_panels
    assert (places(drawing) <= 400).all()


def test_very_many_points_are_thinned() -> None:
    points = np.random.default_rng(0).random((5 * MOST_SHAPES, 2))
    assert 0.5 * MOST_SHAPES < len(places(parsed(draw_dots("", points))[1])) <= MOST_SHAPES


def test_only_triangles_that_face_the_viewer_are_drawn() -> None:
    _, drawing = parsed(draw_solid("", CORNERS, TETRAHEDRON, (1, 1, 0.9)))
    normals = np.cross(CORNERS[TETRAHEDRON[:, 1]] - CORNERS[TETRAHEDRON[:, 0]],
                       CORNERS[TETRAHEDRON[:, 2]] - CORNERS[TETRAHEDRON[:, 0]])  # fmt: skip
    assert len(list(drawing.iter("path"))) == (normals @ [1, 1, 0.9] > 0).sum()
    np.testing.assert_allclose(np.linalg.det(seen_from((1, 1, 0.9))), 1)


def ring() -> np.ndarray[Any, Any]:
    x, y = np.meshgrid(np.arange(30.0), np.arange(24.0))
    return np.hypot(x - 15, y - 12) < 10


@pytest.mark.parametrize(
    "make",
    [
        lambda: cvtimg.design(8, 3),
        lambda: cvtimg.mesh_region(ring(), n=60),
        lambda: cvtimg.sphere_grid(42, effort="fast"),
        lambda: cvtimg.place_generators(PictureRegion(ring()), 20),
        lambda: cvtimg.surface_points(torus(1.0, 0.4), 120, effort="fast"),
    ],
    ids=["design", "mesh", "grid", "placement", "surface"],
)
def test_results_show_themselves(make: Any) -> None:
    result = make()
    caption, drawing = parsed(result._repr_html_())
    assert caption == repr(result)
    assert len(places(drawing)) >= 8


def test_a_hierarchy_shows_strong_borders_darkest() -> None:
    image = np.zeros((40, 60), np.uint8)
    image[:, 30:], image[:, 45:] = 200, 215
    with Image.open(BytesIO(cvtimg.segment_hierarchy(image, n_leaves=24)._repr_png_())) as shown:
        row = np.asarray(shown)[20]
    assert row.shape == (60,)
    assert row.argmin() == 29
    assert row[:25].min() == 255 or row[:25].min() > row[29]
