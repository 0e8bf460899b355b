"""The record of an option: what values it takes, its default, its help, and what it needs and excludes.

The parameters of the command line (`cvtimg.cli.commands`), the controls of the page (`cvtimg.explore.controls`) and the
commands that the page shows are made from these records.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial, reduce
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple, Self, TypeAlias

from cvtimg._shared.choices import Arguments, Options
from cvtimg._shared.extras import needs
from cvtimg._shared.messages import reworded
from cvtimg.batch.pipes import STANDARD
from cvtimg.batch.plans import check_suffix
from cvtimg.batch.report import reason
from cvtimg.batch.tasks import WrongUsageError


class Real(NamedTuple):
    """A finite number in low..high that is greater than `above`; or "auto", or a size with a unit, where allowed."""

    low: float = -math.inf
    high: float = math.inf
    above: float = -math.inf
    auto: bool = False
    sized: bool = False

    def parse(self, text: Any) -> Any:
        """Return the number that a text stands for, or the size, a `PixelSize`."""
        if self.auto and text == "auto":
            return text
        with suppress(ValueError, OverflowError):
            value = self._read(text)
            if math.isfinite(value) and self.low <= value <= self.high and value > self.above:
                return value
        if self.sized and str(text)[-1:].isalpha():
            from cvtimg.pictures.formats.pixel_size import PixelSize

            return PixelSize.parse(text)
        raise ValueError(f"{str(text)!r} must be {'auto or ' if self.auto else ''}{self._allowed()}")

    def _read(self, text: Any) -> float:
        return float(text)

    def _allowed(self) -> str:
        if self.above > -math.inf:
            return f"a number > {self.above:g}" + (f" and at most {self.high:g}" if self.high < math.inf else "")
        if self.low == -math.inf:
            return "a number"
        return f"a number in {self.low:g}..{self.high:g}" if self.high < math.inf else f"a number >= {self.low:g}"


class Whole(Real):
    """A whole number in low..high, by default the greatest of 32 bits, or "auto" where that is allowed."""

    __slots__ = ()

    def __new__(cls, low: int, high: int = 2**31 - 1, *others: Any, **more: Any) -> Self:
        """Make the kind of a count, or of a number of something."""
        return super().__new__(cls, low, high, *others, **more)

    def _read(self, text: Any) -> int:
        return int(text)

    def _allowed(self) -> str:
        return f"a whole number in {self.low}..{self.high}"


class Choice(NamedTuple):
    """One of a few names; the page shows those in `labels`, or in `names` where that is a mapping, by their labels."""

    names: Collection[str]
    labels: Mapping[str, str] = {}

    @property
    def labeled(self) -> dict[str, str]:
        """What the page shows of each name."""
        labels = self.names if isinstance(self.names, Mapping) else self.labels
        return {name: labels.get(name, name) for name in self.names}

    def parse(self, text: Any) -> Any:
        """Return the name that a text is."""
        if text not in self.names:
            raise ValueError(f"{str(text)!r} must be one of {', '.join(self.names)}")
        return text


class Switch:
    """On or off."""

    def parse(self, value: object) -> bool:
        """Return whether it is on."""
        return bool(value)


class Text(NamedTuple):
    """A text, or what `parse` makes of it; the page offers those in `labels`, by their labels."""

    parse: Callable[[Any], Any] = str
    labels: Mapping[str, str] = {}


class File(NamedTuple):
    """A file; `suffixes` is what its name may end in: a sequence, or a function, so that --help imports little.

    With `standard`, "-" stands for standard output in the format of that suffix, and "FORM:-" for another format.
    """

    suffixes: Sequence[str] | Callable[[], Sequence[str]] = ()
    standard: str = ""

    def parse(self, text: Any) -> Path:
        """Return the path; for standard output one whose suffix is the format."""
        if not self.standard:
            return Path(text)
        form, colon, name = str(text).rpartition(":")
        if str(text) == f"zarr:{STANDARD}":
            raise ValueError("a Zarr array is a folder and cannot go to standard output")
        if name == STANDARD and colon and form.isalnum():
            return Path(f"{STANDARD}.{form}")
        return Path(f"{STANDARD}{self.standard}" if str(text) in (STANDARD, "/dev/stdout") else text)

    @property
    def endings(self) -> Sequence[str]:
        """What names of files may end in; nothing for anything."""
        return self.suffixes() if callable(self.suffixes) else self.suffixes


class Pair(NamedTuple):
    """Two numbers, one after the other."""

    first: Real = Real()
    second: Real = Real()

    def parse(self, texts: Any) -> tuple[float, float]:
        """Return the numbers."""
        first, second = texts
        try:
            return self.first.parse(first), self.second.parse(second)
        except ValueError as error:
            raise ValueError(f"{error}; two are needed, with a space between them") from error


def late(module: str, name: str) -> Callable[..., Any]:
    """Return a function of a module of cvtimg that is imported when it is called, so that --help imports little."""
    return partial(_called, module, name)  # unlike a function in here, it can go to other processes


def _called(module: str, name: str, /, *arguments: Any, **named: Any) -> Any:
    value: Any = import_module(f"cvtimg.{module}")
    return reduce(getattr, name.split("."), value)(*arguments, **named)


Kind: TypeAlias = Real | Choice | Switch | Text | File | Pair


class Option(NamedTuple):
    """An option of a verb."""

    name: str  # Its name among the values that a command gets
    kind: Kind  # What values it takes
    help: str  # Its line in ``--help``
    # How it is written, such as ``"--output -o"``; by default the name after two dashes. "" for the inputs.
    flags: str | None = None
    metavar: str = ""  # What ``--help`` shows for a value; by default what suits its kind
    default: Any = None  # Value where none is given; None for none
    role: str = ""  # Of files that the verb "reads" beside its inputs, or "writes"
    # Whether it must be given, and whether it can be repeated.
    required: bool = False
    many: bool = False
    # Other options without which, or with which, it has no effect: by name, or as ``"name=value"``.
    needs: tuple[str, ...] = ()
    excludes: tuple[str, ...] = ()
    # Argument of the Python function that takes the value, or what `to` makes of it; "" where more is to be done.
    keyword: str = ""
    to: Callable[[Any], Any] | None = None
    # How the page shows it, where it does: fields of its control in `cvtimg.explore.controls`, such as its label, what
    # explains it, the usual range, and limits and a default where these are not those of the command.
    page: Options | None = None

    @property
    def words(self) -> list[str]:
        """How it is written, the long form first; nothing for the inputs."""
        return [f"--{self.name.replace('_', '-')}"] if self.flags is None else self.flags.split()

    @property
    def flag(self) -> str:
        """How messages and commands of the page write it."""
        return self.words[-1].partition("/")[0]

    @property
    def placeholder(self) -> str:
        """What ``--help`` shows for a value; nothing for a switch."""
        if self.metavar or isinstance(self.kind, Switch):
            return self.metavar
        if isinstance(self.kind, Choice):
            return f"<{'|'.join(self.kind.names)}>"
        if isinstance(self.kind, Whole):
            return "N|auto" if self.kind.auto else "N"
        return "FILE" if isinstance(self.kind, File) else "TEXT"

    def on_page(self, label: str, about: str = "", **look: Any) -> Self:
        """Return the option as the page shows it, too."""
        return self._replace(page={"label": label, "about": about, **look})

    def parse(self, given: Any) -> Any:
        """Return the value of what the command line gave, None for nothing; the default is converted, too."""
        if given is None or (self.many and not given):
            given = self.default
        if given is None:
            return None
        if "" in (given if self.many else [given]):  # of a shell's variable that is not set
            raise ValueError("an empty text is no value; the current folder is '.'")
        return [self.kind.parse(item) for item in given] if self.many else self.kind.parse(given)

    def is_given(self, value: object) -> bool:
        """Whether a value differs from the default."""
        return value is not None and value != [] and value != self.parse(None)


def passed(name: str, kind: Kind, help: str, flags: str | None = None, **more: Any) -> Option:
    """Return an option whose value is an argument of the Python function of the same name, as it is."""
    return Option(name, kind, help, flags, keyword=name, **more)


class Given(SimpleNamespace):
    """The values of all options of a verb, as attributes."""

    #: What was typed.
    command: str
    #: All options by their names, and those that are arguments of the Python function by their names there.
    options: Mapping[str, Option]
    keywords: Mapping[str, Option]

    def chosen(self, *names: str) -> list[str]:
        """Return how those of some options are written that have another value than the default."""
        return [self.options[name].flag for name in names if self.options[name].is_given(getattr(self, name))]

    def worded(self, message: str) -> str:
        """Return a message about arguments of the Python function in the words of the command line."""
        options = {**self.options, **self.keywords}
        if "superpixels" in options:  # -k is the number of whatever segments there are
            options |= dict.fromkeys(("n_segments", "n_regions", "n_superpixels"), options["number"])
        return reworded(message, {name: option.flag for name, option in options.items() if option.words}, " ")

    def condition(self, text: str) -> str:
        """Return an argument, such as ``optimize`` or ``n_colors='auto'``, in the words of the command line."""
        option = self.keywords[text.partition("=")[0]]
        by_default = "" if option.is_given(getattr(self, option.name)) else ", the default here,"
        return (self.worded(text) if "=" in text else option.flag) + by_default

    @property
    def arguments(self) -> Arguments:
        """The arguments of the Python function by their names there; those not given are left out."""
        values = {keyword: self._argument(option) for keyword, option in self.keywords.items()}
        return {keyword: value for keyword, value in values.items() if value is not None}

    def _argument(self, option: Option) -> Any:
        value = getattr(self, option.name)
        if not option.to or value is None or (option.many and not value):
            return value
        try:
            return option.to(value)
        except (OSError, ValueError) as error:  # of a file that all inputs need
            raise WrongUsageError(f"{option.flag}: {value}: {reason(value, error)}") from error


def collected(options: Iterable[Option], values: Options) -> Given:
    """Check values together: what options need and exclude, and what names of files end in.

    Raises
    ------
    WrongUsageError
        The message names the options as the command line does.
    """
    known = {option.name: option for option in options}
    given = [option for option in known.values() if option.is_given(values[option.name])]

    def holds(condition: str) -> bool:
        name, equals, value = condition.partition("=")
        return str(values.get(name)) == value if equals else known.get(name) in given

    def worded(condition: str) -> str:
        name, _, value = condition.partition("=")
        return f"{known[name].flag} {value}".strip()

    for option in given:
        if option.needs and not any(map(holds, option.needs)):
            raise WrongUsageError(f"{option.flag} needs {' or '.join(map(worded, option.needs))}")
        for other in filter(holds, option.excludes):
            raise WrongUsageError(f"{option.flag} and {worded(other)} exclude each other")
        if option.name in ("plot", "histograms", "sheet") and find_spec("matplotlib") is None:
            raise WrongUsageError(f"{option.flag} needs {needs('matplotlib', 'plot')}")
        if isinstance(option.kind, File) and not option.many and option.kind.suffixes:
            folders = option.name == "output" and "out_dir" in known
            check_suffix(option.flag, values[option.name], option.kind.endings, folders=folders)
    keywords = {option.keyword: option for option in known.values() if option.keyword}
    return Given(**values, options=known, keywords=keywords)
