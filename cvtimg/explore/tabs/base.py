"""What a tab of the page is: its controls, and a function from settings to a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cvtimg.explore.controls import Control, Settings, UnfitRequestError, active, words_of
from cvtimg.explore.layers import Window
from cvtimg.explore.opened import Picture
from cvtimg.explore.outcomes import Outcome, Output, Recipe, quoted, safe_name

__all__ = ["OpenFiles", "Request", "Tab", "reading", "saved"]


@dataclass(frozen=True, slots=True, eq=False)
class OpenFiles:
    """What is open beside the picture itself: other pictures, and palettes by their names."""

    pictures: Mapping[str, Picture]
    palettes: Mapping[str, tuple[str, NDArray[np.uint8]]]

    def picture(self, key: str) -> Picture:
        """Return an open picture."""
        if key not in self.pictures:
            raise UnfitRequestError("this image is no longer open; open it again")
        return self.pictures[key]

    def palette(self, keys: Sequence[str]) -> tuple[str, NDArray[np.uint8]]:
        """Return the name and the colors of the palette that was chosen."""
        if not keys:
            raise UnfitRequestError("open a palette file first")
        if keys[0] not in self.palettes:
            raise UnfitRequestError("this palette is no longer open; open it again")
        return self.palettes[keys[0]]


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """What a tab is asked for."""

    opened: Picture | None  # The picture that is shown; None for tabs that need none
    settings: Settings  # Values of all controls of the tab
    files: OpenFiles  # What else is open
    window: Window  # The part that a draft has to show

    @property
    def picture(self) -> Picture:
        """The picture that is shown."""
        if self.opened is None:
            raise UnfitRequestError("open an image first")
        return self.opened

    @property
    def stem(self) -> str:
        """Name of the picture without suffix, which names of files begin with."""
        return self.opened.stem if self.opened else ""


class Tab:
    """A tab of the page."""

    # Its name in requests and on the page, and a line that says what it is for.
    name: ClassVar[str]
    title: ClassVar[str]
    about: ClassVar[str]
    verb: ClassVar[str]  # The command
    controls: ClassVar[tuple[Control, ...]]  # What can be chosen
    # (int, int): height and width of the drawing, for tabs that need no picture.
    sheet: ClassVar[tuple[int, int] | None] = None
    tool: ClassVar[str] = ""  # What the page lets a person do on the result, by its name there

    def recipe(self, request: Request) -> Recipe:
        """Return the command and the lines of Python that make the result."""
        raise NotImplementedError

    def outputs(self, request: Request) -> Sequence[Output]:
        """Return the files that the result can be saved as, the main one first."""
        raise NotImplementedError

    def draft_pixels(self, settings: Settings) -> int:
        """Return how many pixels a draft has at most: as many as are shown while a control moves."""
        return 1 << 20

    def draft(self, request: Request) -> Outcome | None:
        """Return what can be shown at once; None if nothing can."""
        return None

    def exact(self, request: Request) -> Outcome:
        """Return the result."""
        raise NotImplementedError

    def words(self, request: Request, *more: str) -> list[str]:
        """Return the words of the command: the picture, `more`, and what the controls say; without outputs."""
        inputs = [] if self.sheet else [safe_name(request.picture.name)]
        return ["cvtimg", self.verb, *inputs, *more, *words_of(self.controls, request.settings)]

    def keywords(self, settings: Settings) -> dict[str, Any]:
        """Return the keyword arguments that controls in effect say by themselves and that are not the default."""
        counted = [control for control in active(self.controls, settings) if control.keyword]
        return {one.keyword: settings[one.name] for one in counted if settings[one.name] != one.default}

    def in_effect(self, settings: Settings) -> set[str]:
        """Return the names of the controls that are in effect."""
        return {control.name for control in active(self.controls, settings)}

    def described(self) -> dict[str, Any]:
        """Return what the page needs to draw the tab."""
        about = {
            "name": self.name,
            "title": self.title,
            "about": self.about,
            "sheet": self.sheet,
            "tool": self.tool,
            "verb": self.verb,
        }
        return {**about, "controls": [control.described() for control in self.controls]}


def reading(picture: Picture) -> str:
    """Write in Python that the picture is read."""
    return f"import cvtimg\n\nimage = cvtimg.read_image({quoted(picture.name)})"


def saved(result: Any, path: Path) -> None:
    """Save a result that can save itself."""
    result.save(path)


#: The lines of Python that do the same.
SAVED = "result.save({})"
