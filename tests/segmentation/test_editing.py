"""Labels changed by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cvtimg import segment_hierarchy
from cvtimg._shared.types import Ints
from cvtimg.segmentation import RegionHierarchy, brush, edit_labels

POINTS = st.lists(st.tuples(st.integers(-6, 36), st.integers(-6, 26)), min_size=1, max_size=4)


@pytest.fixture(scope="module")
def tree() -> RegionHierarchy:
    """Return the tree of a picture of a few shapes with noise."""
    y, x = np.mgrid[:48, :64]
    picture = np.full((48, 64), 60.0)
    picture[(x - 20) ** 2 + (y - 20) ** 2 < 150] = 200
    picture[30:44, 40:60] = 130
    picture += np.random.default_rng(0).normal(0, 6, picture.shape)
    return segment_hierarchy(np.clip(picture, 0, 255).astype(np.uint8), n_leaves=60)


def same_parts(one: Ints, other: Ints) -> bool:
    """Whether two label images divide the picture in the same way."""
    pairs = np.unique(np.stack([one.ravel(), other.ravel()]), axis=1)
    return pairs.shape[1] == len(np.unique(one)) == len(np.unique(other))


@pytest.mark.parametrize("n_regions", [1, 2, 5, 12])
def test_a_split_of_the_region_that_merged_last_is_the_finer_cut(tree: RegionHierarchy, n_regions: int) -> None:
    coarse, fine = tree.cut(n_regions), tree.cut(n_regions + 1)
    inside = next(label for label in range(1, n_regions + 1) if len(np.unique(fine[coarse == label])) == 2)
    y, x = np.argwhere(coarse == inside)[0]
    assert same_parts(edit_labels(coarse, [f"split {x},{y}"], hierarchy=tree), fine)


def test_merging_what_was_split_gives_it_back(tree: RegionHierarchy) -> None:
    labels = tree.cut(6)
    split = edit_labels(labels, ["split 20,20"], hierarchy=lambda: tree)
    own = labels == labels[20, 20]
    old, new = np.unique(split[own])
    assert not np.isin(split[~own], (old, new)).any()
    (y0, x0), (y1, x1) = (np.argwhere(split == label)[0] for label in (old, new))
    assert same_parts(edit_labels(split, [f"merge {x0},{y0} {x1},{y1}"]), labels)


def test_parts_that_never_merge_are_split_apart() -> None:
    mask = np.ones((30, 40), bool)
    mask[:, 18:22] = False
    tree = segment_hierarchy(np.tile(np.arange(40, dtype=np.uint8), (30, 1)), mask=mask, n_leaves=20)
    with pytest.raises(ValueError, match="n_regions=1 must be an integer >= 2"):
        tree.cut(1)
    joined = edit_labels(tree.cut(2), ["merge 3,3 35,3"])
    assert same_parts(edit_labels(joined, ["split 3,3"], hierarchy=tree), tree.cut(2))


@pytest.mark.slow
@given(points=POINTS, radius=st.floats(0, 9))
def test_a_brush_covers_the_pixels_near_its_way(points: list[tuple[int, int]], radius: float) -> None:
    drawn = np.zeros((20, 30), bool)
    brush(drawn, points, radius, True)
    y, x = np.mgrid[:20, :30]
    ways = np.concatenate([np.linspace(a, b, 400) for a, b in zip(points, [*points[1:], points[-1]], strict=True)])
    nearest = np.sqrt(((x[..., None] - ways[:, 0]) ** 2 + (y[..., None] - ways[:, 1]) ** 2).min(axis=2))
    sure = abs(nearest - radius) > 0.1
    assert (drawn == (nearest <= radius))[sure].all()


def test_brushes_extend_make_and_leave_out_segments() -> None:
    labels = np.repeat([[1, 1, 2, 2, 2, 2]], 3, axis=0)
    assert edit_labels(labels, ["paint 0 0,1 3,1"]).tolist() == [
        [1, 1, 2, 2, 2, 2],
        [1] * 4 + [2] * 2,
        [1, 1, 2, 2, 2, 2],
    ]
    assert edit_labels(labels, ["add 0 5,0"])[0].tolist() == [1, 1, 2, 2, 2, 3]
    assert edit_labels(labels, ["erase 1 0,1"])[:, 0].tolist() == [0, 0, 0]
    assert edit_labels(labels, ["erase 9 2,1"]).max() == 0
    assert (edit_labels(labels, ["merge 0,0 -4,0 99,2", "add 2 60,60", "paint 1 60,60"]) == labels).all()


@pytest.mark.parametrize(
    "text", ["", "merge 1,2", "merge 1 2", "split", "paint 3", "paint x 3,4", "erase -1 3,4", "melt 3,4", "add inf 3,4"]
)
def test_other_texts_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="must be merge X,Y"):
        edit_labels(np.ones((4, 4), int), [text])


def test_a_split_needs_a_tree_and_parts(tree: RegionHierarchy) -> None:
    with pytest.raises(ValueError, match="needs the tree"):
        edit_labels(tree.cut(3), ["split 3,3"])
    with pytest.raises(ValueError, match="no parts in the tree"):
        edit_labels(tree.leaves, ["split 3,3"], hierarchy=tree)
    with pytest.raises(ValueError, match="hierarchy"):
        edit_labels(np.ones((4, 4), int), ["split 3,3"], hierarchy=tree)
