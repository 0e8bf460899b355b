"""Files elsewhere, such as s3://, gs:// and https://: the one door to them, which fsspec opens.

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
#: Folder that is one input, with what is before it.
_ONE = re.compile(r".*?\.(zarr|parquet)(?=/|$)", re.IGNORECASE | re.DOTALL)


def is_remote(path: StrPath) -> bool:
    """Whether a path is a URL of a file elsewhere."""
    return _URL.fullmatch(str(path)) is not None


def url_of(path: StrPath) -> str:
    """Return the URL that a path was made of."""
    found = _URL.fullmatch(str(path))
    return f"{found[1]}://{found[2]}" if found else str(path)


@contextmanager
def elsewhere(path: StrPath, done: str = "read") -> Iterator[tuple[Any, str]]:
    """Give the file system of a URL and the place in it; errors in the block become an `OSError` of one line."""
    url = url_of(path)
    try:
        from fsspec.core import url_to_fs

        files, place = url_to_fs(url)
    except ImportError as error:  # of fsspec, or of s3fs, gcsfs, aiohttp
        said = (
            f"needs {needs('fsspec', 'remote')}" if error.name == "fsspec" else f"cannot be opened ({one_line(error)})"
        )
        raise OSError(f"{url}: {said}") from error
    except ValueError as error:  # no such scheme
        raise OSError(f"{url}: cannot be opened ({one_line(error)})") from error
    try:
        yield files, str(place)
    except Exception as error:  # file systems raise errors of many libraries
        raise OSError(f"{url}: cannot be {done} ({one_line(error)})") from error


def find_remote(url: str, suffixes: frozenset[str]) -> list[Path]:
    """List the files that a URL names: itself, those that a pattern matches, or those in a folder with such suffixes.

    FileNotFoundError says that there is none, and OSError that nothing answers.
    """
    with elsewhere(url) as (files, place):
        if glob.has_magic(place):
            found = [name for name in files.glob(place) if _ONE.fullmatch(name) or not files.isdir(name)]
        elif _ONE.fullmatch(place) or Path(place).suffix.lower() in suffixes or not files.isdir(place):
            found = [place] if _is_there(files, place) else []
        else:
            inside = ((_ONE.match(str(name)) or [str(name)])[0] for name in files.find(place))
            found = [name for name in dict.fromkeys(inside) if Path(name).suffix.lower() in suffixes]
        paths = [Path(files.unstrip_protocol(name)) for name in sorted(found)]
    if not paths:
        raise FileNotFoundError(f"{url}: no such file")
    return paths


def _is_there(files: Any, place: str) -> bool:
    try:
        files.info(place)
    except FileNotFoundError as error:  # of HTTP also where there is no answer, which is then its cause
        if error.__cause__ is not None and not isinstance(error.__cause__, FileNotFoundError):
            raise error.__cause__ from error
        return False
    return True


def exists(path: StrPath) -> bool:
    """Whether there is such a file, here or elsewhere; OSError if nothing answers."""
    if not is_remote(path):
        return Path(path).exists()
    with elsewhere(path) as (files, place):
        return bool(files.exists(place))


def check_is_new(path: StrPath) -> None:
    """Raise FileExistsError rather than replace a file."""
    if exists(path):
        raise FileExistsError(f"{url_of(path)}: exists already; pass overwrite (--overwrite) to replace it")


@contextmanager
def local_path(path: StrPath, *, overwrite: bool) -> Iterator[Path]:
    """Give a path here whose file or folder, if there is one, is copied elsewhere when the block succeeds."""
    if not overwrite:
        check_is_new(path)
    with TemporaryDirectory(prefix="cvtimg-") as folder:
        copy = Path(folder, Path(path).name)
        yield copy
        if not copy.exists():
            return
        if not overwrite:
            check_is_new(path)
        with elsewhere(path, "written") as (files, place):
            if parent := place.rpartition("/")[0]:
                files.makedirs(parent, exist_ok=True)
            if copy.is_dir() and files.exists(place):  # chunks of an older array must not stay
                files.rm(place, recursive=True)
            files.put(f"{copy}/", f"{place}/", recursive=True) if copy.is_dir() else files.put_file(str(copy), place)


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
        with elsewhere(path) as (files, place):
            if _ONE.fullmatch(place) and files.isdir(place):
                files.get(f"{place}/", f"{copy}/", recursive=True)
            else:
                with files.open(place, "rb") as source, copy.open("wb") as target:
                    shutil.copyfileobj(source, target, 1 << 20)
        try:
            yield copy
        except (OSError, ValueError) as error:
            # Kinds of ValueError, such as UnicodeDecodeError, cannot be made of a message alone.
            kind = type(error) if isinstance(error, OSError) else ValueError
            raise kind(str(error).replace(str(copy), url_of(path))) from error
