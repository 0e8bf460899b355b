"""Files of settings: the options of a command as JSON, such as ``{"colors": 16, "dither": "bayer"}``.

The page writes them, and every command reads them; words of the command line override them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from cvtimg.batch import WrongUsageError
from cvtimg.batch.report import reason
from cvtimg.options.record import Option, Pair, Real, Switch
from cvtimg.options.words import by_word, taken

#: The command that settings are for; may be left out.
_COMMAND = "command"


def read_settings(path: str | Path, verb: str) -> dict[str, Any]:
    """Return what a file of settings says of options, as `taken` does of words.

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
    known = {word: option for word, option in by_word(verb).items() if option.name != "settings"}
    found: dict[str, Any] = {}
    for name, value in settings.items():
        option = known.get(f"--{name}")
        if option is None:
            near = get_close_matches(f"--{name}", known, 1)
            hint = f"; did you mean {near[0][2:]!r}?" if near else ""
            raise WrongUsageError(f"{path}: cvtimg {verb} has no option {name!r}{hint}")
        try:
            found[option.name] = _checked(option, f"--{name}", value)
        except ValueError as error:
            raise WrongUsageError(f"{path}: {name}: {error}") from error
    return found


def _checked(option: Option, flag: str, value: Any) -> Any:
    """Return a value as words of the command line give it, once it is checked."""
    if isinstance(option.kind, Switch):
        if not isinstance(value, bool):
            raise ValueError(f"{json.dumps(value)} must be true or false")
        return value != option.words[0].endswith(f"/{flag}")
    pair = isinstance(option.kind, Pair)
    if pair and (not isinstance(value, list) or len(value) != 2):
        raise ValueError(f"{json.dumps(value)} must be a list of two numbers")
    if isinstance(value, list) and not (pair or option.many):
        raise ValueError(f"{json.dumps(value)} must be one value")
    texts = [_text(one) for one in (value if isinstance(value, list) else [value])]
    given = texts if pair or option.many else texts[0]
    option.parse(given)
    return given


def _text(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise ValueError(f"{json.dumps(value)} must be a number or a text")
    return str(value)


def settings_of(verb: str, words: Sequence[str]) -> Mapping[str, Any]:
    """Return the settings that words of a command stand for; inputs are left out."""
    found, settings = taken(verb, words), dict[str, Any]()
    for option in by_word(verb).values():
        if option.name in found:
            name, value = option.words[0].partition("/")[0].removeprefix("--"), found[option.name]
            settings[name] = option.parse(value) if isinstance(option.kind, (Real, Pair)) else value
    return {_COMMAND: verb, **settings}
