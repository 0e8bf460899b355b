"""Settings of tabs that a person has named, in a file of theirs."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path

from cvtimg._shared.choices import Json, Options
from cvtimg.explore.controls import Edits, Entry, Files, UnfitRequestError, parse_settings
from cvtimg.explore.tabs import TABS
from cvtimg.files.whole import write_whole


def presets() -> Json:
    """Return the tab and the settings of each preset by its name."""
    with suppress(OSError, ValueError, AttributeError, TypeError):
        kept = json.loads(_file().read_text())
        return {name: {"tab": each["tab"], "settings": dict(each["settings"])} for name, each in kept.items()}
    return {}


def change_presets(asked: Options) -> Json:
    """Keep the settings of a tab under a name, or forget those of a name if there are none; return all presets."""
    name = Entry(name="name", label="Name", default="").parse(asked.get("name"))
    kept, settings = presets(), asked.get("settings")
    kept.pop(name, None)
    if settings is not None:
        tab = TABS.get(str(asked.get("tab")))
        if tab is None:
            raise UnfitRequestError("there is no such tab")
        parse_settings(tab.controls, settings)
        # What is drawn on a picture, and files that were sent, belong to this one.
        of_picture = {control.name for control in tab.controls if isinstance(control, (Edits, Files))}
        kept[name] = {"tab": tab.name, "settings": {key: settings[key] for key in settings.keys() - of_picture}}
    _file().parent.mkdir(parents=True, exist_ok=True)
    write_whole(_file(), json.dumps(kept, indent=1).encode(), overwrite=True)
    return kept


def _file() -> Path:
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config", "cvtimg", "presets.json")
