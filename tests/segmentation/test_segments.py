from pathlib import Path
from typing import Any

import numpy as np
import pytest
from images import discs
from scipy import ndimage
from skimage import data
from skimage.measure import label

from cvtimg import energy_curve, read_image, segment, tessellate
from cvtimg._shared.types import Array, Bools, Floats32, Indices, Ints
from cvtimg.colors import color_samples
from cvtimg.labels import read_labels
from cvtimg.segmentation.edge_weight import Planes, weight_of_detail
from cvtimg.segmentation.noise import averaged, noise_gain

#: One of each kind of way through `segment`.
WAYS: list[dict[str, Any]] = [
    {},
    {"averaging": 2},
    {"edge_weight": 30},
    {"edge_weight": "auto", "averaging": 1.5, "volume_power": 1},
    {"components": True, "min_size": 20},
    {"space": "lab", "edge_weight": 10, "min_size": 30},
]


def noisy_shapes(sigma: float, seed: int) -> tuple[Array, Bools]:
    """Three shapes of contrast 1 under noise, and where they are."""
    rows, columns = np.mgrid[:200, :200]
    truth = (rows - 60) ** 2 + (columns - 60) ** 2 < 35**2
    truth |= (abs(rows - 60) < 28) & (abs(columns - 145) < 30)
    truth |= (rows > 120) & (rows < 180) & (abs(columns - 100) < 0.8 * (rows - 120))
    return truth + np.random.default_rng(seed).normal(0, sigma, truth.shape), truth


def test_segments_are_those_of_the_tessellation_from_dark_to_bright(photograph: Array) -> None:
    samples = color_samples(photograph)
    end = tessellate(samples, 5)
    result = segment(photograph, 5, edge_weight=0)
    assert (np.diff(result.generators.sum(axis=1)) > 0).all()
    order = np.argsort(end.generators.sum(axis=1))
    np.testing.assert_allclose(result.generators, end.generators[order], rtol=0.01)
    np.testing.assert_array_equal(order[result.labels - 1], end.labels[samples.inverse])
    assert result.energy == pytest.approx(end.energy, rel=1e-3)


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_results_are_measured_on_the_picture(photograph: Array, way: dict[str, Any]) -> None:
    result = segment(photograph[::2, ::2], 4, **way)
    picture = photograph[::2, ::2].astype(float)
    np.testing.assert_array_equal(np.unique(result.labels), np.arange(1, result.n_segments + 1))
    if "space" in way:
        return
    means = np.stack([picture[result.labels == label].mean(axis=0) for label in range(1, result.n_segments + 1)])
    if way:
        np.testing.assert_allclose(result.generators, means, rtol=1e-5, atol=1e-3)
        assert result.energy == pytest.approx(((picture - means[result.labels - 1]) ** 2).sum(), rel=1e-5)


