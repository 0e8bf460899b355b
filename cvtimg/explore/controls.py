"""Controls of the page: what a person can choose, and how the command line and Python say it.

Most are made from the options of the command (`controls_of`). The page draws them from `Control.described`, the server
checks what it receives by `Control.parse`, and the command that the page shows consists of `Control.words`.
"""

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, TypeAlias

import numpy as np

from cvtimg._shared.choices import Json, Options
from cvtimg._shared.svg import shortest
from cvtimg._shared.types import Bytes
from cvtimg.options import options_of, record
from cvtimg.options.record import Option
from cvtimg.segmentation import Edit, brush

#: Values of the controls of a tab by name, checked.
Settings: TypeAlias = Options


class UnfitRequestError(Exception):
    """A request that cannot be answered; the message tells the person why."""


def understood(content: str | bytes) -> Json:
    """Return what a page asks for in JSON."""
    try:
        return dict(json.loads(content))
    except (ValueError, TypeError, RecursionError) as error:
        raise UnfitRequestError("this request is not understood") from error


def is_number(value: object) -> bool:
    """Whether a value that the page sent is a finite number."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def number(text: str) -> float:
    """Return the number that a text stands for."""
    try:
        return float(text)
    except ValueError as error:
        raise UnfitRequestError(f"{text[:40]!r} must be a number") from error


#: Letters of a text or a name.
LONGEST_TEXT = 120
#: What the page is not told of a control.
_OWN = ("flag", "keyword", "to", "always", "suffix", "none")


@dataclass(frozen=True, kw_only=True)
class Control:
    """A control of a tab."""

    kind: ClassVar[str] = ""  # What the page draws; by default what the name of the class says
    name: str  # Its name in settings
    label: str  # Its name on the page
    default: Any  # Value that is in effect if nothing is chosen
    flag: str = ""  # Option of the command that says its value; none where the tab says it in another way
    # Argument of the Python function that takes its value, or what `to` makes of it; none where the tab says it in
    # another way.
    keyword: str = ""
    to: Callable[[Any], Any] | None = None
    always: bool = False  # Whether the default is said, too
    # Shown, and in effect, only while other controls have one of these values.
    when: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    about: str = ""  # Explanation shown below the control
    only: str = ""  # "images" or "animations" where it is shown for these alone

    def parse(self, value: object) -> Any:
        raise NotImplementedError

    def says(self, value: object) -> bool:
        """Whether commands and calls must say a value."""
        return self.always or bool(value != self.default)

    def words(self, value: object) -> list[str]:
        """Return the words of the command line for a value; the option is repeated for each of several."""
        if not self.flag or not self.says(value):
            return []
        items = value if isinstance(value, tuple) else (value,)
        return [word for item in items for word in (self.flag, self.text(item))]

    def text(self, value: object) -> str:
        return str(value)

    def described(self) -> Json:
        told = [attribute.name for attribute in fields(self) if attribute.name not in _OWN]
        return {"kind": self.kind or type(self).__name__.lower(), **{name: getattr(self, name) for name in told}}

    def refuse(self, value: object, allowed: str) -> UnfitRequestError:
        return UnfitRequestError(f"{self.label}: {str(value)[:40]!r} must be {allowed}")


@dataclass(frozen=True, kw_only=True)
class Number(Control):
    """A number: a slider for the usual range, and a field for all that is allowed."""

    # The range allowed.
    low: float
    high: float
    slider: tuple[float, float] | None = None  # (float, float): the usual range; by default all that is allowed
    step: float = 1  # Distance of values on the slider; 1 for whole numbers
    log: bool = False  # Whether the slider is logarithmic
    auto: bool = False  # Whether "auto" is allowed
    unit: str = ""  # Shown after the number; on the command line, `suffix` follows it
    suffix: str = ""
    room: float = 0  # Pixels that each of the things counted takes: a picture with less room begins with fewer

    def parse(self, value: Any) -> Any:
        if self.auto and value == "auto":
            return value
        if not is_number(value) or not self.low <= value <= self.high or (self.step == 1 and value != int(value)):
            noun = f"{'auto or ' if self.auto else ''}a {'whole ' if self.step == 1 else ''}number"
            raise self.refuse(value, f"{noun} in {self.low:g}..{self.high:g}")
        return int(value) if self.step == 1 else float(value)

    def text(self, value: Any) -> str:
        return value if value == "auto" else f"{shortest(value)}{self.suffix}"


@dataclass(frozen=True, kw_only=True)
class Choice(Control):
    """One of a few values, by default the first; `choices` has each with its label."""

    default: str = ""
    choices: Mapping[str, str]

    def __post_init__(self) -> None:
        object.__setattr__(self, "default", self.default or next(iter(self.choices)))

    def parse(self, value: object) -> Any:
        if not isinstance(value, str) or value not in self.choices:
            raise self.refuse(value, f"one of {', '.join(self.choices)}")
        return value


@dataclass(frozen=True, kw_only=True)
class Switch(Control):
    """On or off."""

    default: bool = False

    def parse(self, value: object) -> bool:
        if not isinstance(value, bool):
            raise self.refuse(value, "true or false")
        return value

    def words(self, value: object) -> list[str]:
        return [self.flag] if self.flag and value != self.default else []


@dataclass(frozen=True, kw_only=True)
class Several(Control):
    """A list of at most `most` values; on the command line the option is repeated for each."""

    default: tuple[Any, ...] = ()
    most: int = 1000

    def parse(self, value: object) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) > self.most:
            raise self.refuse(value, f"a list of at most {self.most} {self.label.lower()}")
        return tuple(map(self.parse_one, value))

    def parse_one(self, value: object) -> Any:
        if not isinstance(value, str) or len(value) > LONGEST_TEXT:
            raise self.refuse(value, "a short text")
        return value


@dataclass(frozen=True, kw_only=True)
class Swatches(Several):
    """Colors as #rrggbb in an order of their own, which the page edits in the result."""

    def parse_one(self, value: object) -> str:
        if not isinstance(value, str) or not re.fullmatch("#[0-9a-fA-F]{6}", value):
            raise self.refuse(value, "a color as #rrggbb")
        return value.lower()


