"""What is open on a server: pictures, palettes and results, within limits."""

import math
import os
import secrets
import shlex
import shutil
import tempfile
import threading
from collections import OrderedDict
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

import numpy as np
import PIL
from PIL import Image

from cvtimg import read_palette, write_image
from cvtimg._shared.budgets import ENOUGH_SAMPLES
from cvtimg._shared.choices import Json
from cvtimg._shared.messages import one_line
from cvtimg._shared.types import Bytes
from cvtimg.explore.controls import LONGEST_TEXT, UnfitRequestError, is_number
from cvtimg.explore.opened import HELD_PIXELS, Picture, most_pixels
from cvtimg.explore.outcomes import FOLDERS, Code, Line, Outcome, as_python, call, own_prefix, run
from cvtimg.palettes.files import known_palettes
from cvtimg.pictures.formats.encoding import encode_image

#: Largest file that is taken.
MOST_BYTES = 1 << 28
#: Pictures in memory.
_MOST_PICTURES = 12
#: Bytes of all files that pages send together, which lie on the disk.
_MOST_SENT = 1 << 32
#: Greatest width and height of a thumbnail.
_SMALL = (144, 96)

#: Palettes that are always there, by their names.
KNOWN = {name: (name, colors) for name, colors in known_palettes().items()}


class Entry(NamedTuple):
    """A picture that is open, in memory or not: its name and its file, what the page shows of it, and a small PNG."""

    name: str
    path: Path
    about: Json
    thumbnail: bytes


