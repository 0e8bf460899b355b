"""What is open on a server: pictures, palettes and results, within limits."""

from __future__ import annotations

import os
import secrets
import shutil
import tempfile
import threading
from collections import OrderedDict
from collections.abc import Sequence
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import TypeVar

from PIL import Image

from cvtimg import read_palette
from cvtimg._shared.choices import Json
from cvtimg._shared.messages import one_line
from cvtimg._shared.types import Bytes
from cvtimg.explore.controls import UnfitRequestError
from cvtimg.explore.opened import Picture
from cvtimg.explore.outcomes import FOLDERS, Outcome, own_prefix
from cvtimg.palettes.known import known_palettes

#: Largest file that is taken.
MOST_BYTES = 1 << 28
#: Pictures in memory, palettes and results that are held.
_MOST_PICTURES, _MOST_PALETTES, _MOST_RESULTS = 12, 32, 24
#: Bytes of all files that pages send together, which lie on the disk.
_MOST_SENT = 1 << 32
#: Pixels of all pictures in memory together; a picture takes about 12 bytes for each.
_MOST_PIXELS = 1 << 28
#: Greatest width and height of a thumbnail, and pixels of the picture that it is made of.
_SMALL, _ENOUGH = (144, 96), 1 << 18
#: Longest name that is kept.
_LONGEST_NAME = 120

#: Palettes that are always there, by their names.
KNOWN = {name: (name, colors) for name, colors in known_palettes().items()}

T = TypeVar("T")


