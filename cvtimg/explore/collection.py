"""The settings of a tab for all pictures that are open: one archive of their results, made picture by picture."""

from __future__ import annotations

import zipfile
from pathlib import Path

from cvtimg._shared.choices import Json
from cvtimg.explore.controls import UnfitRequestError
from cvtimg.explore.store import Store
from cvtimg.explore.tabs import requested


def add_result(store: Store, asked: Json) -> Json:
    """Add the file ``output`` that the settings of a tab make of a picture to the archive, which the ``first`` empties.

    The archive lies on the disk, so that only one of them is in memory. Return the name of the file, and its size.
    """
    if asked.get("first"):
        store.archive.unlink(missing_ok=True)
    tab, request = requested(store, asked)
    name = Path(request.picture.name).name
    try:
        file = tab.exact(request).file(str(asked.get("output")))
    except (ValueError, TypeError, OSError, ImportError, MemoryError) as error:
        raise UnfitRequestError(f"{name}: {tab.worded(str(error))}") from error
    if file is None:
        raise UnfitRequestError(f"{name}: there is no such file of this picture")
    with zipfile.ZipFile(store.archive, "a") as archive:  # files are compressed already
        free = _free(file[0], archive.namelist())
        archive.writestr(free, file[1])
    return {"name": free, "bytes": len(file[1])}


def _free(name: str, taken: list[str]) -> str:
    """Return a name that no file has yet: pictures of two folders may have the same."""
    stem, dot, suffix = name.partition(".")
    number = 2
    while name in taken:
        name, number = f"{stem}-{number}{dot}{suffix}", number + 1
    return name
