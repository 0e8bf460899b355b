"""Inputs as people name them, where their outputs go, and what is refused before any work."""

from __future__ import annotations

import glob
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any, TypeAlias

__all__ = [
    "Missing",
    "Row",
    "Task",
    "Work",
    "WrongUsageError",
    "check_choice",
    "check_no_clash",
    "check_outputs",
    "find",
]

Row: TypeAlias = dict[str, Any]
Missing: TypeAlias = list[tuple[str, OSError]]


class WrongUsageError(Exception):
    """What was asked for makes no sense, whatever is in the inputs."""


@dataclass(frozen=True, slots=True)
class Task:
    """One input, and the files that shall come of it, by kind."""

    source: Path
    outputs: Mapping[str, Path] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a task: its result, or why there is none."""

    result: Any
    why: str = ""


Attempt = Callable[[Task], Outcome]


#: From a task to its row in the report; whatever it raises is the failure of this input alone. To go to worker
#: processes it must be picklable: a function of a module, or `functools.partial` of one.
Work: TypeAlias = Callable[[Task], Row]


def find(
    inputs: Iterable[str], expand: Callable[[str], list[Path]], out_dir: Path | None = None
) -> tuple[dict[Path, Path], Missing]:
    """List the files that the arguments name, each once, and the arguments that name none.

    Parameters
    ----------
    inputs : iterable of str
        Files, folders and patterns; "-" stands for a list on standard input, a name a line, or with a zero byte
        between names.
    expand : callable
        From an argument to the files that it names.
    out_dir : Path, optional
        Folder of outputs. What lies in it inside an input folder came from an earlier run, and is no input.

    Returns
    -------
    dict of Path to Path
        For each file the folder that its outputs go to: its own, or, in `out_dir`, the one that it has below the
        folder or pattern that named it. Files of a list keep the folders that they have below the working folder.
    list of (str, OSError)
        Arguments that name no file, and why.
    """
    sources: dict[Path, Path] = {}
    missing: Missing = []
    outside = out_dir.resolve() if out_dir else None
    for text, root in _listed(inputs):
        try:
            found = expand(text)
        except OSError as error:
            missing.append((text, error))
            continue
        if outside and Path(text).resolve() in outside.parents:
            found = [path for path in found if outside not in path.resolve().parents]
        for path in found:
            sources.setdefault(path, out_dir / _below(path, root) if out_dir else path.parent)
    return sources, missing


def _listed(inputs: Iterable[str]) -> Iterator[tuple[str, Path]]:
    """Give each argument, and those on standard input, with the folder below which it keeps its folders."""
    for text in inputs:
        if text == "-":
            content = os.fsencode(sys.stdin.read()) if not hasattr(sys.stdin, "buffer") else sys.stdin.buffer.read()
            names = content.split(b"\0") if b"\0" in content else content.splitlines()
            yield from ((os.fsdecode(name), Path()) for name in names if name)
        else:
            yield text, _root(text)


def _root(text: str) -> Path:
    """Return the folder that an argument is, or is in; of a pattern, that before the first wildcard."""
    path = Path(text)
    if path.is_dir():
        return path
    if glob.has_magic(text) and not path.exists():
        return Path(*takewhile(lambda part: not glob.has_magic(part), path.parts))
    return path.parent


def _below(path: Path, root: Path) -> Path:
    with suppress(ValueError):
        below = path.relative_to(root).parent
        if ".." not in below.parts:  # outputs stay in their folder, whatever a list names
            return below
    return Path()


def check_choice(option: str, value: str, allowed: Iterable[str]) -> None:
    """Refuse what is not one of the names allowed."""
    if value not in (names := list(allowed)):
        raise WrongUsageError(f"{option}: {value!r} must be one of {', '.join(names)}")


def check_outputs(n_inputs: int, out_dir: Path | None, files: Mapping[str, Path | None]) -> None:
    """Refuse combinations that cannot be; `files` are the options that name one file, the main one under ``-o``."""
    if files["-o"] and out_dir:
        raise WrongUsageError("-o and --out-dir exclude each other")
    given = [option for option, file in files.items() if file]
    if n_inputs > 1 and given:
        raise WrongUsageError(f"{given[0]} is for one input, and these are {n_inputs}")
    if n_inputs > 1 and not out_dir:
        raise WrongUsageError(f"{n_inputs} inputs need --out-dir DIR")


def check_no_clash(tasks: Sequence[Task], report: Path | None = None) -> None:
    """Refuse outputs that would replace an input or each other, before any work."""
    inputs = {_identity(task.source) for task in tasks} - {None}
    owners: dict[str, str] = {}
    wanted = [(path, str(task.source)) for task in tasks for path in task.outputs.values()]
    for path, owner in [*wanted, *([(report, "the report")] if report else [])]:
        if _identity(path) in inputs:
            raise WrongUsageError(f"{path} is an input, which is never replaced; choose another output")
        place = os.path.normcase(path.resolve())
        if place in owners:
            who = f"two outputs of {owner}" if owners[place] == owner else f"{owners[place]} and {owner}"
            raise WrongUsageError(f"{who} would both become {path}")
        owners[place] = owner


def _identity(path: Path) -> tuple[int, int] | None:
    """Tell files apart whatever links and names lead to them; None where there is none."""
    try:
        status = path.stat()
    except OSError:  # its own task will say why
        return None
    return status.st_dev, status.st_ino