@dataclass(frozen=True, kw_only=True)
class Colors(Swatches):
    """Colors, each once."""

    def parse(self, value: object) -> tuple[Any, ...]:
        return tuple(dict.fromkeys(Swatches.parse(self, value)))


@dataclass(frozen=True, kw_only=True)
class Entry(Control):
    """A short text on one line."""

    def parse(self, value: object) -> str:
        if not isinstance(value, str) or not value.strip() or len(value) > LONGEST_TEXT or not value.isprintable():
            raise self.refuse(value, f"a text of 1..{LONGEST_TEXT} letters")
        return value.strip()


@dataclass(frozen=True, kw_only=True)
class Table(Several):
    """Rows of numbers and texts, which the command line writes with commas between them."""

    #: Columns: numbers, whose slider range is not used, and texts.
    columns: tuple[Number | Entry, ...]
    adds: str = "Add"  # What the button that adds a row says

    def parse_one(self, value: object) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) != len(self.columns):
            raise self.refuse("rows", f"lists of {len(self.columns)} values each")
        return tuple(column.parse(cell) for column, cell in zip(self.columns, value, strict=True))

    def text(self, value: Any) -> str:
        return ",".join(
            column.text(cell) if isinstance(column, Number) else re.sub(r"\s*([,|])\s*", r"\1", cell)
            for column, cell in zip(self.columns, value, strict=True)
        )

    def described(self) -> Json:
        return {**Control.described(self), "columns": [column.described() for column in self.columns]}


@dataclass(frozen=True, kw_only=True)
class Edits(Several):
    """Changes that are made on the picture, as texts in their order."""

    modes: Mapping[str, str]  # What the page offers, with its labels

    def parse_one(self, value: Any) -> str:
        try:
            Edit.parse(value)
        except (ValueError, TypeError, AttributeError) as error:
            raise UnfitRequestError(f"{self.label}: {error}") from error
        return str(value)


@dataclass(frozen=True, kw_only=True)
class Brushed(Edits):
    """A gray image of the size of the picture that is drawn on it by a brush, and that the command reads."""

    kind = "edits"
    values: Mapping[str, int]  # What each mode paints
    base: int  # Value where nothing is painted

    @property
    def pattern(self) -> str:
        """Name of its file, with ``{}`` for the name of the picture without suffix."""
        return f"{{}}-{self.name}.png"

    def words(self, value: object) -> list[str]:
        """Return nothing: the name of the file is known elsewhere."""
        return []

    def drawn(self, strokes: Sequence[str], size: tuple[int, int]) -> Bytes:
        image = np.full(size, self.base, np.uint8)
        for stroke in map(Edit.parse, strokes):
            brush(image, stroke.points, stroke.radius, self.values.get(stroke.kind, self.base))
        return image


