"""Results that are computed once for each input: many relations of a subject begin with the same."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

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