class Store:
    """Pictures, palettes and results by key.

    Of pictures the last few are held in memory; the others are opened again when they are needed. Of palettes and
    results the oldest go when there are too many. Files that a page sends lie in a folder of their own under names that
    the server makes up.
    """

    def __init__(self) -> None:
        _remove_left()
        self._folder = tempfile.TemporaryDirectory(prefix=own_prefix())
        self.archive = Path(self._folder.name, "results.zip")  # of results for all pictures
        self._pictures: OrderedDict[str, Picture] = OrderedDict()
        self._files: dict[str, tuple[str, Path]] = {}  # name and file of each picture, in memory or not
        self._thumbnails: dict[str, bytes] = {}
        self._palettes: OrderedDict[str, tuple[str, Bytes]] = OrderedDict()
        self._results: OrderedDict[str, Outcome] = OrderedDict()
        self._lock = threading.Lock()

    def close(self) -> None:
        """End what is computed in the background, and remove the files that were sent."""
        for picture in self._pictures.values():
            picture.close()
        self._folder.cleanup()

    def forget(self) -> None:
        """Forget all that was opened and made; files of the command line can be opened again."""
        with self._lock:
            for kept in (self._pictures, self._files, self._thumbnails, self._palettes, self._results):
                kept.clear()
            for file in Path(self._folder.name).iterdir():
                file.unlink()

    def picture(self, key: str) -> Picture:
        with self._lock:
            if key in self._pictures:
                self._pictures.move_to_end(key)
                return self._pictures[key]
        if key not in self._files:
            raise UnfitRequestError("this image is no longer open; open it again")
        return self._add(*self._files[key], key)

    def thumbnail(self, key: str) -> bytes:
        """Return a small picture as PNG, which is made once."""
        if key not in self._thumbnails:
            picture = self.picture(key)
            small = Image.fromarray(picture.seen(picture.whole(_ENOUGH)).pixels.squeeze())
            small.thumbnail(_SMALL)
            stream = BytesIO()
            small.save(stream, "PNG")
            with self._lock:
                self._thumbnails[key] = stream.getvalue()
        return self._thumbnails[key]

    def palette(self, keys: Sequence[str]) -> tuple[str, Bytes]:
        """Return the name and the colors of the palette that was chosen."""
        if not keys:
            raise UnfitRequestError("choose a palette, or open a file that has one")
        if known := self._palettes.get(keys[0], KNOWN.get(keys[0])):
            return known
        raise UnfitRequestError("this palette is no longer open; open it again")

    def open_file(self, path: Path) -> Picture:
        """Open a picture of the command line; pages share it."""
        with self._lock:
            same = next((key for key, (_, file) in self._files.items() if file == path), None)
        return self.picture(same) if same else self._add(str(path), path, secrets.token_hex(8))

    def open_sent(self, name: str, content: bytes) -> Picture:
        held = sum(file.stat().st_size for file in Path(self._folder.name).iterdir() if file != self.archive)
        if held + len(content) > _MOST_SENT:
            raise UnfitRequestError(
                f"{_plain(name)}: {_MOST_SENT / 1e9:.1f} GB are open, as much as the page takes; "
                "Keys has Forget all, and files that are named on the command line do not count"
            )
        path = self._stored(name, content)
        try:
            picture = self._add(_plain(name), path, secrets.token_hex(8))
        except Exception:
            path.unlink()
            raise
        return picture

    def _add(self, name: str, path: Path, key: str) -> Picture:
        try:
            picture = Picture(key, name, path)
            picture.described()  # counts the colors
        except (OSError, ValueError, MemoryError) as error:
            raise UnfitRequestError(f"{name}: {_reason(path, error, _plain(name))}") from error
        with self._lock:
            self._files[key] = name, path
            self._pictures[key] = picture
            while len(self._pictures) > 1 and not self._fits():
                self._pictures.popitem(last=False)[1].close(wait_for=False)
        picture.curve("rgb", wait=False)
        return picture

    def _fits(self) -> bool:
        total = sum(picture.size[0] * picture.size[1] for picture in self._pictures.values())
        return len(self._pictures) <= _MOST_PICTURES and total <= _MOST_PIXELS

    def open_palette(self, name: str, content: bytes) -> Json:
        """Open a palette that a page sent; return its key, name and colors."""
        path = self._stored(name, content)
        try:
            colors = read_palette(path)
        except (OSError, ValueError) as error:
            raise UnfitRequestError(f"{_plain(name)}: {_reason(path, error, _plain(name))}") from error
        finally:
            path.unlink()
        if len(colors) > 1 << 12:
            raise UnfitRequestError(f"{_plain(name)} has {len(colors)} colors; a palette has up to {1 << 12}")
        key = secrets.token_hex(8)
        self._keep(self._palettes, key, (_plain(name), colors), _MOST_PALETTES)
        return {"id": key, "name": _plain(name), "colors": [f"#{bytes(color[:3]).hex()}" for color in colors]}

    def keep_result(self, outcome: Outcome) -> str:
        key = secrets.token_hex(8)
        self._keep(self._results, key, outcome, _MOST_RESULTS)
        return key

    def result(self, key: str) -> Outcome | None:
        return self._results.get(key)

    def _keep(self, kept: OrderedDict[str, T], key: str, value: T, most: int) -> None:
        with self._lock:
            kept[key] = value
            while len(kept) > most:
                kept.popitem(last=False)

    def _stored(self, name: str, content: bytes) -> Path:
        suffix = Path(_plain(name)).suffix.lower()
        known = suffix if suffix[1:].isalnum() and len(suffix) <= 9 else ""
        path = Path(self._folder.name, secrets.token_hex(8) + known)
        path.write_bytes(content)
        return path


def _remove_left() -> None:
    """Remove folders, and doors in the home folder, of servers of this user that were killed."""
    if os.name == "nt":  # where processes are not found by their numbers
        return
    import psutil

    places = [*Path(tempfile.gettempdir()).glob(f"{FOLDERS}*-*")]
    with suppress(RuntimeError):  # there is no home folder
        places += Path.home().glob(f"{FOLDERS}*-*.html")
    for left in places:
        number = left.name.removeprefix(FOLDERS).partition("-")[0]
        with suppress(OSError):
            if number.isdigit() and left.lstat().st_uid == os.getuid() and not psutil.pid_exists(int(number)):
                shutil.rmtree(left) if left.is_dir() else left.unlink()


def _plain(name: str) -> str:
    """Return the name of a file without folders, and without characters that cannot be seen."""
    last = name.replace("\\", "/").rpartition("/")[2]
    seen = "".join(letter for letter in last if letter.isprintable()).strip(". ")
    return seen[-_LONGEST_NAME:] or "picture"


def _reason(path: Path, error: Exception, name: str) -> str:
    """Return why a file cannot be used, with the name that a person knows for the one that it has here."""
    why = one_line(error).replace(f"{path}: ", "").replace(str(path), name)
    return why.replace("--max-pixels raises it", "the command line has --max-pixels")
