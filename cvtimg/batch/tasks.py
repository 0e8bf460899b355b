"""One task of a batch: its inputs and outputs, the times of its stages, and its outcome."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, TypeAlias

from cvtimg._shared.choices import Row as Row
from cvtimg.files.remote import url_of

#: Arguments or files that cannot be read, with the error.
Missing: TypeAlias = list[tuple[str, OSError]]


class WrongUsageError(Exception):
    """The arguments are wrong, whatever the inputs contain."""


class InputsFailedError(Exception):
    """Some inputs of a task with several inputs cannot be read."""

    def __init__(self, failed: Missing) -> None:
        super().__init__("some inputs cannot be read")
        self.failed = failed


@dataclass(frozen=True, slots=True)
class Task:
    """Inputs that are processed together, nearly always one, and the files to write, by option."""

    sources: tuple[Path, ...]  # none where outputs are made from options alone
    outputs: Mapping[str, Path] = field(default_factory=dict)
    # Names to show for temporary files that stand for others, such as standard input and output.
    shown: Mapping[Path, str] = field(default_factory=dict)

    @property
    def source(self) -> Path:
        """The input, or the first of several."""
        return self.sources[0]

    @property
    def output(self) -> Path:
        """The main output."""
        return next(iter(self.outputs.values()))

    @property
    def name(self) -> str:
        """The name to show for the task: its input, or its output if it has no input; "" if it only prints."""
        named = (*self.sources, *self.outputs.values())
        return self.shown_name(named[0]) if named else ""

    def shown_name(self, path: Path) -> str:
        """Return how messages call one of its files."""
        return self.shown.get(path, url_of(path))

    @property
    def facts(self) -> Row:
        """The first columns of its row in the report."""
        row: Row = {"input": self.name} if self.sources else {}
        return {**row, "output": self.shown_name(self.output)} if self.outputs else row

    def wording(self, text: str) -> str:
        """Replace the names of temporary files in a message by those to show."""
        for path, name in self.shown.items():
            text = text.replace(str(path), name)
        return text


class Stopwatch:
    """Measures the seconds of each stage of the work; the times of stages with the same name add up."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, stage: str) -> None:
        """End a stage, such as "read", "cluster" or "write", and add its time."""
        before, self._last = self._last, perf_counter()
        self.laps[stage] = self.laps.get(stage, 0.0) + self._last - before


#: The work of a command on one task. It returns the columns of the row except "input", "output" and "seconds", which
#: the stopwatch measures. An exception fails this task alone. To run in worker processes it must be picklable: a
#: function of a module, or `functools.partial` of one.
Work: TypeAlias = Callable[[Task, Stopwatch], Row]


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of a task: its result, or the inputs that failed and the reasons."""

    result: Any
    failures: tuple[tuple[str, str], ...] = ()

    @property
    def rows(self) -> list[Row]:
        """Its rows in the report, with their status; columns whose names begin with "_" are not in it."""
        if self.failures:
            return [{"status": "failed", "input": name, "error": why} for name, why in self.failures]
        row = {name: value for name, value in self.result.items() if not name.startswith("_")}
        return [{"status": "skipped" if row.get("skipped") else "done", **row}]


Attempt: TypeAlias = Callable[[Task], Outcome]
