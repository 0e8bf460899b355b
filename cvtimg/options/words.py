"""Words of a command line as values of the options of its verb."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import chain, islice
from typing import Any

from cvtimg.batch import WrongUsageError
from cvtimg.batch.pipes import STANDARD
from cvtimg.options import options_of
from cvtimg.options.record import Option, Pair, Switch

#: Either letter stands for the number, where a command has but one of them.
_SAME = {"-n": "-k", "-k": "-n"}


@cache
def by_word(verb: str) -> dict[str, Option]:
    """Return the options of a verb by each way in which they are written."""
    return {way: option for option in options_of(verb) for word in option.words for way in word.split("/")}


def taken(verb: str, words: Sequence[str]) -> dict[str, Any]:
    """Return what words say of each option by its name: whether a switch is on, or the text or texts that follow.

    Raises
    ------
    WrongUsageError
        If there is no such option, or if its value is missing or not wanted.
    """
    known, rest = by_word(verb), iter(words)
    inputs = next((option.name for option in options_of(verb) if not option.words), "")
    found: dict[str, Any] = {}
    for word in rest:
        if word == "--":
            found.setdefault(inputs, []).extend(rest)
        elif word == STANDARD or not word.startswith("-"):
            found.setdefault(inputs, []).append(word)
        else:
            flag, *attached = word.split("=", 1) if word.startswith("--") else filter(None, (word[:2], word[2:]))
            option = known.get(flag) or known.get(_SAME.get(flag, ""))
            if option is None:
                from difflib import get_close_matches

                near = get_close_matches(flag, known, 1)
                raise WrongUsageError(f"No such option: {flag}" + "".join(f"; did you mean {one}?" for one in near))
            value = _value(option, flag, attached, rest)
            found[option.name] = [*found.get(option.name, []), value] if option.many else value
    if "" in found:
        raise WrongUsageError(f"cvtimg {verb} has no inputs, and got {' '.join(found[''])}")
    return found


def _value(option: Option, flag: str, attached: Sequence[str], rest: Iterator[str]) -> Any:
    """Return the value that follows an option, or is attached to it."""
    if isinstance(option.kind, Switch):
        if attached:
            raise WrongUsageError(f"{flag} takes no value")
        return not option.words[0].endswith(f"/{flag}")
    pair = isinstance(option.kind, Pair)
    values = list(islice(chain(attached, rest), 2 if pair else 1))
    if len(values) < (2 if pair else 1):
        raise WrongUsageError(f"{flag} needs {'two values' if pair else 'a value'}")
    return values if pair else values[0]
