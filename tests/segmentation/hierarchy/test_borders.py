import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cvtimg._shared.types import Array, Ints
from cvtimg.labels.components import find_borders
from cvtimg.segmentation._segments import N_LEVELS, N_TEXTONS
from cvtimg.segmentation.hierarchy.channels import Channels
from cvtimg.segmentation.hierarchy.settings import SETTINGS
from cvtimg.segmentation.hierarchy.strengths import _angles, _half_disc_distances


@given(arrays(np.int32, st.tuples(st.integers(1, 6), st.integers(1, 6)), elements=st.integers(0, 3)))
def test_borders_are_all_cracks_between_two_regions(labels: Ints) -> None:
    expected: dict[tuple[int, int], set[tuple[int, int, bool]]] = {}
    height, width = labels.shape
    for y in range(height):
        for x in range(width):
            for is_flat, (v, u) in ((False, (y, x + 1)), (True, (y + 1, x))):
                if v < height and u < width and labels[y, x] != labels[v, u] and labels[y, x] and labels[v, u]:
                    pair = sorted((int(labels[y, x]) - 1, int(labels[v, u]) - 1))
                    expected.setdefault((pair[0], pair[1]), set()).add((y, x, is_flat))
    borders = find_borders(labels)
    found = {}
    for number, (a, b) in enumerate(borders.pairs.tolist()):
        cracks = slice(borders.starts[number], borders.starts[number + 1])
        places = borders.places[cracks].tolist()
        found[a, b] = {(y, x, f) for (y, x), f in zip(places, borders.is_flat[cracks].tolist(), strict=True)}
        assert len(found[a, b]) == len(places) == borders.lengths[number]
    assert found == expected


@pytest.mark.parametrize(("down", "right", "angle"), [(0, 1, 0), (1, 1, 4), (1, 0, 8), (-1, 1, 12)])
def test_angles_follow_a_straight_border(down: int, right: int, angle: int) -> None:
    rows, columns = np.mgrid[:40, :40] - 20
    borders = find_borders((rows * right - columns * down > 0).astype(np.int32) + 1)
    near = (abs(borders.places - 20) < 12).all(axis=1)
    assert set(_angles(borders)[near].tolist()) == {angle}


def test_distances_are_chi_squares_of_smoothed_histograms_of_half_discs() -> None:
    rng = np.random.default_rng(3)
    shape = (26, 24)
    bins = np.stack([rng.integers(0, N_LEVELS, shape), rng.integers(0, N_TEXTONS, shape)], axis=2).astype(np.uint8)
    inside = rng.random(shape) < 0.8
    inside[12, 11:13] = True
    channels = Channels(bins, np.zeros((*shape, 1), np.float32), inside)
    # An upright crack to the right of (12, 11), along a border that is upright (8), slanting (4) or flat (0).
    turns = np.array([8, 4, 0], np.int32)
    found = _half_disc_distances(channels, np.array([[12, 11]] * 3, np.int32), turns)
    down, right = np.mgrid[: shape[0], : shape[1]] - np.array([12, 11.5])[:, None, None]
    for line, angle in zip(found, np.pi / 16 * turns, strict=True):
        across = down * np.cos(angle) - right * np.sin(angle)
        for number, radius in enumerate(SETTINGS.radii):
            disc = (np.hypot(down, right) <= radius) & inside
            halves = [disc & (across > 1e-9), disc & (across < -1e-9)]
            for channel, n_bins in enumerate((N_LEVELS, N_TEXTONS)):
                u, v = (np.bincount(bins[half, channel], minlength=n_bins).astype(float) for half in halves)
                if channel == 0:
                    u, v = unnormed(u), unnormed(v)
                u, v = u / u.sum(), v / v.sum()
                expected = ((u - v) ** 2 / np.maximum(u + v, 1e-30)).sum() / 2
                assert line[channel, number] == pytest.approx(expected, rel=1e-5)


def unnormed(histogram: Array) -> Array:
    """Smooth as the kernel does: what goes beyond the ends is lost."""
    far = np.arange(-6, 7)
    taps = np.exp(-0.5 * (far / (0.1 * N_LEVELS)) ** 2)
    return np.convolve(histogram, taps / taps.sum(), mode="same")
