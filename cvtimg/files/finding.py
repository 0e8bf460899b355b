"""Input files as people name them: files, folders and patterns."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from cvtimg.files.whole import StrPath

# Pillow names these but has no pixels for them, or runs another program to draw them: PostScript
# from a stranger would go through Ghostscript.
NOT_RASTER = frozenset({"BUFR", "EPS", "GRIB", "HDF5", "MPEG", "WMF"})


def find_images(paths: StrPath | Iterable[StrPath]) -> list[Path]:
    """List the pictures that files, folders and patterns name.

    Parameters
    ----------
    paths : path or iterable of paths
        A file stays, whatever its suffix. A folder stands for all files in it and below whose
        suffix Pillow reads, hidden ones left out. A pattern with ``*``, ``?`` or ``[`` stands for
        what it matches (``**`` for any depth), as if a shell had expanded it.

    Returns
    -------
    list of Path
        In the order given, sorted within a folder or pattern, each path once.

    Raises
    ------
    FileNotFoundError
        If a path does not exist, a pattern matches nothing or a folder has no picture.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for name in ("b.png", "a.jpg", "notes.txt"):
    ...         Path(folder, name).touch()
    ...     [path.name for path in find_images(folder)]
    ['a.jpg', 'b.png']
    """
    if isinstance(paths, (str, os.PathLike)):
        paths = [paths]
    return list(dict.fromkeys(found for path in paths for found in _expand(path)))


def _expand(path: StrPath) -> list[Path]:
    given = Path(path)
    if given.is_dir() and given.suffix.lower() != ".zarr":
        inside = sorted(
            file
            for file in given.rglob("*")
            if file.suffix.lower() in _picture_suffixes()
            and not any(part.startswith(".") for part in file.relative_to(given).parts)
            and file.is_file()
        )
        if not inside:
            raise FileNotFoundError(f"{path}: no picture in this folder")
        return inside
    if given.exists():
        return [given]
    if not glob.has_magic(str(path)):
        raise FileNotFoundError(f"{path}: no such file")
    # Path.glob takes no absolute pattern and, unlike a shell, matches hidden files.
    matches = sorted(glob.glob(str(path), recursive=True))  # noqa: PTH207
    if not matches:
        raise FileNotFoundError(f"{path}: no file matches")
    return [file for match in matches for file in _expand(match)]


@lru_cache(maxsize=1)
def _picture_suffixes() -> frozenset[str]:
    from PIL import Image  # late: who writes a table needs no Pillow

    formats = Image.registered_extensions()
    return frozenset(suffix for suffix, name in formats.items() if name in Image.OPEN and name not in NOT_RASTER)
