"""Arrays in one .npz file with a tag that says what they are: saved whole, and read back from the same place."""

from collections.abc import Iterable

import numpy as np

from cvtimg._shared.choices import Options
from cvtimg._shared.messages import one_line
from cvtimg._shared.types import Array
from cvtimg.files.remote import local_copy, url_of
from cvtimg.files.whole import StrPath, whole_file

#: Name of the tag among the arrays; and the version in it, which rises when older programs must not read them.
_TAG, _VERSION = "format", 1


class UnfitArraysError(OSError, ValueError):
    """The content of a file is not what it should be."""


def save_arrays(
    path: StrPath, kind: str, arrays: Options, *, compressed: bool = False, overwrite: bool = False
) -> None:
    """Write arrays to a NumPy .npz file, whole or not at all, with a tag that says what they are, such as "basis"."""
    write = np.savez_compressed if compressed else np.savez
    with whole_file(path, overwrite=overwrite) as file:
        write(file, **{_TAG: f"cvtimg {kind} {_VERSION}", **arrays})


def load_arrays(path: StrPath, kind: str, names: Iterable[str]) -> dict[str, Array]:
    """Read arrays that `save_arrays` wrote; `UnfitArraysError` says that the file holds something else."""
    wanted = f"cvtimg {kind} {_VERSION}"
    try:
        with local_copy(path) as copy, copy.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            tag = str(stored[_TAG]) if _TAG in stored else "file without a tag"
            arrays_of_file = {name: stored[name] for name in names} if tag == wanted else {}
    except OSError:
        raise
    except Exception as error:  # zipfile, zlib and NumPy raise many kinds of errors for damaged files
        raise UnfitArraysError(f"{url_of(path)}: is not a {kind} ({one_line(error)})") from error
    if tag != wanted:
        raise UnfitArraysError(f"{url_of(path)}: is not a {kind} that this version reads, but a {tag}")
    return arrays_of_file
