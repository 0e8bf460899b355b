"""How far computations are: what is told within parts, and by the verbs that take long."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import cvtimg
from cvtimg._shared.progress import each, first_few, part, tell, watched
from cvtimg.restoration import detail

IMAGE = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
LABELS = np.repeat([[1, 2]], 32, axis=0).repeat(32, axis=1)


def shares(compute: Callable[[], Any]) -> list[float]:
    told: list[float] = []
    with watched(told.append):
        compute()
    assert told == sorted(told)
    return list(dict.fromkeys(told))


def test_parts_of_parts_are_parts_of_the_whole() -> None:
    def compute() -> None:
        with part(0, 0.5):
            tell(0.5)
            with part(0.8, 1):
                tell(0.5)
        for _ in each(["a", "b"]):
            with part(0.5, 0.75):
                tell(0.2)

    np.testing.assert_allclose(shares(compute), [0.25, 0.45, 0.5, 0.775, 0.875, 1])


def test_shares_grow_and_are_at_most_one() -> None:
    assert shares(lambda: [tell(share) for share in (0.2, 0.1, 0.2, 3, 2)]) == [0.2, 1]


def test_a_loop_that_is_left_early_ends_its_part() -> None:
    def compute() -> None:
        for number in first_few(range(9), 0.5):
            if number == 2:
                break
        tell(0.9)

    assert shares(compute) == [0.5, 0.75, 0.9]


def test_nobody_is_told_outside() -> None:
    assert shares(lambda: tell(0.3)) == [0.3]
    with part(0, 1):
        tell(0.5)


@pytest.mark.parametrize(
    "verb",
    [
        lambda: cvtimg.mesh_labels(LABELS, n=1200),
        lambda: cvtimg.stipple(IMAGE, 200),
        lambda: cvtimg.stipple(IMAGE, 200, layers="cmyk"),
        lambda: cvtimg.mosaic(IMAGE, 80, effort="fast"),
        pytest.param(lambda: cvtimg.denoise([IMAGE], effort="fast"), marks=pytest.mark.slow),
        lambda: cvtimg.restore([IMAGE], 3),
        lambda: cvtimg.quantize(IMAGE, psnr=22),
        pytest.param(lambda: cvtimg.segment(IMAGE, "auto", edge_weight=20), marks=pytest.mark.slow),
        lambda: cvtimg.segment_hierarchy(IMAGE),
    ],
    ids=["mesh", "stipple", "pens", "mosaic", "detail", "restore", "psnr", "segment", "hierarchy"],
)
def test_verbs_that_take_long_tell_on_their_way(verb: Callable[[], Any]) -> None:
    told = shares(verb)
    assert told == sorted(told)
    assert any(share < 0.5 for share in told)
    assert told[-1] >= 0.7
    assert np.diff([0, *told]).max() < 0.8


def test_little_is_told_before_the_first_pass_over_patches(monkeypatch: pytest.MonkeyPatch) -> None:
    told, before = [0.0], []
    own = detail._pass

    def passed(*arguments: Any, **options: Any) -> Any:
        before.append(told[-1])
        return own(*arguments, **options)

    monkeypatch.setattr(detail, "_pass", passed)
    with watched(told.append):
        cvtimg.denoise([IMAGE], effort="fast")
    assert before[0] < 0.3
    assert len(set(before)) == len(before)