@pytest.mark.parametrize("dtype", [np.int8, np.int16, np.int32, np.int64])
def test_signed_integers_have_the_white_of_their_type(dtype: type) -> None:
    white = np.iinfo(dtype).max
    picture = np.clip(np.rint(noisy_shapes(0.3, 1)[0][:60, :60] * 60 + 30), 0, 127).astype(np.int64)
    image = (picture * (white // 127)).astype(dtype)
    result, expected = segment(image, 2, edge_weight="auto"), segment(picture / 127, 2, edge_weight="auto")
    np.testing.assert_array_equal(result.labels, expected.labels)
    np.testing.assert_allclose(result.edge_weight, expected.edge_weight, rtol=0.02)
    np.testing.assert_allclose(result.generators / white, expected.generators, rtol=0.01)
    np.testing.assert_array_equal(segment(image - dtype(100), 2, edge_weight="auto").labels, expected.labels)


@pytest.mark.parametrize(("sigma", "least"), [(0.25, 0.999), (0.5, 0.996), (1, 0.985)])
def test_auto_finds_shapes_under_noise(sigma: float, least: float) -> None:
    image, truth = noisy_shapes(sigma, 0)
    assert ((segment(image, 2, edge_weight="auto").labels == 2) == truth).mean() > least
    assert ((segment(image, 2, edge_weight=0).labels == 2) == truth).mean() < least


def test_without_a_smallest_detail_a_clean_picture_has_next_to_no_edge_weight(photograph: Array) -> None:
    assert segment(np.kron(np.eye(9), np.ones((9, 9))), 2, smallest_detail=0).edge_weight == 0
    assert segment(photograph, 2, smallest_detail=0).edge_weight < 10


def drawn(radius: float, contrast: float, noise: float = 0.0) -> tuple[Floats32, Bools]:
    """Draw discs here and there on a dark ground, and a bright border to the right."""
    rng = np.random.default_rng(0)
    centers = np.mgrid[20:120:40, 20:150:40].reshape(2, -1).T
    inside = discs([(*(center + rng.uniform(-0.5, 0.5, 2)), radius) for center in centers], (120, 180)) > 0
    image = 20 + contrast * (inside | (np.arange(180) > 160)) + rng.normal(0, noise * contrast, inside.shape)
    return (image / 255).astype(np.float32), inside


@pytest.mark.parametrize("contrast", [5, 30, 200])
@pytest.mark.parametrize("noise", [0, 0.1])
@pytest.mark.parametrize("detail", [1, 2, 3, 4])
def test_discs_smaller_than_the_smallest_detail_vanish_and_larger_ones_stay(
    detail: float, contrast: float, noise: float
) -> None:
    for radius, stays in ((max(detail - 1, 0.5), False), (detail + 1, True)):
        image, inside = drawn(radius, contrast, noise)
        found = segment(image, 2, smallest_detail=detail).labels == 2
        kept = found[inside].mean()
        assert kept > 0.5 if stays else kept < 0.1


@pytest.mark.parametrize("depth", [1, 2])
@pytest.mark.parametrize(("contrast", "noise"), [(5, 0), (100, 0.1)])
def test_in_volumes_balls_smaller_than_the_smallest_detail_vanish_and_larger_ones_stay(
    contrast: float, noise: float, depth: int
) -> None:
    plane, down, right = np.mgrid[: 36 // depth, :40, :70]
    for radius, stays in ((1.3, False), (3.1, True)):
        inside = np.zeros(plane.shape, bool)
        for z, y, x in ((10.2, 12.1, 12), (10, 27.3, 40.1), (26.4, 12, 40), (25.7, 27, 12.2)):
            inside |= (depth * plane - z) ** 2 + (down - y) ** 2 + (right - x) ** 2 <= radius**2
        rest = noise * contrast * np.random.default_rng(0).normal(size=plane.shape)
        volume = (20 + contrast * (inside | (right > 55)) + rest).astype(np.float32) / 255
        found = segment(volume, 2, smallest_detail=2, spacing=(depth, 1, 1)).labels == 2
        kept = found[inside].mean()
        assert kept > 0.8 if stays else kept < 0.1


@pytest.mark.parametrize("depth", [1, 1.5, 4])
def test_in_volumes_near_pixels_are_those_in_a_ball(depth: float) -> None:
    volume = np.random.default_rng(0).integers(0, 200, (6, 9, 11)).astype(np.uint8)
    known = volume != 7
    result = segment(volume, 3, edge_weight=20, spacing=(depth, 1, 1), mask=known)
    np.testing.assert_array_equal(result.labels > 0, known)
    steps = np.stack(np.mgrid[-3:4, -3:4, -3:4], axis=-1).reshape(-1, 3)
    near = [step for step in steps if 0 < np.square(step * (depth, 1, 1)).sum() <= 9]
    padded, pairs = np.pad(result.labels, 3), 0
    for z, y, x in near:
        there = padded[3 + z : 9 + z, 3 + y : 12 + y, 3 + x : 14 + x]
        pairs += np.count_nonzero((there != result.labels) & (there > 0) & known)
    assert result.energies[-1] == pytest.approx(result.energy + 20 * pairs, rel=1e-6)


def pieces_of(labels: Array) -> Indices:
    """Sizes of the connected pieces of all labels."""
    return np.bincount(label(labels, background=0, connectivity=1).ravel())[1:]


def specks(labels: Ints) -> float:
    """Count the pieces of less than 20 pixels in 10,000 pixels."""
    return 1e4 * float((pieces_of(labels) < 20).sum()) / labels.size


@pytest.mark.parametrize(
    "kind",
    [
        lambda photograph: photograph,
        lambda photograph: photograph[..., 1],
        lambda photograph: photograph.astype(np.uint16) * 257,
        lambda photograph: np.concatenate([photograph, photograph[..., :2]], axis=2).astype(np.float32),
    ],
    ids=["rgb", "gray", "16 bits", "5 bands"],
)
@pytest.mark.parametrize("way", [{}, {"volume_power": 1}, {"space": "rgb", "mask": np.tri(256) > 0}], ids=str)
def test_a_photograph_has_few_specks(photograph: Array, kind: Any, way: dict[str, Any]) -> None:
    image = np.ascontiguousarray(kind(photograph))
    few, many = segment(image, 4, **way), segment(image, 4, edge_weight=0, **way)
    assert specks(few.labels) < 4 < 20 < specks(many.labels)


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_what_is_outside_of_the_mask_or_not_finite_has_label_0_and_no_influence(
    photograph: Array, way: dict[str, Any]
) -> None:
    picture = photograph[:90, :90] / 255
    mask = np.add.outer(np.arange(90), np.arange(90)) < 130
    expected = segment(picture, 3, mask=mask, **way).labels
    np.testing.assert_array_equal(expected == 0, ~mask)
    other = picture.copy()
    other[~mask] = np.random.default_rng(0).random((int((~mask).sum()), 3))
    np.testing.assert_array_equal(segment(other, 3, mask=mask, **way).labels, expected)
    holes = picture.copy()
    holes[~mask, 1] = np.nan
    np.testing.assert_array_equal(segment(holes, 3, **way).labels, expected)
    masked = np.ma.array(other, mask=np.zeros(other.shape, bool))
    masked[~mask, 2] = np.ma.masked
    np.testing.assert_array_equal(segment(masked, 3, **way).labels, expected)


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_pictures_of_one_color_have_one_segment(way: dict[str, Any]) -> None:
    for image in (np.uint8([[7]]), np.full((9, 9, 3), 3, np.uint16), np.full((3, 8), 0.5)):
        result = segment(image, 4, **way)
        assert (result.labels == 1).all()
        assert result.energy == pytest.approx(0, abs=1e-9)


def test_there_are_no_more_segments_than_colors() -> None:
    result = segment(np.uint8([[5, 9, 5], [200, 9, 5]]), 6, edge_weight=0)
    np.testing.assert_array_equal(result.labels, [[1, 2, 1], [3, 2, 1]])
    assert result.n_segments == 3


@pytest.mark.parametrize("components", [False, True])
@pytest.mark.parametrize("min_size", [2, 40, 3000, 10**6])
def test_no_piece_below_the_least_size_remains(photograph: Array, components: bool, min_size: int) -> None:
    result = segment(photograph, 6, components=components, min_size=min_size)
    assert min(pieces_of(result.labels)) >= min(min_size, result.labels.size)


def test_components_are_the_connected_pieces_of_segments(photograph: Array) -> None:
    whole, pieces = segment(photograph, 3), segment(photograph, 3, components=True)
    assert sorted(pieces_of(whole.labels)) == sorted(pieces.masses)
    assert len(pieces_of(pieces.labels)) == pieces.n_segments
    assert len(np.unique(np.stack([whole.labels, pieces.labels]).reshape(2, -1), axis=1).T) == pieces.n_segments


def test_a_result_tells_its_regions_and_the_length_of_their_edges(photograph: Array) -> None:
    result = segment(photograph, 3)
    assert result.n_regions == segment(photograph, 3, components=True).n_segments
    square = segment(np.pad(np.full((6, 6), 200, np.uint8), 4), 2)
    assert (square.n_regions, square.edge_length) == (2, 24)


def test_averaging_before_leaves_out_what_is_outside() -> None:
    values = np.random.default_rng(0).normal(size=(30, 40, 2)).astype(np.float32)
    inside = np.random.default_rng(1).random((30, 40)) < 0.7
    result = averaged(values, 1.5, inside)
    kernel = ndimage.gaussian_filter(np.pad(np.ones((1, 1)), 10), 1.5)
    for channel in range(2):
        sums = ndimage.convolve(np.where(inside, values[..., channel], 0).astype(float), kernel, mode="constant")
        mass = ndimage.convolve(inside.astype(float), kernel, mode="constant")
        np.testing.assert_allclose(result[..., channel], np.where(inside, sums / mass, 0), atol=1e-5)


def test_noise_gain_is_what_averaging_leaves_of_the_variance() -> None:
    noise = np.random.default_rng(0).normal(size=(700, 700, 1)).astype(np.float32)
    assert averaged(noise, 1.7)[30:-30, 30:-30].var() == pytest.approx(noise_gain(1.7), rel=0.05)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_segments": 0}, "n_segments=0 must be in"),
        ({"edge_weight": "much"}, "edge_weight='much' must be"),
        ({"edge_weight": -1}, "edge_weight=-1 must be"),
        ({"averaging": 1001}, "averaging=1001 must be <= 1000"),
        ({"mask": np.ones((2, 2))}, r"mask of shape \(2, 2\) must be \(6, 5\)"),
        ({"mask": np.zeros((6, 5))}, "at least one pixel"),
        ({"min_size": -1}, "min_size=-1 must be"),
        ({"space": "xyz"}, "space='xyz' must be one of"),
        ({"spacing": (2, 1, 1)}, r"\(Z, H, W\)"),
        ({"spacing": (2, 1, 1), "averaging": 2}, "spacing takes no averaging"),
    ],
)
def test_wrong_arguments_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        segment(np.zeros((6, 5), np.uint8), **{"n_segments": 2, **options})


@pytest.mark.parametrize("bands", [1, 2, 3, 5])
def test_a_result_shows_and_saves_itself(photograph: Array, bands: int, tmp_path: Path) -> None:
    image = np.concatenate([photograph, photograph], axis=2)[:60, :80, :bands]
    result = segment(image, 7, edge_weight=0)
    assert len(repr(result)) < 200
    assert "7 segments of 80 x 60 pixels" in repr(result)
    result.save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_labels(tmp_path / "a.png"), result.labels)
    (tmp_path / "b.png").write_bytes(result._repr_png_())
    drawn = read_image(tmp_path / "b.png")
    np.testing.assert_array_equal(drawn, result.draw())
    assert drawn.shape == ((60, 80, 3) if bands >= 3 else (60, 80))
    assert len(np.unique(drawn.reshape(60 * 80, -1), axis=0)) == 7
    assert (drawn.min(), drawn.max()) == (0, 255)


