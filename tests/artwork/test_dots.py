from __future__ import annotations

import numpy as np
import pytest

from cvtimg.artwork.stipples import draw_dots


def test_disks_cover_their_union() -> None:
    rng = np.random.default_rng(0)
    points, radii = rng.random((30, 2)) * [24, 16], rng.random(30) * 3
    lines, fine = 8, 400  # of a pixel, down and across
    x, y = (np.arange(24 * fine) + 0.5) / fine, (np.arange(16 * lines) + 0.5) / lines
    inside = np.zeros((len(y), len(x)), bool)
    for (center, middle), radius in zip(points, radii, strict=True):
        inside |= (x - center) ** 2 + (y[:, np.newaxis] - middle) ** 2 < radius**2
    expected = inside.reshape(16, lines, 24, fine).mean(axis=(1, 3))
    np.testing.assert_allclose(draw_dots(points, radii, (16, 24)), expected, atol=0.005)


def test_the_scale_enlarges_dots_and_paper() -> None:
    drawn = draw_dots(np.array([[5.0, 4.0]]), np.array([2.0]), (8, 10), 5.0)
    assert drawn.shape == (40, 50)
    assert drawn.sum() == pytest.approx(np.pi * 100, rel=2e-3)


def test_dots_outside_and_no_dots_draw_nothing() -> None:
    assert not draw_dots(np.empty((0, 2)), np.empty(0), (3, 4)).any()
    assert not draw_dots(np.array([[-9.0, 50.0]]), np.array([2.0]), (3, 4)).any()
