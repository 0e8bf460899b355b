"""Write files, tables of text and folders atomically: complete, or not at all."""

import csv
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from io import StringIO
from pathlib import Path
from typing import Any, BinaryIO

from cvtimg._shared.messages import one_line
from cvtimg.files.remote import StrPath as StrPath
from cvtimg.files.remote import elsewhere, exists, is_remote, url_of

#: Prefix of unfinished files.
_PART = ".cvtimg-"


@contextmanager
def whole_file(path: StrPath, *, overwrite: bool = False) -> Iterator[BinaryIO]:
    """Open a file that appears under its name when the block succeeds, and not at all if it fails.

    Until then it has a temporary name in the same folder. With `overwrite`, an existing file is replaced, and keeps its
    permissions, and its owner and group as far as the program may set them; else `FileExistsError` says so, even if it
    was created in the meantime. A symbolic link is followed. A URL is written once the whole file is here.

    Notes
    -----
    Other hard links to a file that is replaced keep its old content.

    This protects against programs that fail or are killed, but not against power failures: the file is not synced to
    disk (fsync), which would make batches of small images several times slower. A killed program leaves a hidden
    unfinished file, which `remove_leftovers` deletes.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with whole_file(f"{folder}/a.txt") as file:
    ...         _ = file.write(b"all of it")
    ...     Path(folder, "a.txt").read_text()
    'all of it'
    """
    if is_remote(path):
        with local_path(path, overwrite=overwrite) as copy, copy.open("w+b") as file:
            yield file
        return
    target = Path(os.path.realpath(path))
    _check_target(path, target, overwrite)
    part = _hidden(target)
    try:
        # Not with tempfile, which would set permissions 0600 instead of those that the umask allows.
        part.open("xb").close()
        with _held(part):
            with part.open("w+b") as file:
                yield file
            _publish(path, part, target, overwrite)
    except OSError as error:
        # Errors without errno already have our message; those that name another file come from the caller.
        if error.errno is None or error.filename not in (None, str(part)):
            raise
        raise type(error)(f"{path}: cannot be written ({one_line(error)})") from error
    finally:
        with suppress(OSError):
            part.unlink()


def write_whole(path: StrPath, content: bytes, *, overwrite: bool = False) -> None:
    """Write a file as `whole_file` does."""
    with whole_file(path, overwrite=overwrite) as file:
        file.write(content)


def write_text(path: StrPath, pieces: Iterable[str], *, overwrite: bool = False) -> None:
    """Write pieces of text in UTF-8, complete or not at all; parameters and errors are those of `whole_file`."""
    with whole_file(path, overwrite=overwrite) as file:
        file.writelines(piece.encode() for piece in pieces)


def csv_text(names: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    r"""Format a table of named columns as comma-separated values; None gives an empty field.

    Examples
    --------
    >>> csv_text(["name", "area"], [["a, b", 12.5], ["c", None]])
    'name,area\n"a, b",12.5\nc,\n'
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)
    return text.getvalue()


def write_csv(path: StrPath, names: Iterable[str], rows: Iterable[Iterable[Any]], *, overwrite: bool = False) -> None:
    """Write a table, as `csv_text` formats it, in UTF-8, atomically; `overwrite` allows to replace a file."""
    # A column may hold file names that are not valid text.
    write_whole(path, csv_text(names, rows).encode(errors="surrogateescape"), overwrite=overwrite)


@contextmanager
def whole_folder(path: StrPath, *, overwrite: bool = False) -> Iterator[Path]:
    """Make an empty folder that appears under its name when the block succeeds, and not at all if it fails.

    Parameters and errors are those of `whole_file`. An existing folder is removed only after the new one is complete.
    """
    if is_remote(path):
        with local_path(path, overwrite=overwrite) as copy:
            copy.mkdir()
            yield copy
        return
    target = Path(os.path.realpath(path))
    _check_target(path, target, overwrite, is_folder=True)
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
    """Make an empty hidden folder next to a file, and remove it when the block ends."""
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
    """Delete unfinished files and folders of killed programs from a folder, except those still being written."""
    for part in Path(folder).glob(f"{_PART}*.part"):
        with suppress(OSError), _held(part, at_once=True):
            if part.is_dir():
                shutil.rmtree(part)
            else:
                part.unlink()


@contextmanager
def _held(part: Path, *, at_once: bool = False) -> Iterator[None]:
    """Lock a file or folder while it is written; the lock ends with the program. `at_once`: fail if already locked."""
    is_folder = part.is_dir()
    try:
        import fcntl
    except ImportError:
        if at_once and is_folder:
            raise OSError(f"{part}: may be in use") from None
        yield  # Windows does not delete open files
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


def check_can_be_written(path: StrPath, *, overwrite: bool) -> None:
    """Fail now rather than after the work; parameters and errors are those of `whole_file` and `whole_folder`."""
    if is_remote(path):
        _check_is_new(path, overwrite)
        return
    target = Path(os.path.realpath(path))
    _check_target(path, target, overwrite, is_folder=target.suffix.lower() == ".zarr")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"{path}: cannot be written (permission denied)")


@contextmanager
def local_path(path: StrPath, *, overwrite: bool) -> Iterator[Path]:
    """Give a path here whose file or folder, if there is one, is copied to a URL when the block succeeds."""
    from tempfile import TemporaryDirectory

    _check_is_new(path, overwrite)
    with TemporaryDirectory(prefix="cvtimg-") as folder:
        copy = Path(folder, Path(path).name)
        yield copy
        if not copy.exists():
            return
        _check_is_new(path, overwrite)
        with elsewhere(path, "written") as (files, place):
            if parent := place.rpartition("/")[0]:
                files.makedirs(parent, exist_ok=True)
            if copy.is_dir() and files.exists(place):  # chunks of an older array must not stay
                files.rm(place, recursive=True)
            files.put(f"{copy}/", f"{place}/", recursive=True) if copy.is_dir() else files.put_file(str(copy), place)


def _check_is_new(path: StrPath, overwrite: bool) -> None:
    if not overwrite and exists(path):
        raise _exists(path)


def _check_target(path: StrPath, target: Path, overwrite: bool, *, is_folder: bool = False) -> None:
    if target.is_dir() and not is_folder:
        raise IsADirectoryError(f"{path}: is a directory, not a file")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{path}: folder {target.parent} does not exist")
    if not target.exists():
        return
    if not overwrite:
        raise _exists(path)
    if is_folder:
        return
    # Moving a file into place would replace a device or pipe, and ignores the write permission of the old file.
    if not target.is_file():
        raise OSError(f"{path}: is not a regular file")
    if not os.access(target, os.W_OK):
        raise PermissionError(f"{path}: is write-protected")


def _publish(path: StrPath, part: Path, target: Path, overwrite: bool) -> None:
    if overwrite:
        if target.exists():
            before = target.stat()
            for owner in ((before.st_uid, -1), (-1, before.st_gid)):
                with suppress(OSError, AttributeError):  # who may not give a file away; Windows
                    os.chown(part, *owner)
            shutil.copymode(target, part)
        part.replace(target)
        return
    try:
        target.hardlink_to(part)  # unlike a rename, fails if the name has been taken in the meantime
    except FileExistsError as error:
        raise _exists(path) from error
    except OSError as error:  # a file system without hard links
        if target.exists():
            raise _exists(path) from error
        part.rename(target)


def _exists(path: StrPath) -> FileExistsError:
    return FileExistsError(f"{url_of(path)}: exists already; pass overwrite (--overwrite) to replace it")
