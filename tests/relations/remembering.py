"""Results that are computed once for each input, as many relations begin with the same; or in two ways from one."""

import pickle
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import numpy as np
from relations.relation import Relation, equal

Result = TypeVar("Result")


def remembered(result: Callable[[Any], Result]) -> Callable[[Any], Result]:
    """Return the function, which computes the results of equal values once, however they are held in memory."""
    results: dict[bytes, Result] = {}

    @wraps(result)
    def recall(given: Any) -> Result:
        key = pickle.dumps(given)
        if key not in results:
            results[key] = result(given)
        return results[key]

    return recall


def beside(
    verb: str,
    change: str,
    inputs: Callable[[np.random.Generator], Any],
    result: Callable[[Any], Any],
    rival: Callable[[Any], Any],
    follows: Callable[[Any, Any], None] = equal,
    since: str = "2026-11-28",
    because: str = "",
) -> Relation:
    """Return the relation of a result to that of another way from the same input."""
    return Relation(verb, change, inputs, result, lambda given: given, follows, since, because, rival)