@dataclass(frozen=True, kw_only=True)
class Files(Several):
    """Files that the page has sent before, by the keys that the server gave them; `Store` knows which are open."""

    of: str = "pictures"  # What they are
    most: int = 1  # How many can be chosen


@dataclass(frozen=True, kw_only=True)
class Switches(Choice):
    """One of several switches of the command, each by its name, or none of them."""

    kind = "choice"
    none: str  # The choice that is no switch

    def words(self, value: object) -> list[str]:
        return [] if value == self.none else [f"--{value}"]


def controls_of(verb: str, *listed: Control | str | tuple[str, Json]) -> tuple[Control, ...]:
    """Return controls of a verb: own ones as they are, and those of options by name, with what differs from the record.

    An option is in effect where the page chooses what it needs, and nothing that it excludes.
    """
    known = {option.name: option for option in options_of(verb)}
    made: list[Control] = []
    for item in listed:
        if isinstance(item, Control):
            made.append(item)
            continue
        name, changed = item if isinstance(item, tuple) else (item, {})
        control = _control_of(known[name], changed)
        made.append(replace(control, when={**_when(known[name], made), **control.when}))
    return tuple(made)


def _control_of(option: Option, changed: Options) -> Control:
    page, kind = option.page, option.kind
    assert page is not None, option.name
    default = page.get("default", option.parse(None))
    about: Json = {"name": option.name, "default": default, "flag": option.flag, "keyword": option.keyword}
    of: type[Control]
    if isinstance(kind, record.Switch):
        of, about["flag"] = Switch, option.words[-1].rpartition("/")[2] if default else option.flag
    elif isinstance(kind, record.Choice):
        of, about["choices"] = Choice, kind.labeled
    elif isinstance(kind, record.Text) and kind.labels:
        of, about["choices"], about["to"] = Choice, kind.labels, kind.parse
    elif isinstance(kind, record.Text) and isinstance(default, str) and default != "auto":
        of, about["to"] = Entry, kind.parse
    else:
        of = Number
        about |= _range_of(kind, page, default)
        about["auto"] = default == "auto" or getattr(kind, "auto", False)
        about["always"] = option.default is None and default != "auto"
    return of(**{**about, **page, **changed})


def _range_of(kind: record.Kind, page: Options, default: object) -> Json:
    """Return what may be typed, and how finely the slider goes: where the option does not say, by the usual range."""
    real, is_length = kind if isinstance(kind, record.Real) else record.Real(), isinstance(kind, record.Text)
    least, greatest = page.get("slider", (real.low, real.high))
    whole = isinstance(kind, record.Whole) or (is_length and isinstance(default, int))
    return {
        "low": real.low if real.low > real.above else least / 100,
        "high": real.high if real.high < math.inf else 100 * greatest,
        "step": 1 if whole else min(0.5, 10.0 ** math.floor(math.log10((greatest - least) / 50))),
        "suffix": page.get("unit", "") if is_length else "",
    }


def _when(option: Option, others: Sequence[Control]) -> dict[str, Sequence[Any]]:
    when: dict[str, Sequence[Any]] = {}
    for need in option.needs:
        name, _, value = need.partition("=")
        for other in others:
            if isinstance(other, Switches) and name in other.choices:
                when[other.name] = [name]
            elif isinstance(other, Choice) and other.name == name:
                when[name] = [value] if value else [choice for choice in other.choices if choice != other.default]
    for name in option.excludes:
        for other in others:
            if isinstance(other, Switches) and name in other.choices:
                when[other.name] = [choice for choice in when.get(other.name, list(other.choices)) if choice != name]
    return when


def parse_settings(controls: Iterable[Control], given: object) -> Settings:
    """Check settings that the page sent: all controls get a value."""
    if not isinstance(given, dict):
        raise UnfitRequestError("settings must be an object")
    known = {control.name: control for control in controls}
    if unknown := [name for name in given if name not in known]:
        raise UnfitRequestError(f"there is no setting {str(unknown[0])[:40]!r}")
    return {name: control.parse(given[name]) if name in given else control.default for name, control in known.items()}


def active(controls: Iterable[Control], settings: Settings) -> list[Control]:
    """Return the controls that are in effect: all that theirs depends on has the value it must have."""
    known = {control.name: control for control in controls}

    def counts(control: Control) -> bool:
        return all(settings[name] in values and counts(known[name]) for name, values in control.when.items())

    return [control for control in known.values() if counts(control)]


def words_of(controls: Iterable[Control], settings: Settings) -> list[str]:
    """Return the words of the command line for the controls that are in effect."""
    return [word for control in active(controls, settings) for word in control.words(settings[control.name])]
