"""Relations: an input is changed, and its result must follow in a known way, whatever the right result is.

This is metamorphic testing (T. Y. Chen et al., ACM Computing Surveys 51 (2018), doi 10.1145/3143561). Each subject has
a module ``test_SUBJECT.py`` here with its table of relations::

    RELATIONS = [
        Relation("tessellate", "an offset", rows, energy, lambda rows: rows + 1000, close(1e-6), since="2026-11-27"),
        ...
    ]
    test_a_result_follows_its_input, test_a_result_follows_any_input = quick_and_wide(RELATIONS)

The first test tries an input, always; the second draws many by Hypothesis, in the slow run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

#: Inputs of each relation in the quick run, and in the slow one.
QUICK, WIDE = 1, 11


@dataclass(frozen=True)
class Relation:
    """How the result of a verb follows a change of its input."""

    verb: str
    change: str
    #: Makes an input from random numbers.
    inputs: Callable[[np.random.Generator], Any]
    #: Returns what is compared.
    result: Callable[[Any], Any]
    #: Changes an input, or turns it into what a trivial rival makes of it if ``rival`` is not given.
    changed: Callable[[Any], Any]
    #: Asserts that the second result follows the first.
    follows: Callable[[Any, Any], None]
    #: When it was found broken, or first told.
    since: str
    #: Why results may differ by what ``follows`` allows.
    because: str = ""
    #: What is computed from the changed input, in place of ``result``.
    rival: Callable[[Any], Any] | None = None

    def __str__(self) -> str:
        """Name the cell of the table."""
        return f"{self.verb}: {self.change}"

    def check(self, seed: int) -> None:
        """Assert the relation for the input of a seed."""
        before = self.inputs(np.random.default_rng(seed))
        after = self.changed(before)
        self.follows(self.result(before), (self.rival or self.result)(after))


def quick_and_wide(relations: Sequence[Relation]) -> tuple[Callable[..., None], Callable[..., None]]:
    """Return the quick and the slow test of a table of relations."""
    each = pytest.mark.parametrize("relation", relations, ids=str)

    @each
    @pytest.mark.parametrize("seed", range(QUICK))
    def quick(relation: Relation, seed: int) -> None:
        relation.check(seed)

    @pytest.mark.slow
    @each
    @settings(max_examples=WIDE)
    @given(seed=st.integers(QUICK, 2**32 - 1))
    def wide(relation: Relation, seed: int) -> None:
        relation.check(seed)

    return quick, wide


def equal(before: Any, after: Any) -> None:
    """Assert that two results are the same."""
    np.testing.assert_array_equal(after, before)


def close(relative: float, absolute: float = 0) -> Callable[[Any, Any], None]:
    """Return a relation of figures that differ by a share of themselves at most."""

    def follows(before: Any, after: Any) -> None:
        np.testing.assert_allclose(after, before, rtol=relative, atol=absolute)

    return follows


def not_above(share: float = 1) -> Callable[[Any, Any], None]:
    """Return a relation of a result that is at most a share of its rival's; energies, errors, sizes."""

    def follows(result: Any, rival: Any) -> None:
        assert result <= share * rival, f"{result} is above {share} x {rival}"

    return follows
