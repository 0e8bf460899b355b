"""Find image files by path, folder or glob pattern."""

import glob
import os
import re
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

from cvtimg.files.remote import IS_ONE, StrPath, elsewhere, is_remote, url_of

# Formats that Pillow identifies but cannot decode, or renders with an external program: Ghostscript should not run on
# untrusted PostScript.
NOT_RASTER = frozenset({"BUFR", "EPS", "GRIB", "HDF5", "MPEG", "WMF"})
#: Ends of the names of outputs that lie beside their inputs: those of this package, and the masks of Cellpose.
_OUTPUTS = re.compile(r"(.+)(?:-(?:labels|overlay|edges|mean|strengths|masks|mosaic)|_cp_masks)")


def find_images(paths: StrPath | Iterable[StrPath]) -> list[Path]:
    """List image files given by paths, folders and glob patterns, without duplicates.

    Files are listed whatever their suffix. Folders are searched recursively for files with a suffix that Pillow reads;
    hidden files are skipped, and outputs, such as ``a-labels.png`` beside ``a.jpg``. Patterns with ``*``, ``?`` or
    ``[`` are expanded as in a shell, with ``**`` for any depth. URLs are found by fsspec. The order is the given one,
    and sorted within each folder or pattern. `FileNotFoundError` names what finds none, and `ValueError` refuses an
    empty name.

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
    return list(dict.fromkeys(file for path in paths for file in _expand(path)))


def _expand(path: StrPath) -> list[Path]:
    if is_remote(path):
        return find_remote(url_of(path), image_suffixes())
    given = Path(path)
    if given.is_dir() and given.suffix.lower() != ".zarr":
        known = (file for file in given.rglob("*") if file.suffix.lower() in image_suffixes() and file.is_file())
        inside = sorted(file for file in known if "/." not in f"/{file.relative_to(given).as_posix()}")
        if not inside:
            raise FileNotFoundError(f"{path}: no images in this folder")
        inputs = {file.with_suffix("") for file in inside}
        names = ((file, _OUTPUTS.fullmatch(file.stem)) for file in inside)
        return [file for file, name in names if not (name and file.with_name(name[1]) in inputs)]
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


def find_remote(url: str, suffixes: frozenset[str]) -> list[Path]:
    """List the files that a URL names: itself, those that a pattern matches, or those in a folder with such suffixes.

    FileNotFoundError says that there is none, and OSError that nothing answers.
    """
    with elsewhere(url) as (files, place):
        if glob.has_magic(place):
            matches = [name for name in files.glob(place) if IS_ONE.fullmatch(name) or not files.isdir(name)]
        elif IS_ONE.fullmatch(place) or Path(place).suffix.lower() in suffixes or not files.isdir(place):
            matches = [place] if _is_there(files, place) else []
        else:
            inside = ((IS_ONE.match(str(name)) or [str(name)])[0] for name in files.find(place))
            matches = [name for name in dict.fromkeys(inside) if Path(name).suffix.lower() in suffixes]
        paths = [Path(files.unstrip_protocol(name)) for name in sorted(matches)]
    if not paths:
        raise FileNotFoundError(f"{url}: no such file")
    return paths


def _is_there(files: Any, place: str) -> bool:
    try:
        return bool(files.info(place))
    except FileNotFoundError as error:  # of HTTP also where there is no answer, which is then its cause
        if error.__cause__ is not None and not isinstance(error.__cause__, FileNotFoundError):
            raise error.__cause__ from error
        return False
