"""Claims about films: each frame is restored from those around it, and keeps its own moment."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg import restore, restore_frames
from cvtimg.restoration.films import _windows


@pytest.mark.parametrize("length", [1, 2, 5, 8])
def test_a_window_has_the_frame_first_and_then_those_nearest_to_it_and_no_more_is_read(length: int) -> None:
    read = 0

    def frames() -> Any:
        nonlocal read
        while read < 7:
            read += 1
            yield read - 1

    for number, window in enumerate(_windows(frames(), length)):
        apart = [abs(other - number) for other in window]
        assert apart[0] == 0
        assert apart == sorted(apart)
        assert len(set(window)) == len(window) == min(length, 7)
        assert read <= max(number + length // 2 + 1, length)
    assert number == 6


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_frames_are_better_than_each_alone_also_where_things_move_and_scenes_change(photograph: NDArray[Any]) -> None:
    rng, clean = np.random.default_rng(0), []
    for number in range(4):
        view = photograph[8 + number : 104 + number, 8 + 2 * number : 136 + 2 * number].copy()
        view[30:50, 20 * number + 10 : 20 * number + 30] = photograph[100:120, 40:60]
        clean.append(view)
    clean += [np.ascontiguousarray(photograph[:96, :128][::-1])] * 2  # another scene
    film = [np.clip(one + rng.normal(0, 15, one.shape), 0, 255).astype(np.uint8) for one in clean]
    results = list(restore_frames(film, window=3, effort="fast"))

    def error(image: NDArray[Any], number: int, part: Any = slice(None)) -> float:
        return float(np.square(image.astype(float) - clean[number])[part].mean())

    np.testing.assert_array_equal(
        next(restore_frames(film, window=1, effort="fast")).image, restore(film[:1], detail=True, effort="fast").image
    )
    for number, result in enumerate(results):
        alone = restore([film[number]], detail=True, effort="fast").image
        assert error(result.image, number) < (0.8 if number < 3 else 1) * error(alone, number)
        moved = slice(30, 50), slice(20 * number + 10, 20 * number + 30)
        assert number > 3 or error(result.image, number, moved) < 1.4 * error(alone, number, moved)
