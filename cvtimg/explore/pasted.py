"""Settings that come from elsewhere: a command that is pasted, and those that a person has named, in a file."""

import json
import os
import shlex
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from cvtimg._shared.choices import Json, Options
from cvtimg.explore import controls
from cvtimg.explore.tabs import TABS
from cvtimg.explore.tabs.base import Tab
from cvtimg.files.whole import write_whole
from cvtimg.options import options_of, record


def settings_of(text: str) -> Json:
    """Return the tab and the settings of a command, and which of its options the page does not have.

    Of several lines the last counts, and what its tab knows of those before it. Of several tabs that show the command,
    the one counts that has most of its options.

    Raises
    ------
    UnfitRequestError
        If the text is no command of cvtimg that the page has a tab for, or a value is not allowed.
    """
    try:
        *before, (program, verb, *words) = [shlex.split(line.removeprefix("$ ")) for line in text.strip().splitlines()]
    except ValueError as error:
        raise controls.UnfitRequestError(f"the command cannot be read: {error}") from error
    tabs = [tab for tab in TABS.values() if verb in (tab.verb, *tab.verbs)]
    if program != "cvtimg" or not tabs:
        raise controls.UnfitRequestError(f"no tab of this page is for {program} {verb}")
    known = [line for line in before if line[:1] == ["cvtimg"] and line[1:2] in ([tab.verb] for tab in TABS.values())]
    earlier = [(f"{line[1]} {flag}", value) for line in known for flag, value in _options(line[1], line[2:])]
    # Switches first, and what is repeated last: what others mean may hang on them.
    repeated = {option.flag for option in options_of(verb) if option.many and option.words}
    options = sorted(_options(verb, words), key=lambda option: (option[1] != "", option[0] in repeated))
    answers, refusals = list[Json](), list[controls.UnfitRequestError]()
    is_numbered = any(flag == "-k" for flag, _ in options)
    for tab in tabs:
        settings: Json = {}
        try:
            for flag, text in earlier:
                settings |= tab.pasted(flag, text)
            left = [flag for flag, text in options if not _taken(tab, flag, text, settings, is_numbered)]
            controls.parse_settings(tab.controls, settings)
            answers.append({"tab": tab.name, "settings": settings, "left": left})
        except controls.UnfitRequestError as error:
            refusals.append(error)
    if not answers:
        raise refusals[0]
    return min(answers, key=lambda answer: len(answer["left"]))


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
            continue
        value = value if is_joined else next(rest, "")
        if isinstance(option.kind, record.Pair):
            value = f"{value} {next(rest, '')}"
        if option.role != "writes":
            yield option.flag, value


def _taken(tab: Tab, flag: str, text: str, settings: Json, is_numbered: bool) -> bool:
    """Put an option into settings, with what it needs of other controls; return whether the page has it."""
    known = {control.name: control for control in tab.controls}
    if said := tab.pasted(flag, text):
        settings |= {**said, **settings}  # what is usual with it is not what is said
        for name in said:
            _bring_into_effect(known[name], known, settings)
        return True
    fitting = [control for control in tab.controls if flag in _flags(control)]
    if flag == "--objects" and is_numbered:
        fitting = fitting[-1:]  # pieces of so many segments
    if not fitting:
        return False
    in_effect = controls.active(tab.controls, controls.parse_settings(tab.controls, settings))
    control = next((control for control in fitting if control in in_effect), fitting[0])
    settings[control.name] = _value(control, flag, text, settings)
    _bring_into_effect(control, known, settings)
    return True


def _flags(control: controls.Control) -> list[str]:
    if isinstance(control, controls.Brushed):  # whose files belong to one picture
        return []
    return [f"--{name}" for name in control.choices] if isinstance(control, controls.Switches) else [control.flag]


def _value(control: controls.Control, flag: str, text: str, settings: Json) -> Any:
    """Return what the page would send for the text of an option."""
    if isinstance(control, controls.Switches):
        return flag[2:]
    if isinstance(control, controls.Switch):
        return not control.default
    if isinstance(control, controls.Table):
        cells = zip(control.columns, text.split(",", len(control.columns) - 1), strict=False)
        row = [_value(column, flag, cell, settings) for column, cell in cells]
        return [*settings.get(control.name, []), row]
    if isinstance(control, controls.Several):
        return [*settings.get(control.name, []), text]
    if isinstance(control, controls.Number) and text != "auto":
        return controls.number(text.removesuffix(control.suffix))
    return text


def _bring_into_effect(control: controls.Control, known: dict[str, controls.Control], settings: Json) -> None:
    for name, values in control.when.items():
        if settings.get(name, known[name].default) not in values:
            settings[name] = values[0]
        _bring_into_effect(known[name], known, settings)


def presets() -> Json:
    """Return the tab and the settings of each preset by its name."""
    with suppress(OSError, ValueError, AttributeError, TypeError):
        kept = json.loads(_file().read_text())
        return {name: {"tab": each["tab"], "settings": dict(each["settings"])} for name, each in kept.items()}
    return {}


def change_presets(asked: Options) -> Json:
    """Keep the settings of a tab under a name, or forget those of a name if there are none; return all presets."""
    name = controls.Entry(name="name", label="Name", default="").parse(asked.get("name"))
    kept, settings = presets(), asked.get("settings")
    kept.pop(name, None)
    if settings is not None:
        tab = TABS.get(str(asked.get("tab")))
        if tab is None:
            raise controls.UnfitRequestError("there is no such tab")
        controls.parse_settings(tab.controls, settings)
        # What is drawn on a picture, and files that were sent, belong to this one.
        of_picture = {control.name for control in tab.controls if isinstance(control, (controls.Edits, controls.Files))}
        kept[name] = {"tab": tab.name, "settings": {key: settings[key] for key in settings.keys() - of_picture}}
    _file().parent.mkdir(parents=True, exist_ok=True)
    write_whole(_file(), json.dumps(kept, indent=1).encode(), overwrite=True)
    return kept


def _file() -> Path:
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config", "cvtimg", "presets.json")
