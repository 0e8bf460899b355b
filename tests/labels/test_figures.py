"""Claims about figures of regions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cvtimg._shared.types import Array
from cvtimg.labels import region_table
from cvtimg.labels.figures import region_means

LABELS = arrays(np.int32, st.tuples(st.integers(1, 7), st.integers(1, 7)), elements=st.integers(0, 4))
RNG = np.random.default_rng(8)


@given(LABELS)
@settings(max_examples=40)
def test_the_table_has_the_figures_that_numpy_finds(labels: Array) -> None:
    image = np.random.default_rng(labels.size).integers(0, 256, (*labels.shape, 3), dtype=np.uint8)
    table = region_table(labels, image)
    assert table["label"].tolist() == np.unique(labels[labels > 0]).tolist()
    for row, label in enumerate(table["label"]):
        inside = labels == label
        rows, columns = np.nonzero(inside)
        found = {name: float(column[row]) for name, column in table.items()}
        assert found["area"] == inside.sum()
        assert (found["x"], found["y"]) == pytest.approx((columns.mean() + 0.5, rows.mean() + 0.5))
        box = found["left"], found["top"], found["right"], found["bottom"]
        assert box == (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
        for band in range(3):
            assert found[f"mean_{band + 1}"] == pytest.approx(image[inside][:, band].mean())
            assert found[f"std_{band + 1}"] == pytest.approx(image[inside][:, band].std())


def test_the_perimeter_of_a_square_runs_through_the_centers_of_its_rim() -> None:
    labels = np.zeros((9, 9), int)
    labels[2:7, 2:7] = 1
    assert region_table(labels, labels)["perimeter"].tolist() == [16]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_means_are_those_of_the_pixels_in_every_type_and_nan_for_what_is_not_there(dtype: type) -> None:
    labels = RNG.choice([0, 1, 4], (9, 7))
    image = RNG.integers(0, 200, (9, 7, 2)).astype(dtype)
    means = region_means(labels, image)
    assert means.shape == (5, 2)
    assert np.isnan(means[[0, 2, 3]]).all()
    for label in (1, 4):
        np.testing.assert_allclose(means[label], image[labels == label].mean(axis=0), rtol=1e-6)


def test_masked_pixels_may_be_nan_and_others_not() -> None:
    labels, image = np.array([[0, 1, 1]]), np.array([[np.nan, 1, 3]])
    assert region_means(labels, image)[1].tolist() == [2]
    assert region_table(labels, image)["std_1"].tolist() == [1]
    with pytest.raises(ValueError, match="finite"):
        region_means(labels + 1, image)


def test_a_picture_without_regions_has_no_figures() -> None:
    nothing = np.zeros((3, 3), int)
    table = region_table(nothing, np.zeros((3, 3, 2)))
    assert [len(column) for column in table.values()] == [0] * len(table)
    assert "std_2" in table


def test_more_properties_are_named_and_measured_as_in_scikit_image() -> None:
    from skimage.measure import regionprops_table

    labels = np.kron(np.arange(6).reshape(2, 3), np.ones((7, 5), int))
    image = np.random.default_rng(0).random(labels.shape)
    names = ("eccentricity", "solidity", "centroid_weighted")
    table = region_table(labels, image, names)
    expected = regionprops_table(labels, image[..., None], properties=names)
    assert list(table)[-len(expected) :] == list(expected)
    for name, column in expected.items():
        np.testing.assert_array_equal(table[name], column)
    for name in ("shape", "coords"):
        with pytest.raises(ValueError, match=f"properties: '{name}' must have a number per region"):
            region_table(labels, image, [name])
