"""Results of physical space as notebooks show them: drawn by matplotlib, where that is installed."""

from importlib.util import find_spec
from io import BytesIO
from itertools import combinations
from typing import Any

import numpy as np

from cvtimg._shared.types import Array

#: Triangles in space; of more, which take seconds, the corners are drawn.
_MOST_TRIANGLES = 20_000


def drawn(
    caption: str, points: Array, triangles: Array | None = None, *, y_down: bool = False, is_place: bool = True
) -> bytes | None:
    """Draw points (N, D) in each pair of their first four axes, or triangles of them, as PNG; None if it cannot be.

    `y_down` is for images, and `is_place` tells whether axes have the same unit.
    """
    if find_spec("matplotlib") is None:
        return None
    from matplotlib.figure import Figure

    figure, content = Figure(figsize=(4.4, 4.4), layout="constrained"), BytesIO()
    figure.suptitle(caption, fontsize=8)
    if triangles is not None and points.shape[1] == 3:
        space: Any = figure.add_subplot(projection="3d")
        if len(triangles) <= _MOST_TRIANGLES:
            space.plot_trisurf(*points.T, triangles=triangles, color="white", edgecolor="0.3", linewidth=0.4)
        else:
            space.scatter(*points.T, s=1)
        space.set_aspect("equal")
        space.set_axis_off()
    else:
        shown = points if points.shape[1] > 1 else np.column_stack([points, np.zeros(len(points))])
        n_axes = min(shown.shape[1], 4)
        for across, down in combinations(range(n_axes), 2):
            axes = figure.add_subplot(n_axes - 1, n_axes - 1, (down - 1) * (n_axes - 1) + across + 1)
            if triangles is None:
                axes.plot(shown[:, across], shown[:, down], ".", markersize=3)
            else:
                axes.triplot(*shown.T, triangles, linewidth=0.4, color="C0")
            axes.set_aspect("equal" if is_place else "auto")
            axes.tick_params(labelsize=6)
            if y_down:
                axes.invert_yaxis()
    figure.savefig(content, format="png", dpi=120)
    return content.getvalue()
