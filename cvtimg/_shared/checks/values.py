"""Checks of single values: choices, counts, numbers, and which arguments go together."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from typing import NoReturn, TypeVar

import numpy as np

_T = TypeVar("_T")
_Name = TypeVar("_Name", bound=str)
#: What people call arguments in other libraries.
_MEANT = {"k": "n_colors", "n_clusters": "n_colors", "colors": "n_colors", "seed": "rng", "random_state": "rng"}


def check_choice(name: str, value: _Name, choices: Collection[str]) -> _Name:
    """Return `value` if it is one of `choices`."""
    check_in_range(name, value, value in choices, f"one of {', '.join(choices)}")
    return value


def check_count(name: str, value: int, largest: int, reason: str) -> int:
    """Return `value` as an int in 1..largest; `reason` says what sets the largest."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{name}={value!r} must be an integer in 1..{largest}, {reason}")
    if not 1 <= value <= largest:
        raise ValueError(f"{name}={value} must be in 1..{largest}, {reason}")
    return int(value)


def check_at_least(name: str, value: int, least: int, reason: str) -> int:
    """Return an integer that is at least `least`; `reason` says what sets that, or what else is allowed."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        error = ValueError if isinstance(value, (int, np.integer)) else TypeError
        raise error(f"{name}={value!r} must be an integer >= {least}, {reason}")
    return int(value)


def check_at_most(name: str, number: int, most: int, what: str) -> None:
    """Refuse something that has more parts than can be handled."""
    if number > most:
        raise ValueError(f"{name} must have at most {most} {what}, not {number}")


def check_shares(shares: Mapping[str, float]) -> None:
    """Refuse named shares of a whole that are negative or do not add up to 1."""
    if not (min(shares.values()) >= 0 and abs(sum(shares.values()) - 1) <= 1e-12):
        given = " and ".join(f"{name}={float(share)}" for name, share in shares.items())
        raise ValueError(f"{given} must be >= 0, with sum 1")


def raise_unsupported(name: str, value: object, what: str, able: Collection[str]) -> NoReturn:
    """Refuse a combination of arguments that `value` does not support and those named in `able` do."""
    raise ValueError(f"{name}={value!r} does not support {what}; {' or '.join(able)} does")


def check_one_dimension(name: str, n_dims: int) -> None:
    """Refuse samples of more than one dimension where one is needed."""
    if n_dims != 1:
        raise ValueError(f"{name} needs samples of one dimension, not D={n_dims}")


def check_alone(name: str, others: Collection[str]) -> None:
    """Refuse other arguments, by their names, beside one that leaves nothing for them to do."""
    if others:
        raise ValueError(f"{name} must not be given with {' or '.join(others)}")


def check_that(name: str, holds: bool | np.bool_, demand: str) -> None:
    """Refuse an argument that does not do what it must."""
    if not holds:
        raise ValueError(f"{name} must {demand}")


def check_in_range(name: str, value: object, is_allowed: bool | np.bool_, allowed: str) -> None:
    """Refuse a value that is not in the range that `allowed` describes."""
    if not is_allowed:
        refuse(name, value, allowed)


def refuse(name: str, value: object, allowed: str) -> NoReturn:
    """Refuse a value that is none of those that `allowed` describes."""
    raise ValueError(f"{name}={value!r} must be {allowed}")


def refuse_type(name: str, kind: object, allowed: str) -> NoReturn:
    """Refuse a value for its type."""
    raise TypeError(f"{name} of type {kind} must be {allowed}")


def check_given(names: str, value: _T | None) -> _T:
    """Return a value that must be given, under one of these names."""
    if value is None:
        raise TypeError(f"{names} must be given")
    return value


def check_needs(name: str, given: bool, other: str, has_other: bool) -> None:
    """Refuse an argument that does nothing without another."""
    if given and not has_other:
        raise ValueError(f"{name} needs {other}")


def check_excluded(name: str, given: bool, **others: object) -> None:
    """Refuse arguments that have no meaning beside another; None, False and 0 are not given."""
    if given and (wrong := [other for other, value in others.items() if value]):
        raise ValueError(f"{name} takes no {' or '.join(wrong)}")


def check_one_of(**given: object) -> None:
    """Refuse several of the arguments that exclude each other, or none; None is not given."""
    if sum(value is not None for value in given.values()) != 1:
        raise TypeError(f"one of {' and '.join(given)} must be given, and only one")


def check_positive(name: str, value: float, unit: str = "") -> float:
    """Return `value` as a finite float > 0; `unit` says of what, or what else is allowed."""
    number = float(value)
    check_in_range(name, value, 0 < number < np.inf, f"a finite number > 0{unit and ', '}{unit}")
    return number


def check_non_negative(name: str, value: float) -> float:
    """Return `value` as a finite float >= 0."""
    number = float(value)
    check_in_range(name, value, 0 <= number < np.inf, "a finite number >= 0")
    return number


def check_in_unit_range(name: str, value: float) -> float:
    """Return `value` as a float in 0..1."""
    number = float(value)
    check_in_range(name, value, 0 <= number <= 1, "in 0..1")
    return number


def check_edge_weight(edge_weight: float | str) -> float | None:
    """Return an edge weight >= 0, or None for "auto"."""
    if not isinstance(edge_weight, str):
        return check_non_negative("edge_weight", edge_weight)
    check_in_range("edge_weight", edge_weight, edge_weight == "auto", "a finite number >= 0, or 'auto'")
    return None


def check_keywords(function: str, given: Collection[str], known: Collection[str]) -> None:
    """Refuse keyword arguments that a function does not have, and name the one that was likely meant."""
    for name in given:
        if name not in known:
            meant = _MEANT.get(name)
            hint = f"; did you mean {meant}?" if meant else f"; options are {', '.join(sorted(known))}"
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}{hint}")


def refuse_path(name: str, value: object) -> None:
    """Refuse a path where its content is wanted."""
    if isinstance(value, (str, bytes, os.PathLike)) or (
        isinstance(value, (list, tuple)) and value and isinstance(value[0], (str, os.PathLike))
    ):
        raise TypeError(f"{name}={value!r} must be an array; read an image with cvtimg.read_image")
