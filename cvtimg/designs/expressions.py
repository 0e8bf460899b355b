"""Functions of points that a text gives, such as ``speed * heat < 100``, computed by numexpr."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cvtimg._shared.extras import optional
from cvtimg._shared.types import Array, Floats


def computed(name: str, expression: str, axes: Sequence[str]) -> Callable[[Floats], Array]:
    """Return the function from (m, d) points to (m,) values that an expression of the names of axes stands for.

    Axes are also called x1, x2 and so on, for names with spaces. Errors name the expression by `name`.
    """
    numexpr = optional("numexpr", "designs")

    def function(points: Floats) -> Array:
        columns = {f"x{axis}": column for axis, column in enumerate(points.T, 1)}
        columns |= dict(zip(axes, points.T, strict=True))
        return np.broadcast_to(numexpr.evaluate(expression, columns, {}), len(points))

    try:
        function(np.full((1, len(axes)), 0.5))
    except KeyError as error:
        raise ValueError(f"{name} {expression!r} has no axis {error}; there are {', '.join(axes)}") from None
    except Exception as error:
        raise ValueError(f"{name} {expression!r} cannot be computed: {error}") from None
    return function
