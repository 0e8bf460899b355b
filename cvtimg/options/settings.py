"""Files of settings: the options of a command as JSON, such as ``{"colors": 16, "dither": "bayer"}``.

The page writes them, and every command reads them as the words that they stand for, before those of the command line.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any

from cvtimg.batch import WrongUsageError
from cvtimg.batch.report import reason
from cvtimg.options import options_of
from cvtimg.options.record import Option, Pair, Real, Switch, Whole

#: The command that settings are for; may be left out.
_COMMAND = "command"


@cache
def _by_word(verb: str) -> dict[str, Option]:
    options = (option for option in options_of(verb) if option.name != "settings")
    return {way: option for option in options for word in option.words for way in word.split("/")}


def read_settings(path: str | Path, verb: str) -> list[str]:
    """Return the words of the command line that a file of settings stands for.

    Raises
    ------
    OSError
        If the file cannot be read.
    WrongUsageError
        If a name or a value is not that of an option of the command; the message names the file and the option.
    """
    try:
        settings = json.loads(Path(path).read_text("utf-8"))
    except OSError as error:
        raise OSError(f"{path}: {reason(path, error)}") from error
    except (ValueError, RecursionError) as error:
        raise WrongUsageError(f"{path} is not JSON: {error}") from error
    if not isinstance(settings, dict):
        raise WrongUsageError(f'{path} must be an object of options and their values, such as {{"colors": 16}}')
    if (named := settings.pop(_COMMAND, verb)) != verb:
        raise WrongUsageError(f"{path} has settings of cvtimg {named}, not of cvtimg {verb}")
    known, words = _by_word(verb), []
    for name, value in settings.items():
        option = known.get(f"--{name}")
        if option is None:
            near = get_close_matches(f"--{name}", known, 1)
            hint = f"; did you mean {near[0][2:]!r}?" if near else ""
            raise WrongUsageError(f"{path}: cvtimg {verb} has no option {name!r}{hint}")
        try:
            words += _words(option, f"--{name}", value)
        except ValueError as error:
            raise WrongUsageError(f"{path}: {name}: {error}") from error
    return words


def _words(option: Option, flag: str, value: Any) -> list[str]:
    """Write a value as the command line does; check it."""
    if isinstance(option.kind, Switch):
        if not isinstance(value, bool):
            raise ValueError(f"{json.dumps(value)} must be true or false")
        on, _, off = option.words[0].partition("/")
        return [on] if value != (flag == off) else [off] if off else []
    if isinstance(option.kind, Pair):
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError(f"{json.dumps(value)} must be a list of two numbers")
        texts = [_text(one) for one in value]
        option.kind.parse(texts)
        return [flag, *texts]
    if isinstance(value, list) and not option.many:
        raise ValueError(f"{json.dumps(value)} must be one value")
    texts = [_text(one) for one in (value if isinstance(value, list) else [value])]
    for text in texts:
        option.kind.parse(text)
    return [f"{flag}={text}" for text in texts]


def _text(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise ValueError(f"{json.dumps(value)} must be a number or a text")
    return str(value)


def settings_of(verb: str, words: Sequence[str]) -> Mapping[str, Any]:
    """Return the settings that words of a command stand for; inputs are left out."""
    known, settings, rest = _by_word(verb), dict[str, Any](), iter(words)
    for word in rest:
        option = known.get(word)
        if option is None:
            continue
        name, value = option.words[0].partition("/")[0].removeprefix("--"), _value(option, word, rest)
        settings[name] = [*settings.get(name, []), value] if option.many else value
    return {_COMMAND: verb, **settings}


def _value(option: Option, flag: str, words: Iterator[str]) -> Any:
    if isinstance(option.kind, Switch):
        return not option.words[0].endswith(f"/{flag}")
    if isinstance(option.kind, Pair):
        return [float(next(words)), float(next(words))]
    word = next(words)
    return option.kind.parse(word) if isinstance(option.kind, (Whole, Real)) else word
