"""Output files that appear whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, TypeAlias

from cvtimg._shared.messages import one_line

StrPath: TypeAlias = str | os.PathLike[str]

#: What names of unfinished files begin with.
_PART = ".cvtimg-"


@contextmanager
def whole_file(path: StrPath, *, overwrite: bool = False) -> Iterator[BinaryIO]:
    """Open a file that appears whole when the block ends, or not at all if it fails.

    Parameters
    ----------
    path : str or path-like
        Where the file shall appear. An existing file keeps its permissions, a link stays a link.
    overwrite : bool
        Replace an existing file.

    Yields
    ------
    binary file
        Open for writing and reading, under another name in the same folder.

    Raises
    ------
    FileExistsError
        If the file exists and `overwrite` is false, even if it appears meanwhile.
    OSError
        If the file cannot be written.

    Notes
    -----
    This guards against programs that fail or are killed. It does not wait for the disk (fsync), so it
    does not guard against a power cut: a batch of small pictures would take several times as long.
    A killed program leaves the unfinished file behind, hidden, for `remove_leftovers`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with whole_file(f"{folder}/a.txt") as file:
    ...         _ = file.write(b"all of it")
    ...     Path(folder, "a.txt").read_text()
    'all of it'
    """
    target = Path(os.path.realpath(path))
    _check_target(path, target, overwrite)
    part = _hidden(target)
    try:
        # Opened by hand, for tempfile would give 0600 in place of what the umask allows.
        part.open("xb").close()
        with _held(part):
            with part.open("w+b") as file:
                yield file
            _publish(path, part, target, overwrite)
    except OSError as error:
        # One without errno is worded already; one that names another file is not ours.
        if error.errno is None or error.filename not in (None, str(part)):
            raise
        raise type(error)(f"{path}: cannot be written ({one_line(error)})") from error
    finally:
        with suppress(OSError):
            part.unlink()


@contextmanager
def whole_folder(path: StrPath, *, overwrite: bool = False) -> Iterator[Path]:
    """Give an empty folder that appears under its name when the block ends, or not at all if it fails.

    Parameters and errors are those of `whole_file`; an old folder goes only when the new one is whole.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not overwrite:
        raise _exists(path)
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{path}: there is no folder {target.parent}")
    with scratch_folder(target) as part:
        yield part
        if not target.exists():
            part.rename(target)
            return
        old = _hidden(target)
        target.rename(old)
        try:
            part.rename(target)
        except OSError:
            old.rename(target)
            raise
        shutil.rmtree(old, ignore_errors=True)


@contextmanager
def scratch_folder(path: StrPath) -> Iterator[Path]:
    """Give an empty hidden folder beside a file, for work on it, that is gone when the block ends."""
    part = _hidden(Path(os.path.realpath(path)))
    try:
        part.mkdir()
        with _held(part):
            yield part
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _hidden(target: Path) -> Path:
    return target.with_name(f"{_PART}{os.urandom(8).hex()}.part")


def remove_leftovers(folder: StrPath) -> None:
    """Take unfinished files and folders of killed programs out of a folder; those that are being written stay."""
    for part in Path(folder).glob(f"{_PART}*.part"):
        with suppress(OSError), _held(part, at_once=True):
            if part.is_dir():
                shutil.rmtree(part)
            else:
                part.unlink()


@contextmanager
def _held(part: Path, *, at_once: bool = False) -> Iterator[None]:
    """Mark a file or folder as being written, which ends with the program; `at_once`: fail if it is by another."""
    is_folder = part.is_dir()
    try:
        import fcntl
    except ImportError:
        if at_once and is_folder:
            raise OSError(f"{part}: may be in use") from None
        yield  # Windows takes no file away that is open
        return
    held = os.open(part, os.O_RDONLY if is_folder else os.O_RDWR)
    try:
        try:
            fcntl.flock(held, fcntl.LOCK_EX | (fcntl.LOCK_NB if at_once else 0))
        except OSError:
            if at_once:
                raise
        yield
    finally:
        os.close(held)


def _check_target(path: StrPath, target: Path, overwrite: bool) -> None:
    if target.is_dir():
        raise IsADirectoryError(f"{path}: is a directory, not a file")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{path}: there is no folder {target.parent}")
    if not target.exists():
        return
    if not overwrite:
        raise _exists(path)
    # Moving a file into place would put it where a device or a pipe was, and does not ask
    # whether the old file may be written.
    if not target.is_file():
        raise OSError(f"{path}: is not a regular file")
    if not os.access(target, os.W_OK):
        raise PermissionError(f"{path}: is write-protected")


def _publish(path: StrPath, part: Path, target: Path, overwrite: bool) -> None:
    if overwrite:
        if target.exists():
            shutil.copymode(target, part)
        part.replace(target)
        return
    try:
        target.hardlink_to(part)  # unlike a rename, fails if the name is taken meanwhile
    except FileExistsError as error:
        raise _exists(path) from error
    except OSError as error:  # a file system without hard links
        if target.exists():
            raise _exists(path) from error
        part.rename(target)


def _exists(path: StrPath) -> FileExistsError:
    return FileExistsError(f"{path}: exists already; pass overwrite (--overwrite) to replace it")
