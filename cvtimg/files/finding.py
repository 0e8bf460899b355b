"""Find image files by path, folder or glob pattern."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from cvtimg.files.remote import find_remote, is_remote, url_of
from cvtimg.files.whole import StrPath

# Formats that Pillow identifies but cannot decode, or renders with an external program: Ghostscript should not run on
# untrusted PostScript.
NOT_RASTER = frozenset({"BUFR", "EPS", "GRIB", "HDF5", "MPEG", "WMF"})


def find_images(paths: StrPath | Iterable[StrPath]) -> list[Path]:
    """List image files given by paths, folders and glob patterns.

    Parameters
    ----------
    paths : path or iterable of paths
        Files are listed whatever their suffix. Folders are searched recursively for files with a suffix that Pillow
        reads; hidden files are skipped. Patterns with ``*``, ``?`` or ``[`` are expanded as in a shell, with ``**`` for
        any depth. URLs are found by fsspec.

    Returns
    -------
    list of Path
        In the given order, sorted within each folder or pattern, without duplicates.

    Raises
    ------
    FileNotFoundError
        If a path does not exist, a pattern matches nothing or a folder contains no image.

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
    if is_remote(path):
        return find_remote(url_of(path), image_suffixes())
    given = Path(path)
    if given.is_dir() and given.suffix.lower() != ".zarr":
        inside = sorted(
            file
            for file in given.rglob("*")
            if file.suffix.lower() in image_suffixes()
            and not any(part.startswith(".") for part in file.relative_to(given).parts)
            and file.is_file()
        )
        if not inside:
            raise FileNotFoundError(f"{path}: no images in this folder")
        return inside
    if given.exists():
        return [given]
    if not glob.has_magic(str(path)):
        raise FileNotFoundError(f"{path}: no such file")
    # Path.glob rejects absolute patterns and, unlike a shell, matches hidden files.
    matches = sorted(glob.glob(str(path), recursive=True))  # noqa: PTH207
    if not matches:
        raise FileNotFoundError(f"{path}: no file matches")
    return [file for match in matches for file in _expand(match)]


@lru_cache(maxsize=1)
def image_suffixes() -> frozenset[str]:
    """Return the suffixes of images that Pillow reads."""
    from PIL import Image  # imported late: writing a table does not need Pillow

    formats = Image.registered_extensions()
    return frozenset(suffix for suffix, name in formats.items() if name in Image.OPEN and name not in NOT_RASTER)