class Store:
    """Pictures, palettes and results by key.

    Of pictures the last few are held in memory; the others are opened again when they are needed. Results go when their
    page has a newer one. Files that a page sends lie in a folder of their own under names that the server makes up.
    """

    def __init__(self) -> None:
        _remove_left()
        self._folder = tempfile.TemporaryDirectory(prefix=own_prefix())
        self.archive = Path(self._folder.name, "results.zip")  # of results for all pictures
        self._pictures: OrderedDict[str, Picture] = OrderedDict()
        self._entries: dict[str, Entry] = {}
        self.lines: dict[str, str] = {}  # of Python that make a picture
        self._palettes: dict[str, tuple[str, Bytes]] = {}
        self.results: WeakValueDictionary[str, Outcome] = WeakValueDictionary()  # as long as a page holds them
        self.newest: Outcome | None = None  # which outlives its page
        self._lock = threading.Lock()

    def close(self) -> None:
        """End what is computed in the background, and remove the files that were sent."""
        for picture in self._pictures.values():
            picture.close()
        self._folder.cleanup()

    def forget(self) -> Json:
        """Forget all that was opened and made; files of the command line can be opened again."""
        with self._lock:
            self._pictures.clear()
            self._entries.clear()
            self._palettes.clear()
            self.results.clear()
            for file in Path(self._folder.name).iterdir():
                file.unlink()
        return {}

    def picture(self, key: str) -> Picture:
        with self._lock:
            if key in self._pictures:
                self._pictures.move_to_end(key)
                return self._pictures[key]
        entry = self.entry(key)
        return self._add(entry.name, entry.path, key)

    def entry(self, key: str) -> Entry:
        """Return what is known of a picture, which need not be in memory."""
        if key not in self._entries:
            raise UnfitRequestError("this image is no longer open; open it again")
        return self._entries[key]

    def palette(self, keys: Sequence[str]) -> tuple[str, Bytes]:
        """Return the name and the colors of the palette that was chosen."""
        if not keys:
            raise UnfitRequestError("choose a palette, or open a file that has one")
        if known := self._palettes.get(keys[0], KNOWN.get(keys[0])):
            return known
        raise UnfitRequestError("this palette is no longer open; open it again")

    def key_of(self, path: Path) -> str:
        """Return the key of a picture of the command line, which is opened once; pages share it."""
        with self._lock:
            same = next((key for key, entry in self._entries.items() if entry.path == path), None)
        return same or self._add(str(path), path, secrets.token_hex(8)).key

    def open_sent(self, name: str, content: bytes) -> Json:
        name = _plain(name)
        held = sum(file.stat().st_size for file in Path(self._folder.name).iterdir() if file != self.archive)
        if held + len(content) > _MOST_SENT:
            way = "Keys has Forget all, and files that are named on the command line do not count"
            raise UnfitRequestError(f"{name}: {_MOST_SENT / 1e9:.1f} GB are open, as much as the page takes; {way}")
        path = self._stored(name, content)
        try:
            return self._opened(name, path)
        except Exception:
            path.unlink()
            raise

    def resized(self, picture: Picture, width: Any) -> Json:
        """Open a picture in another width by Pillow, made by lines that come before those of its results."""
        height = round(picture.size[0] * width / picture.size[1]) if is_number(width) and 1 <= width <= 1 << 15 else 0
        if picture.array.dtype != np.uint8 or picture.array.shape[2:] not in ((), (3,), (4,)):
            raise UnfitRequestError("only gray images and those of colors, of 8 bits, are resized")
        if height < 1 or height * width > most_pixels():
            raise UnfitRequestError("the width must be a number of pixels that leaves a height, and fits in memory")
        size = f"({int(width)}, {height}), PIL.Image.Resampling.LANCZOS"
        name = f"{picture.stem}-{int(width)}.png"
        lines = [
            Line("image", picture.python, picture.array),
            Line("small", Code(f"numpy.array(PIL.Image.fromarray(image).resize({size}))")),
        ]
        path = self._stored(name, b"")
        write_image(path, run(lines, {"PIL": PIL})["small"], overwrite=True)
        about = self._opened(name, path)
        self.lines[about["id"]] = as_python(lines, call("cvtimg.write_image", name, Code("small")))
        return about

    def _opened(self, name: str, path: Path) -> Json:
        return self.entry(self._add(name, path, secrets.token_hex(8)).key).about

    def _add(self, name: str, path: Path, key: str) -> Picture:
        try:
            picture = Picture(key, name, path)
            entry = self._entries.get(key) or Entry(name, path, picture.described(), _small(picture))
        except (OSError, ValueError, MemoryError) as error:
            raise UnfitRequestError(_reason(path, error, name)) from error
        with self._lock:
            self._entries[key], self._pictures[key] = entry, picture
            held, n_pixels = self._pictures, [math.prod(opened.size) for opened in self._pictures.values()]
            while len(held) > _MOST_PICTURES or (len(held) > 1 and sum(n_pixels[-len(held) :]) > HELD_PIXELS):
                held.popitem(last=False)[1].close(wait_for=False)
        return picture

    def open_palette(self, name: str, content: bytes) -> Json:
        """Open a palette that a page sent; return its key, name and colors."""
        name, path = _plain(name), self._stored(name, content)
        try:
            colors = read_palette(path)
        except (OSError, ValueError) as error:
            raise UnfitRequestError(_reason(path, error, name)) from error
        finally:
            path.unlink()
        if len(colors) > 1 << 12:
            raise UnfitRequestError(f"{name} has {len(colors)} colors; a palette has up to {1 << 12}")
        key = secrets.token_hex(8)
        self._palettes[key] = name, colors
        return {"id": key, "name": name, "colors": [f"#{bytes(color[:3]).hex()}" for color in colors]}

    def _stored(self, name: str, content: bytes) -> Path:
        suffix = Path(_plain(name)).suffix.lower()
        known = suffix if suffix[1:].isalnum() and len(suffix) <= 9 else ""
        path = Path(self._folder.name, secrets.token_hex(8) + known)
        path.write_bytes(content)
        return path


def _small(picture: Picture) -> bytes:
    small = Image.fromarray(picture.seen(picture.whole(ENOUGH_SAMPLES)).pixels.squeeze())
    small.thumbnail(_SMALL)
    return encode_image(".png", np.asarray(small))


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
    return seen[-LONGEST_TEXT:] or "picture"


def _reason(path: Path, error: Exception, name: str) -> str:
    """Return why a file cannot be used, with the name that a person knows for the one that it has here."""
    why = one_line(error).replace(f"{path}: ", "").replace(str(path), shlex.quote(name))
    return f"{name}: " + why.replace("--max-pixels raises it", "the command line has --max-pixels")
