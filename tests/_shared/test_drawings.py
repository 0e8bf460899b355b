"""Results of physical space show themselves in notebooks."""

from io import BytesIO
from typing import Any

import numpy as np
import pytest
from PIL import Image

import cvtimg
from cvtimg._shared import notebooks
from cvtimg._shared.notebooks import drawn
from cvtimg.placement import PictureRegion
from cvtimg.surfaces import torus


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
    with Image.open(BytesIO(make()._repr_png_())) as shown:
        assert np.asarray(shown.convert("L"))[60:].std() > 5  # below the caption


@pytest.mark.parametrize("n_dims", [1, 2, 7])
def test_points_of_any_dimension_are_drawn_and_without_matplotlib_nothing_is(
    n_dims: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = np.random.default_rng(0).random((20, n_dims))
    assert (drawn("20 points", points) or b"").startswith(b"\x89PNG")
    monkeypatch.setattr(notebooks, "find_spec", lambda name: None)
    assert drawn("20 points", points) is None


def test_a_hierarchy_shows_strong_borders_darkest() -> None:
    image = np.zeros((40, 60), np.uint8)
    image[:, 30:], image[:, 45:] = 200, 215
    with Image.open(BytesIO(cvtimg.segment_hierarchy(image, n_leaves=24)._repr_png_())) as shown:
        row = np.asarray(shown)[20]
    assert row.shape == (60,)
    assert row.argmin() == 29
    assert row[:25].min() == 255 or row[:25].min() > row[29]
