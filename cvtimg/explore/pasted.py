"""A command that is pasted: the settings of the page that it asks for."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from typing import Any

from cvtimg._shared.choices import Json
from cvtimg.explore.controls import (
    Choice,
    Control,
    Number,
    Several,
    Switch,
    Switches,
    UnfitRequestError,
    active,
    parse_settings,
)
from cvtimg.explore.store import KNOWN
from cvtimg.explore.tabs import TABS
from cvtimg.explore.tabs.base import Tab
from cvtimg.options import options_of, record


def settings_of(text: str) -> Json:
    """Return the tab and the settings of a command, and which of its options the page does not have.

    Raises
    ------
    UnfitRequestError
        If the text is no command of cvtimg that the page has a tab for, or a value is not allowed.
    """
    try:
        program, verb, *words = shlex.split(text.strip().removeprefix("$ "))
    except ValueError as error:
        raise UnfitRequestError(f"the command cannot be read: {error}") from error
    tab = next((tab for tab in TABS.values() if tab.verb == verb), None)
    if program != "cvtimg" or tab is None:
        raise UnfitRequestError(f"no tab of this page is for {program} {verb}")
    settings: Json = {}
    # Switches first: what others mean may hang on them.
    given = sorted(_options(verb, words), key=lambda option: option[1] != "")
    is_numbered = any(flag == "-k" for flag, _ in given)
    left = [flag for flag, value in given if not _taken(tab, flag, value, settings, is_numbered)]
    parse_settings(tab.controls, settings)
    return {"tab": tab.name, "settings": settings, "left": left}


def _options(verb: str, words: list[str]) -> Iterator[tuple[str, str]]:
    """Yield the options of a command by their first names, with their values; "" for switches."""
    known = {word: option for option in options_of(verb) for words in option.words for word in words.split("/")}
    rest = iter(words)
    for word in rest:
        name, is_joined, value = word.partition("=")
        option = known.get(name)
        if option is None:
            if name.startswith("--"):
                yield name, value
            continue  # an input
        if isinstance(option.kind, record.Switch):
            yield name, ""
        else:
            value = value if is_joined else next(rest, "")
            if option.role != "writes":
                yield option.flag, value


def _taken(tab: Tab, flag: str, text: str, settings: Json, is_numbered: bool) -> bool:
    """Put an option into settings, with what it needs of other controls; return whether the page has it."""
    known = {control.name: control for control in tab.controls}
    aim = known.get("aim")
    if isinstance(aim, Choice) and (flag, text) == ("-k", "auto"):
        settings["aim"] = "auto"
        return True
    value: Any
    fitting: list[Control]
    if flag == "--palette" and text in KNOWN and "palette" in known:
        fitting, value = [known["palette"]], [text]
    else:
        fitting = [control for control in tab.controls if flag in _flags(control)]
        if flag == "--objects" and is_numbered:
            fitting = fitting[-1:]  # pieces of so many segments
        value = _value(fitting[0], flag, text, settings) if fitting else None
    if not fitting:
        return False
    in_effect = active(tab.controls, parse_settings(tab.controls, settings))
    control = next((control for control in fitting if control in in_effect), fitting[0])
    settings[control.name] = value
    _bring_into_effect(control, known, settings)
    return True


def _flags(control: Control) -> list[str]:
    return [f"--{name}" for name in control.choices] if isinstance(control, Switches) else [control.flag]


def _value(control: Control, flag: str, text: str, settings: Json) -> Any:
    """Return what the page would send for the text of an option."""
    if isinstance(control, Switches):
        return flag[2:]
    if isinstance(control, Switch):
        return not control.default
    if isinstance(control, Several):
        return [*settings.get(control.name, []), text]
    if isinstance(control, Number) and text != "auto":
        try:
            return float(text.removesuffix(control.suffix))
        except ValueError as error:
            raise control.refuse(text, "a number") from error
    return text


def _bring_into_effect(control: Control, known: dict[str, Control], settings: Json) -> None:
    for name, values in control.when.items():
        if settings.get(name, known[name].default) not in values:
            settings[name] = values[0]
        _bring_into_effect(known[name], known, settings)
