"""What a tab of the page is: its controls, and a function from settings to a result."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from cvtimg._shared.budgets import ROWS_AT_ONCE
from cvtimg._shared.choices import Json, Options
from cvtimg._shared.messages import reworded
from cvtimg._shared.types import Array
from cvtimg.explore.controls import Brushed, Control, Number, Settings, Switch, UnfitRequestError, active, words_of
from cvtimg.explore.layers import Layer, Window
from cvtimg.explore.opened import Picture
from cvtimg.explore.outcomes import Code, Line, Outcome, Output, Recipe, call, evaluated, run, safe_name
from cvtimg.explore.store import Store

#: Units of pixels, by the power of their length.
_POWERS = {"px": 1, "px²": 2}


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """What a tab is asked for."""

    opened: Picture | None  # The picture that is shown; None for tabs that need none
    settings: Settings  # Values of all controls of the tab
    store: Store  # What else is open
    window: Window  # The part that a draft has to show
    is_whole: bool = False  # Whether all frames are wanted if the picture is one of several
    step: int = 1  # Every how many pixels are used, for a draft

    @property
    def source(self) -> Picture:
        """What the command reads: the picture, or the file of which it is a frame."""
        return (self.picture.whole_file if self.is_whole else None) or self.picture

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of the pixels that are used."""
        return -(-self.picture.size[0] // self.step), -(-self.picture.size[1] // self.step)

    @property
    def picture(self) -> Picture:
        if self.opened is None:
            raise UnfitRequestError("open an image first")
        return self.opened

    def every(self, array: Array) -> Array:
        """Return the pixels of an array that are used."""
        return array[:: self.step, :: self.step] if self.step > 1 else array  # that of a file with alpha says so

    @property
    def stem(self) -> str:
        """Name of the picture without suffix, which names of files begin with."""
        return self.source.stem if self.opened else ""


class Tab:
    """A tab of the page."""

    name: ClassVar[str]  # In requests, and capitalized on the page: that of the class
    about: ClassVar[str]  # A line that says what it is for
    verb: ClassVar[str] = ""  # The command, by default of the same name
    verbs: ClassVar[tuple[str, ...]] = ()  # Other commands that the tab shows
    controls: ClassVar[tuple[Control, ...]]  # What can be chosen
    # (int, int): height and width of the drawing, for tabs that need no picture.
    sheet: ClassVar[tuple[int, int] | None] = None
    most_drafted: ClassVar[int] = ROWS_AT_ONCE  # Pixels, or what else a tab makes, of a draft: what is quickly made
    # Seconds that a unit of `work` takes until there has been a result: of 12 megapixels, on two cores of an EPYC.
    pace: ClassVar[float] = 0.1
    for_frames: ClassVar[bool] = False  # Whether the result is of all frames of an animation, or pages of a file
    arguments: ClassVar[Mapping[str, str]] = {}  # Names of controls by those of arguments that they say otherwise
    compared: ClassVar[Code] = Code()  # The image that lossy files hold, and others are compared with
    tool: ClassVar[str] = ""  # What the page lets a person do on the result, by its name there

    def __init_subclass__(cls) -> None:
        cls.name = cls.__name__.removesuffix("Tab").lower()
        cls.verb = cls.verb or cls.name

    def lines(self, request: Request) -> list[Line]:
        """Return the lines of Python that make the result, which are run as they are shown."""
        raise NotImplementedError

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        """Return what the page shows of the values of these lines: a layer, and facts."""
        raise NotImplementedError

    def run(self, request: Request) -> Json:
        return run(self.lines(request))

    def outputs(self, request: Request) -> Sequence[Output]:
        """Return the files that the result can be saved as, the main one first."""
        raise NotImplementedError

    def recipe(self, request: Request) -> Recipe:
        """Return the command and the lines of Python that make the result."""
        return Recipe(self.words(request), self.lines(request), for_many=not self.sheet)

    def draft_pixels(self, settings: Settings) -> int:
        """Return how many pixels of the picture are shown at most while a control moves."""
        return ROWS_AT_ONCE

    def draft(self, request: Request) -> Outcome | None:
        """Return what can be shown at once, by default the result of a part of the pixels; None if nothing can."""
        window = request.window if self.sheet else request.picture.whole(self.most_drafted)
        small = replace(request, step=window.step)
        small = replace(small, settings=self.scaled(small))
        if window.step == 1 and small.settings == request.settings:
            return None
        return Outcome(*self.seen(small, self.run(small)), drawn=window)

    def work(self, request: Request, outcome: Outcome | None) -> float:
        """Return how much there is to do for a result, by default its megapixels, as far as a draft or it has told."""
        return math.prod(request.size) / 1e6 if request.opened else 0.0

    def scaled(self, request: Request) -> Settings:
        """Return the settings of a draft: little effort, and lengths, areas and numbers shrink with the picture."""
        settings = {**request.settings, "effort": "fast"} if "effort" in request.settings else {**request.settings}
        for control in self.controls:
            value = settings[control.name]
            if not isinstance(control, Number) or value == "auto":
                continue
            if control.unit in _POWERS:
                value /= request.step ** _POWERS[control.unit]
            elif control.room:
                value = min(value, math.prod(request.size) // (4 * control.room))
            settings[control.name] = max(control.low, round(value) if control.step == 1 else value)
        return settings

    def exact(self, request: Request) -> Outcome:
        values = self.run(request)
        outcome = Outcome(*self.seen(request, values), values, self.outputs(request), request.stem)
        if self.compared and not request.source.frames:
            outcome.image = evaluated(self.compared, values)
        return outcome

    def pasted(self, flag: str, text: str) -> Json:
        """Return the settings that a word of a command says which no control has; nothing for what the page lacks."""
        return {}

    def words(self, request: Request, *more: str) -> list[str]:
        """Return the words of the command: the picture, `more`, and what the controls say; without outputs."""
        inputs = [] if self.sheet else request.source.words
        files = {brush.flag: brush.pattern.format(request.stem) for brush in self.brushed(request)}
        maps = [word for flag, name in files.items() for word in (flag, safe_name(name))]
        return ["cvtimg", self.verb, *inputs, *more, *words_of(self.controls, request.settings), *maps]

    def brushed(self, request: Request) -> list[Brushed]:
        """Return the controls by which something is drawn by brush."""
        controls = active(self.controls, request.settings)
        return [brush for brush in controls if isinstance(brush, Brushed) and request.settings[brush.name]]

    def maps(self, request: Request) -> list[Line]:
        """Return the lines that read the (H, W) images that are drawn by brush."""
        lines = []
        for brush in self.brushed(request):
            drawn = brush.drawn(request.settings[brush.name], request.picture.size)
            read = call("cvtimg.read_image", brush.pattern.format(request.stem))
            lines.append(Line(brush.name, read, request.every(drawn)))
        return lines

    def map_files(self, request: Request) -> list[Output]:
        """Return the files of these images, which the command reads."""
        return [
            Output(f"{one.label}, PNG", one.flag, one.pattern, WRITE_IMAGE, (Code(one.name),), read=True)
            for one in self.brushed(request)
        ]

    def keywords(self, settings: Settings) -> Json:
        """Return the keyword arguments that controls in effect say by themselves and that are not the default."""
        return {
            control.keyword: control.to(value) if control.to else value
            for control in active(self.controls, settings)
            if control.keyword and control.says(value := settings[control.name])
        }

    def in_effect(self, settings: Settings) -> set[str]:
        return {control.name for control in active(self.controls, settings)}

    def worded(self, message: str) -> str:
        """Return a message of the library in the words of the page: labels of controls for names of arguments."""
        labels = {control.name: control.label for control in self.controls}
        labels |= {control.keyword: control.label for control in self.controls if control.keyword}
        labels |= {argument: labels[name] for argument, name in self.arguments.items()}
        return reworded(message, labels, ": ")

    def described(self) -> Json:
        told = {name: getattr(self, name) for name in ("name", "about", "sheet", "tool")}
        return {**told, "title": self.name.title(), "controls": [control.described() for control in self.controls]}


#: The controls by which parts of the picture are left out by a brush.
BRUSH = Switch(name="brushes", label="Mask", about="Drawn by a brush. The command reads the file; save it, too.")
MASK = Brushed(
    name="mask",
    label="Mask",
    flag="--mask",
    modes={"erase": "Leave out", "add": "Take back"},
    values={"erase": 0, "add": 255},
    base=255,
    when={"brushes": [True]},
)
IMAGE = Code("image")
WRITE_IMAGE = "cvtimg.write_image"


def reading(request: Request) -> Line:
    """Return the line by which the picture is read."""
    return Line("image", request.picture.python, request.every(request.picture.array))


def visible(request: Request, mask: Sequence[Line] = ()) -> tuple[list[Line], Json]:
    """Return the lines that read a picture without its transparency, and the argument that leaves out what is hidden.

    That is what is transparent, has no value, or is left out by the mask that a line reads.
    """
    picture = request.picture
    known = [*missing(picture), *([Code("image[..., 3] > 0")] if picture.has_alpha else [])]
    whole = all_of([*known, *(Code("mask > 0") for _ in mask)])
    rgb = [Line("image", Code("image[..., :3]"))] if picture.declares_alpha else []
    return [reading(request), *mask, *whole, *rgb], {"mask": Code("known")} if whole else {}


def all_of(conditions: Sequence[Code]) -> list[Line]:
    """Return the line that says for which pixels all conditions hold; none for no condition."""
    several = [f"({condition})" for condition in conditions] if len(conditions) > 1 else conditions
    return [Line("known", Code(" & ".join(several)))] if conditions else []


def missing(picture: Picture) -> list[Code]:
    """Return which pixels are no missing values, if a value of the file stands for these."""
    nodata = picture.header.nodata
    if nodata is None or not math.isfinite(nodata) or picture.known is None:
        return []
    return [Code(f"(image.reshape(*image.shape[:2], -1) != {nodata}).any(axis=2)")]
