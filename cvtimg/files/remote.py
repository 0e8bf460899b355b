"""Files elsewhere, such as s3://, gs:// and https://, by fsspec: found from here, read and written where the work is.

A path keeps a URL with a single slash, as `pathlib` has it: ``Path("s3://bucket/a.png")`` is ``s3:/bucket/a.png``.
"""

from __future__ import annotations

import glob
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from cvtimg._shared.extras import needs
from cvtimg._shared.messages import one_line

StrPath: TypeAlias = str | os.PathLike[str]

#: A scheme has two letters or more: one is a drive of Windows.
_URL = re.compile(r"([a-z][a-z0-9+.-]+):/+(.*)", re.DOTALL)


def is_remote(path: StrPath) -> bool:
    """Whether a path is a URL of a file elsewhere."""
    return _URL.fullmatch(str(path)) is not None


def url_of(path: StrPath) -> str:
    """Return the URL that a path was made of."""
    found = _URL.fullmatch(str(path))
    return f"{found[1]}://{found[2]}" if found else str(path)


def url_as_stored(path: StrPath) -> str:
    """Return the URL of a file as its file system writes it: the same for all ways to write it."""
    files, place = _opened(url_of(path))
    return str(files.unstrip_protocol(place))


@contextmanager
def _answering(url: str, done: str = "read") -> Iterator[None]:
    """Say in one line what went wrong elsewhere: file systems raise errors of many libraries."""
    try:
        yield
    except Exception as error:
        raise OSError(f"{url}: cannot be {done} ({one_line(error)})") from error


def find_remote(url: str, suffixes: frozenset[str]) -> list[Path]:
    """List the files that a URL names: itself, those that a pattern matches, or those in a folder with such suffixes.

    FileNotFoundError says that there is none, and OSError that nothing answers.
    """
    files, place = _opened(url)
    with _answering(url):
        if glob.has_magic(place):
            found = [name for name in files.glob(place) if _is_whole(name) or not files.isdir(name)]
        elif not _is_whole(place) and Path(place).suffix.lower() not in suffixes and files.isdir(place):
            inside = dict.fromkeys(_whole(str(name)) for name in files.find(place))
            found = [name for name in inside if Path(name).suffix.lower() in suffixes]
        else:
            found = [place] if files.exists(place) else []
            if not found:
                _raise_if_silent(files, place)
    if not found:
        raise FileNotFoundError(f"{url}: no such file")
    return [Path(files.unstrip_protocol(name)) for name in sorted(found)]


def _raise_if_silent(files: Any, place: str) -> None:
    """Raise why there is no answer, which `exists` and `info` of HTTP take for a missing file."""
    try:
        files.info(place)
    except FileNotFoundError as error:
        if error.__cause__ is not None and not isinstance(error.__cause__, FileNotFoundError):
            raise error.__cause__ from error


def _is_whole(name: str) -> bool:
    """Whether a folder is one input."""
    return name.lower().endswith((".zarr", ".parquet"))


def _whole(name: str) -> str:
    """Return the outermost folder around a file that is one input, or the file itself."""
    parts = name.split("/")
    ends = (number for number, part in enumerate(parts, 1) if _is_whole(part))
    return "/".join(parts[: next(ends, len(parts))])


def remote_folder(url: str, suffix: str = "") -> list[str]:
    """Return the URLs of the files with this suffix in a folder and its subfolders, sorted; none if it is no folder."""
    files, place = _opened(url)
    with _answering(url):
        found = files.find(place) if files.isdir(place) else []
    return [str(files.unstrip_protocol(name)) for name in sorted(found) if str(name).endswith(suffix)]


def open_remote(url: str) -> Any:
    """Open a file elsewhere to read any part of it."""
    files, place = _opened(url)
    with _answering(url):
        return files.open(place, "rb")


def exists(path: StrPath) -> bool:
    """Whether there is such a file, here or elsewhere; OSError if nothing answers."""
    if not is_remote(path):
        return Path(path).exists()
    files, place = _opened(url_of(path))
    with _answering(url_of(path)):
        return bool(files.exists(place))


def check_is_new(path: StrPath) -> None:
    """Raise FileExistsError rather than replace a file."""
    if exists(path):
        raise FileExistsError(f"{url_of(path)}: exists already; pass overwrite (--overwrite) to replace it")


def fetch(path: StrPath, target: Path) -> None:
    """Copy a file, or a folder that is one input, from elsewhere; OSError if it cannot be read."""
    files, place = _opened(url_of(path))
    with _answering(url_of(path)):
        if _is_whole(place) and files.isdir(place):
            files.get(f"{place}/", f"{target}/", recursive=True)
            return
        with files.open(place, "rb") as source, target.open("wb") as copy:
            shutil.copyfileobj(source, copy, 1 << 20)


def send(source: Path, path: StrPath, *, overwrite: bool) -> None:
    """Copy a whole file or folder elsewhere. Stores of objects show it once it is complete."""
    if not overwrite:
        check_is_new(path)
    files, place = _opened(url_of(path))
    with _answering(url_of(path), "written"):
        if parent := place.rpartition("/")[0]:
            files.makedirs(parent, exist_ok=True)
        if source.is_dir():
            if files.exists(place):  # chunks of an older array must not stay
                files.rm(place, recursive=True)
            files.put(f"{source}/", f"{place}/", recursive=True)
        else:
            files.put_file(str(source), place)


@contextmanager
def local_path(path: StrPath, *, overwrite: bool) -> Iterator[Path]:
    """Give a path here whose file or folder is copied elsewhere when the block succeeds; errors are those of `send`."""
    if not overwrite:
        check_is_new(path)
    with TemporaryDirectory(prefix="cvtimg-") as folder:
        copy = Path(folder, Path(path).name)
        yield copy
        send(copy, path, overwrite=overwrite)


@contextmanager
def local_copy(path: StrPath) -> Iterator[Path]:
    """Give a file to read that is here: the file itself, or a copy of what a URL names, removed when the block ends.

    Errors in the block that name the copy name the URL instead.
    """
    if not is_remote(path):
        yield Path(path)
        return
    with TemporaryDirectory(prefix="cvtimg-") as folder:
        copy = Path(folder, Path(path).name)
        fetch(path, copy)
        try:
            yield copy
        except (OSError, ValueError) as error:
            # Kinds of ValueError, such as UnicodeDecodeError, cannot be made of a message alone.
            kind = type(error) if isinstance(error, OSError) else ValueError
            raise kind(str(error).replace(str(copy), url_of(path))) from error


def _opened(url: str) -> tuple[Any, str]:
    """Return the file system of a URL, and the place in it."""
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise OSError(f"{url}: needs {needs('fsspec', 'remote')}") from error
    try:
        files, place = url_to_fs(url)
    except (ImportError, ValueError) as error:  # s3fs, gcsfs, aiohttp; or no such scheme
        raise OSError(f"{url}: cannot be opened ({one_line(error)})") from error
    return files, str(place)
