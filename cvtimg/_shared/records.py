"""Records of results, which prove themselves where that is asked for."""

import os
from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

#: Whether results prove themselves: with CVTIMG_CHECK=1 in the environment, as in the tests.
PROVING = os.environ.get("CVTIMG_CHECK", "0") not in ("", "0")
#: Figures that are summed in another order may differ by this share: half of the digits of double precision are alike.
_ROUNDING = float(np.sqrt(np.finfo(np.float64).eps))

#: What must hold of a result, in words, and whether it does.
Claims = Iterator[tuple[str, Any]]


class UnprovenError(AssertionError):
    """A result contradicts itself."""


class ReadOnly:
    """A dataclass whose arrays, alone or in tuples, cannot be written to, and whose claims are checked if asked for."""

    __slots__ = ()

    def __post_init__(self) -> None:
        record: Any = self
        for field in fields(record):
            value = getattr(self, field.name)
            for array in value if isinstance(value, tuple) else (value,):
                if isinstance(array, np.ndarray):
                    array.flags.writeable = False
        if PROVING:
            prove(type(self).__name__, self._claims())

    def _claims(self) -> Claims:
        """Yield what must hold of the fields, in words, and whether it does."""
        return iter(())


def prove(name: str, claims: Claims) -> None:
    """Raise `UnprovenError` at the first claim that does not hold."""
    for claim, holds in claims:
        if not np.all(holds):
            raise UnprovenError(f"{name}: {claim} does not hold")


def never_rises(energies: ArrayLike) -> bool:
    """Whether no energy is above the one before, but for rounding."""
    values = np.asarray(energies, np.float64)
    return bool((np.diff(values) <= _ROUNDING * np.abs(values[:-1])).all())


def equals(figure: ArrayLike, other: ArrayLike, rounding: float = _ROUNDING) -> bool:
    """Whether figures are the same, but for rounding as a share of the largest."""
    largest = max(1e-300, float(np.max(np.abs(other), initial=0)))
    return bool(np.allclose(figure, other, rtol=0, atol=rounding * largest))
