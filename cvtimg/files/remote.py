"""Files elsewhere, such as s3://, gs:// and https://: the one door to them, which fsspec opens."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from cvtimg._shared.extras import needs
from cvtimg._shared.messages import one_line

StrPath: TypeAlias = str | os.PathLike[str]
#: A scheme has two letters or more: one is a drive of Windows. A path keeps a single slash.
_URL = re.compile(r"([a-z][a-z0-9+.-]+):/+(.*)", re.DOTALL)
#: Folder that is one input, with what is before it.
IS_ONE = re.compile(r".*?\.(zarr|parquet)(?=/|$)", re.IGNORECASE | re.DOTALL)


def check_name(name: StrPath) -> None:
    """Refuse an empty name, which `pathlib.Path` would take for the current folder."""
    if not os.fspath(name):
        raise ValueError("an empty name names no file; the current folder is '.'")


def is_remote(path: StrPath) -> bool:
    """Whether a path, which must not be empty, is a URL of a file elsewhere."""
    check_name(path)
    return _URL.fullmatch(str(path)) is not None


def url_of(path: StrPath) -> str:
    """Return the URL that a path was made of: "s3://bucket/a.png" for ``Path("s3:/bucket/a.png")``."""
    url = _URL.fullmatch(str(path))
    return f"{url[1]}://{url[2]}" if url else str(path)


@contextmanager
def elsewhere(path: StrPath, done: str = "read") -> Iterator[tuple[Any, str]]:
    """Give the file system of a URL and the place in it; errors in the block become an `OSError` of one line."""
    url = url_of(path)
    try:
        from fsspec.core import url_to_fs

        files, place = url_to_fs(url)
    except (ImportError, ValueError) as error:  # of fsspec, or of s3fs, gcsfs, aiohttp; or no such scheme
        is_fsspec = isinstance(error, ImportError) and error.name == "fsspec"
        said = f"needs {needs('fsspec', 'remote')}" if is_fsspec else f"cannot be opened ({one_line(error)})"
        raise OSError(f"{url}: {said}") from error
    try:
        yield files, str(place)
    except Exception as error:  # file systems raise errors of many libraries
        raise OSError(f"{url}: cannot be {done} ({one_line(error)})") from error


def exists(path: StrPath) -> bool:
    """Whether there is such a file, here or elsewhere; OSError if nothing answers."""
    if not is_remote(path):
        return Path(path).exists()
    with elsewhere(path) as (files, place):
        return bool(files.exists(place))


@contextmanager
def local_copy(path: StrPath) -> Iterator[Path]:
    """Give a file to read that is here: the file itself, or a copy, by whose URL errors in the block call it."""
    if not is_remote(path):
        yield Path(path)
        return
    from tempfile import TemporaryDirectory

    with TemporaryDirectory(prefix="cvtimg-") as folder:
        copy = Path(folder, Path(path).name)
        with elsewhere(path) as (files, place):
            if IS_ONE.fullmatch(place) and files.isdir(place):
                files.get(f"{place}/", f"{copy}/", recursive=True)
            else:
                files.get_file(place, str(copy))
        try:
            yield copy
        except (OSError, ValueError) as error:
            # Kinds of ValueError, such as UnicodeDecodeError, cannot be made of a message alone.
            kind = type(error) if isinstance(error, OSError) else ValueError
            raise kind(str(error).replace(str(copy), url_of(path))) from error