@pytest.mark.parametrize("bands", [1, 3])
def test_in_even_light_segments_are_those_of_the_things_not_of_the_lamp(bands: int) -> None:
    down, right = np.mgrid[:150, :200]
    inside = discs([(y, x, 6) for y in range(25, 150, 25) for x in range(25, 200, 25)], (150, 200)) > 0
    paper = np.where(inside[..., None], np.full(bands, 60.0), np.linspace(200, 220, bands))
    light = 0.3 + 0.7 * (right / 200) ** 2 + 0.2 * np.sin(down / 60)
    noise = np.random.default_rng(0).normal(0, 2, paper.shape)
    image = (paper * light[..., None] + noise).clip(0, 255).astype(np.uint8)
    wrong = {shading: (segment(image, 2, shading=shading).labels == 1) != inside for shading in (True, False)}
    assert wrong[True].mean() < 0.005 < 0.2 < wrong[False].mean()
    with_mask = segment(image, 2, shading=True, mask=right > 50).labels
    assert ((with_mask == 1) != inside)[right > 50].mean() < 0.005
    assert not with_mask[right <= 50].any()


def test_details_within_a_pixel_need_less_weight_the_smaller_they_are() -> None:
    weights = [weight_of_detail(detail, 3) for detail in (0, 0.1, 0.25, 0.5, 0.56, 1, 2, 30)]
    assert weights[0] == 0
    assert (np.diff(weights) > 0).all()
    assert weights[4] == pytest.approx(1 / 56, rel=0.05)  # a pixel has 28 neighbors
    assert weights[-1] == pytest.approx(30 / 75, rel=0.02)  # the mean over all directions of an edge
    assert weight_of_detail(30, 3, Planes(9, 1.0)) == pytest.approx(30 / 428, rel=0.02)


