"""One task of a batch: its inputs and outputs, the time that its stages take, and what became of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, TypeAlias

__all__ = ["Attempt", "InputsFailedError", "Missing", "Outcome", "Row", "Stopwatch", "Task", "Work", "WrongUsageError"]

#: What the report tells of an input, by column.
Row: TypeAlias = dict[str, Any]
#: Arguments or files that cannot be read, and why.
Missing: TypeAlias = list[tuple[str, OSError]]


class WrongUsageError(Exception):
    """The arguments make no sense, whatever the inputs hold."""


class InputsFailedError(Exception):
    """Some of the several inputs of one task cannot be read."""

    def __init__(self, failed: Missing) -> None:
        super().__init__("some inputs cannot be read")
        self.failed = failed


@dataclass(frozen=True, slots=True)
class Task:
    """Inputs that are worked on together, nearly always one, and the files to write, by the option that names each.

    A task without inputs makes its outputs from options alone. `shown` names files that people know otherwise: those
    that stand for standard input and output.
    """

    sources: tuple[Path, ...]
    outputs: Mapping[str, Path] = field(default_factory=dict)
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
        """What people know the task by: its input, or its output if it has no input."""
        return self.shown_name(self.source if self.sources else self.output)

    def shown_name(self, path: Path) -> str:
        """Return what people know a file by."""
        return self.shown.get(path, str(path))

    @property
    def facts(self) -> Row:
        """The first columns of its row in the report."""
        row: Row = {"input": self.name} if self.sources else {}
        return {**row, "output": self.shown_name(self.output)} if self.outputs else row

    def wording(self, text: str) -> str:
        """Name files in a message as people know them."""
        for path, name in self.shown.items():
            text = text.replace(str(path), name)
        return text


class Stopwatch:
    """Seconds since the last lap, added up by the name of the stage that a lap ends."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, stage: str) -> None:
        """End a stage: "read", "cluster", "write" or a stage of a command's own."""
        now = perf_counter()
        self.laps[stage] = self.laps.get(stage, 0.0) + now - self._last
        self._last = now


#: What a command does to a task: it returns the columns of its row between "input", "output" and "seconds", which the
#: stopwatch measures. What it raises is the failure of this task alone. To run in worker processes it must be
#: picklable: a function of a module, or `functools.partial` of one.
Work: TypeAlias = Callable[[Task, Stopwatch], Row]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a task: its result, or which inputs failed and why."""

    result: Any
    failures: tuple[tuple[str, str], ...] = ()

    @classmethod
    def failed(cls, task: Task, why: str) -> Outcome:
        """Make the outcome of a task that failed as a whole."""
        return cls(None, ((task.name, why),))

    @property
    def why(self) -> str:
        """The reason of the first failure; empty if there is none."""
        return self.failures[0][1] if self.failures else ""


Attempt: TypeAlias = Callable[[Task], Outcome]
