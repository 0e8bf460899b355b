"""The inverse Hessian that limited-memory BFGS remembers.

D. C. Liu, J. Nocedal, On the limited memory BFGS method for large scale optimization, Mathematical Programming 45
(1989) 503-528, doi 10.1007/BF01589116.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

_Vector = NDArray[np.float64]

#: It starts as the given one times a number in this range.
_LEAST_SCALE, _LARGEST_SCALE = 0.5, 4.0


def dot(a: _Vector, b: _Vector) -> float:
    """Return the sum of the products of two (K, D) arrays."""
    # Not NumPy's product: the threads of a BLAS change bits, and spin while they wait.
    return float(np.einsum("kd,kd", a, b))


class StepMemory:
    """The last steps of a descent, and how they changed the gradient.

    Vectors may be any arrays, such as coefficients of vectors that lie elsewhere, with a product to match.

    Parameters
    ----------
    n_steps : int
        How many steps; figures hardly change from 5 to 10.
    product : callable
        Of two vectors.
    """

    def __init__(self, n_steps: int = 7, product: Callable[[_Vector, _Vector], float] = dot) -> None:
        self._pairs: deque[tuple[_Vector, _Vector, float]] = deque(maxlen=n_steps)
        self._product = product

    def __len__(self) -> int:
        return len(self._pairs)

    def clear(self) -> None:
        """Forget all steps."""
        self._pairs.clear()

    def forget(self) -> None:
        """Forget the oldest step."""
        self._pairs.popleft()

    def learn(self, step: _Vector, change: _Vector) -> bool:
        """Remember a step and the change of the gradient, unless the energy is not convex along it; tell whether."""
        product = self._product(step, change)
        is_convex = product > 1e-12 * (self._product(step, step) * self._product(change, change)) ** 0.5
        if is_convex:
            self._pairs.append((step, change, product))
        return is_convex

    def times(self, gradient: _Vector, start: Callable[[_Vector], _Vector], scale: float = 1.0) -> _Vector:
        """Multiply a gradient by the inverse Hessian, which starts as `start` times about `scale`."""
        rest, buffer, parts = gradient.copy(), np.empty_like(gradient), []
        for step, change, product in reversed(self._pairs):
            part = self._product(step, rest) / product
            rest -= np.multiply(change, part, out=buffer)
            parts.append(part)
        rest = start(rest)
        if self._pairs:
            _, change, product = self._pairs[-1]
            found = product / self._product(start(change), change)
            scale = min(max(found, _LEAST_SCALE * scale), _LARGEST_SCALE * scale)
        rest *= scale
        for (step, change, product), part in zip(self._pairs, reversed(parts), strict=True):
            rest += np.multiply(step, part - self._product(change, rest) / product, out=buffer)
        return rest