@pytest.mark.slow
def test_of_a_page_under_a_lamp_ink_alone_is_ink() -> None:
    page = pytest.importorskip("skimage.data").page()
    sauvola = page < pytest.importorskip("skimage.filters").threshold_sauvola(page, 15)
    ink = segment(page, 2, shading=True, smallest_detail=0.25).labels == 1
    within = ndimage.binary_erosion(sauvola)  # but for rims, where the cut is a matter of definition
    assert np.count_nonzero(ink & ~sauvola) < 0.03 * np.count_nonzero(sauvola)
    assert np.count_nonzero(within & ~ink) < 0.01 * np.count_nonzero(within)


def test_the_number_of_segments_is_the_elbow_of_the_colors() -> None:
    for image in (data.coins(), data.coffee()[::5, ::5]):
        curve = segment(image, "auto").curve
        assert curve is not None
        assert curve.elbow() == energy_curve(image).elbow() > 1


def test_curves_of_segments_have_one_unit_whether_edges_cost_or_not() -> None:
    image = np.repeat(np.array([[0, 90, 200]], np.uint8), 12, axis=0).repeat(12, axis=1)  # levels in steps of 10
    free, costly = (segment(image, "auto", edge_weight=weight).curve for weight in (0, 1))
    assert free is not None
    assert costly is not None
    np.testing.assert_allclose(costly.energies[:2], free.energies[:2], rtol=1e-3)
    np.testing.assert_allclose(costly.generators[2], [[0], [90], [200]], atol=1e-4)


def test_a_fourth_channel_that_may_be_alpha_is_told() -> None:
    logo = np.zeros((12, 16, 4), np.uint8)
    logo[3:9, 3:9] = 200, 30, 30, 255
    with pytest.warns(UserWarning, match="image has 4 channels that all count"):
        segment(logo, 2)
