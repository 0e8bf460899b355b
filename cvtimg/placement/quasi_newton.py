"""The inverse Hessian that limited-memory BFGS remembers.

D. C. Liu, J. Nocedal, On the limited memory BFGS method for large scale optimization, Mathematical Programming 45
(1989) 503-528, doi 10.1007/BF01589116.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

_Points = NDArray[np.float64]

#: It starts as the given one times a number in this range.
_LEAST_SCALE, _LARGEST_SCALE = 0.5, 4.0


class StepMemory:
    """The last steps of a descent, and how they changed the gradient.

    Parameters
    ----------
    n_steps : int
        How many steps; figures hardly change from 5 to 10.
    """

    def __init__(self, n_steps: int = 7) -> None:
        self._pairs: deque[tuple[_Points, _Points, float]] = deque(maxlen=n_steps)

    def __len__(self) -> int:
        return len(self._pairs)

    def clear(self) -> None:
        """Forget all steps."""
        self._pairs.clear()

    def learn(self, step: _Points, change: _Points) -> None:
        """Remember a step (K, D) and the change of the gradient, unless the energy is not convex along it."""
        product = dot(step, change)
        if product > 1e-12 * (dot(step, step) * dot(change, change)) ** 0.5:
            self._pairs.append((step, change, product))

    def times(self, gradient: _Points, start: Callable[[_Points], _Points]) -> _Points:
        """Multiply a gradient (K, D) by the inverse Hessian; `start` multiplies by that of a Hessian to start from."""
        rest, buffer, parts = gradient.copy(), np.empty_like(gradient), []
        for step, change, product in reversed(self._pairs):
            part = dot(step, rest) / product
            rest -= np.multiply(change, part, out=buffer)
            parts.append(part)
        rest = start(rest)
        if self._pairs:
            _, change, product = self._pairs[-1]
            rest *= min(max(product / dot(start(change), change), _LEAST_SCALE), _LARGEST_SCALE)
        for (step, change, product), part in zip(self._pairs, reversed(parts), strict=True):
            rest += np.multiply(step, part - dot(change, rest) / product, out=buffer)
        return rest


def dot(a: _Points, b: _Points) -> float:
    """Return the sum of the products of two (K, D) arrays."""
    # Not NumPy's product: the threads of a BLAS change bits, and spin while they wait.
    return float(np.einsum("kd,kd", a, b))
