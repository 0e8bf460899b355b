"""Copy pipes, such as standard input and output, to and from files, because images may be read more than once."""

import os
import shutil
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cvtimg.batch.tasks import Task, WrongUsageError

#: Name of standard input and output. As an output it carries the suffix of its format, as in ``-.png``.
STANDARD = "-"
_NPY = b"\x93NUMPY"


def is_standard(path: Path) -> bool:
    """Return whether a path means standard input or output."""
    return path.stem == STANDARD and path.parent == Path()


def is_pipe(path: Path) -> bool:
    """Return whether a path can be read only once: standard input, a named pipe or a terminal."""
    if is_standard(path):
        return True
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode) or stat.S_ISSOCK(mode)


def stem_of(source: Path) -> str:
    """Return the name from which those of the outputs are made."""
    packed = source.suffix.lower() in (".gz", ".bz2", ".xz", ".zip")
    return "stdin" if is_pipe(source) else Path(source.stem).stem if packed else source.stem


@contextmanager
def as_files(tasks: list[Task]) -> Iterator[list[Task]]:
    """Replace the pipes of tasks by files in a temporary folder, which is removed when the block ends."""
    if not any(map(_has_pipes, tasks)):
        yield tasks
        return
    if sum(is_standard(path) for task in tasks for path in task.outputs.values()) > 1:
        raise WrongUsageError("only one output can go to standard output")
    from tempfile import TemporaryDirectory

    with TemporaryDirectory(prefix="cvtimg-") as folder:
        each = enumerate(tasks)
        yield [_as_files(task, Path(folder, str(number))) if _has_pipes(task) else task for number, task in each]


def _has_pipes(task: Task) -> bool:
    return any(map(is_pipe, task.sources)) or any(map(is_standard, task.outputs.values()))


def _as_files(task: Task, folder: Path) -> Task:
    folder.mkdir()
    shown, sources, outputs = {}, [*task.sources], {**task.outputs}
    for number, source in enumerate(sources):
        if is_pipe(source):
            content = read_all(source)
            sources[number] = file = folder / f"in{number}{'.npy' if content.startswith(_NPY) else ''}"
            file.write_bytes(content)
            shown[file] = str(source)
    for number, (option, output) in enumerate(task.outputs.items()):
        if is_standard(output):
            outputs[option] = file = folder / f"out{number}{output.suffix}"
            shown[file] = STANDARD
    return Task(tuple(sources), outputs, shown)


def read_all(path: Path) -> bytes:
    """Read all of a file, or of standard input."""
    if not is_standard(path):
        return path.read_bytes()
    stream = sys.stdin
    if stream is None:
        raise OSError("standard input is closed")
    content: bytes | str = getattr(stream, "buffer", stream).read()
    return os.fsencode(content) if isinstance(content, str) else content


def deliver(task: Task) -> None:
    """Copy the outputs meant for standard output to it."""
    for path in task.outputs.values():
        if task.shown.get(path) == STANDARD and path.exists():
            if not hasattr(sys.stdout, "buffer"):
                raise OSError("standard output is closed")
            sys.stdout.flush()
            with path.open("rb") as file:
                shutil.copyfileobj(file, sys.stdout.buffer)
            sys.stdout.buffer.flush()
