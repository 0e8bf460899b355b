"""Pictures that are open on the page, and what is computed of each once."""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cvtimg import energy_curve, read_image
from cvtimg._shared.choices import Json, SpaceName
from cvtimg._shared.types import Array, Bools, Bytes
from cvtimg.colors import ColorSamples, color_samples
from cvtimg.colors.places import without_idle_alpha
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.explore.controls import Swatches, UnfitRequestError
from cvtimg.explore.layers import Pixels, Window
from cvtimg.explore.outcomes import Code, call, safe_name
from cvtimg.pictures import Frames, ImageInfo, Pages, image_info, read_frames, read_pages
from cvtimg.pictures.formats.opening import Selection, selecting
from cvtimg.pictures.pages import one_page
from cvtimg.pictures.showing import natural_limits, shown, tint, usual_tints
from cvtimg.pictures.stacks import not_missing

#: Largest picture; its header is checked before pixels are decoded.
MOST_PIXELS = 1 << 27
#: Bytes that a pixel takes, with its colors, their sorting, and a result.
_BYTES = 48
#: Pixels of all pictures in memory together, but for the last, and of what is kept of each, such as samples of windows
#: and trees of segments, but for the last two; with its colors a picture takes 16 bytes for each.
HELD_PIXELS = 1 << 24
#: Colors of channels, as a page chooses them.
_TINTS = Swatches(name="tints", label="Colors of channels")
_MEASURING = ThreadPoolExecutor()  # of energy curves


def most_pixels() -> int:
    """Return how many pixels a picture may have: as many as free memory holds with what is computed of them."""
    import psutil

    return min(MOST_PIXELS, psutil.virtual_memory().available // _BYTES)


class Picture:
    """A picture that is open on the page: its key in requests, its name in commands, its file and its array.

    An animation, or a file of pages, has `frames`, and shows the first of them. A frame or page, counted from 1, is a
    picture of the same file. Of a file with channels, one is chosen, or all as one image in colors, or as they are.
    """

    def __init__(
        self, key: str, name: str, path: Path, *, whole: Picture | None = None, page: int = 0, chosen: Any = None
    ) -> None:
        self.key, self.name, self.path = key, name, path
        self.whole_file, self.page = whole, page  # of which it is a frame or a page
        self.channels: list[str] = whole.channels if whole else _channel_names(image_info(path))
        #: What is chosen of the channels: arguments of `read_pages`.
        self.chosen: Json = whole.chosen if whole else self._usual() if chosen is None else chosen
        channel, tints = self.chosen.get("channel"), self.chosen.get("composite")
        with selecting(Selection(channel=channel and f"{channel}", composite=tints and tuple(tints))):
            self._read()

    def _usual(self) -> Json:
        """Return the choice of channels that can be seen: all in colors, or as they are where these are bands."""
        is_seen = not self.channels or (len(self.channels) > 2 and "C" not in image_info(self.path).axes)
        return {} if is_seen else {"composite": [*usual_tints(len(self.channels))]}

    def _read(self) -> None:
        whole, path = self.whole_file, self.path
        header = replace(whole.header, frames=1) if whole else image_info(path)
        self.header: ImageInfo = header
        n_pixels, most = header.width * header.height * header.frames, most_pixels()
        if n_pixels > most:
            inside = f" in all {self.noun.lower()}s" if header.frames > 1 else ""
            said = f"{self.name} has {n_pixels:,} pixels{inside}; the page takes up to {most:,}, as far as memory"
            raise UnfitRequestError(f"{said} allows. Use the command line, which has --max-pixels, or a smaller image")
        readers: dict[str, Callable[[Path], Frames | Pages]] = {"pages": read_pages, "frames": read_frames}
        read = readers.get(header.kind)
        self.frames = read(path) if read else None
        if whole and isinstance(whole.frames, Pages):
            self.array = one_page(whole.frames, self.page)
        elif whole and whole.frames:
            self.array = whole.frames.images[self.page - 1]
            self.header = replace(header, has_alpha=self.array.shape[2:] == (4,))
        else:
            self.array = self.frames.images[0] if self.frames else read_image(path)
        self._lock = threading.Lock()
        self._kept: OrderedDict[Any, Any] = OrderedDict()
        self._curves: dict[str, Future[EnergyCurve]] = {}
        self._closed = False

    @property
    def noun(self) -> str:
        return "Page" if (self.whole_file or self).header.kind == "pages" else "Frame"

    @property
    def is_stack(self) -> bool:
        """Whether these are pages and nothing says of what: they may be versions of one image."""
        return isinstance(self.frames, Pages) and self.frames.axes == "Q"

    @property
    def words(self) -> list[str]:
        said = {name: ",".join(value) if name == "composite" else f"{value}" for name, value in self.chosen.items()}
        said |= {"page": f"{self.page}"} if self.page else {}
        return [safe_name(self.name), *(word for name, text in said.items() for word in (f"--{name}", text))]

    @property
    def pages_code(self) -> Code:
        """How all pages are read."""
        return call("cvtimg.pictures.read_pages", self.name, **self.chosen)

    @property
    def python(self) -> Code:
        if self.chosen:
            return Code(f"{self.pages_code}.images[{max(self.page - 1, 0)}]")
        return call("cvtimg.read_image", self.name, **({"page": self.page} if self.page else {}))

    def of_channels(self, channel: Any = 0, tints: Any = None) -> Picture:
        """Return the picture of a channel, from 1, of all as they are for -1, or for 0 of all in colors or as usual."""
        if not self.channels or not (channel or tints):
            return self
        number = len(self.channels)
        if not isinstance(channel, int) or not -1 <= channel <= number:
            raise UnfitRequestError(f"there is no channel {channel}")
        chosen: Json = {"channel": channel} if channel > 0 else {}
        if not channel:
            if len(listed := _TINTS.parse(tints)) != number:
                raise UnfitRequestError(f"there must be {number} colors of channels")
            chosen = {"composite": [*usual_tints(number)] if listed == _usual_hexes(number) else [*listed]}
        return self.choosing(chosen)

    def choosing(self, chosen: Json) -> Picture:
        """Return the picture that a choice of channels gives."""
        if chosen == self.chosen or not self.channels:
            return self
        key = f"{self.key}/{chosen}"
        return self.kept(key, lambda: Picture(key, self.name, self.path, chosen=chosen))

    def frame(self, number: int) -> Picture:
        """Return a frame or a page; of other pictures the picture itself."""
        if self.frames is None:
            return self
        if not 0 <= number < len(self.frames.images):
            raise UnfitRequestError(f"there is no {self.noun.lower()} {number + 1}")
        key = f"{self.key}/{number}"
        return self.kept(key, lambda: Picture(key, self.name, self.path, whole=self, page=number + 1))

    @property
    def size(self) -> tuple[int, int]:
        return self.array.shape[0], self.array.shape[1]

    @property
    def stem(self) -> str:
        """Name of the file without folder and suffix, with the number of the frame or page."""
        at = {"channel": self.chosen.get("channel"), self.noun.lower(): self.page}
        return Path(self.name).stem + "".join(f"-{name}-{number}" for name, number in at.items() if number)

    @cached_property
    def has_alpha(self) -> bool:
        """Whether the last channel is transparency, and some pixels are not opaque."""
        return self.declares_alpha and self.plain.shape[2:] == (4,)

    @property
    def declares_alpha(self) -> bool:
        return self.header.has_alpha and self.array.shape[2:] == (4,)

    @cached_property
    def plain(self) -> Array:
        """The array, without transparency where all pixels are opaque."""
        return without_idle_alpha(self.array) if self.declares_alpha else self.array

    @cached_property
    def known(self) -> Bools | None:
        """(H, W) pixels that have a value; None for all."""
        known = not_missing(self.array, self.header.nodata, has_alpha=self.has_alpha)
        return None if known.all() else known

    @cached_property
    def samples(self) -> ColorSamples:
        return self._samples_in(self.whole(MOST_PIXELS))

    def whole(self, most: int) -> Window:
        """Return the window of the whole picture with at most the given number of pixels."""
        return Window.of(None, self.size, most)

    def samples_in(self, window: Window) -> ColorSamples:
        """Colors of a window; those of the last ones are kept."""
        if window == self.whole(MOST_PIXELS):
            return self.samples
        return self.kept(window, lambda: self._samples_in(window))

    def _samples_in(self, window: Window) -> ColorSamples:
        mask = None if self.known is None else window.of_array(self.known)
        if mask is not None and not mask.any():
            raise UnfitRequestError("nothing to see here: all pixels of this part are left out")
        return color_samples(window.of_array(self.plain), alpha=self.has_alpha, mask=mask)

    def kept(self, key: object, make: Callable[[], Any]) -> Any:
        """Return something made before, or make it; only the last few are kept."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        made = make()
        with self._lock:
            self._kept[key] = made
            while len(self._kept) > max(2, HELD_PIXELS // math.prod(self.size)):
                self._kept.popitem(last=False)
        return made

    def curve(self, space: SpaceName, *, wait: bool) -> EnergyCurve | None:
        """Return the energy curve; without `wait`, None until it is there. It is computed in the background."""
        with self._lock:
            if space not in self._curves:
                self._curves[space] = _MEASURING.submit(self._measured, space)
            curve = self._curves[space]
        with suppress(Exception):  # who waits for the curve is told that there is none
            return curve.result(None if wait else 0)
        return None

    def _measured(self, space: SpaceName) -> EnergyCurve:
        return energy_curve(self.samples, space=space, callback=lambda step, energy: self._closed)

    def close(self, *, wait_for: bool = True) -> None:
        """End what is computed in the background; by default, wait for that."""
        self._closed = True
        if wait_for:
            wait(list(self._curves.values()))

    @cached_property
    def _limits(self) -> tuple[float, float]:
        bands = self._bands(self.plain)
        return natural_limits(bands if self.known is None else bands[self.known])

    def _bands(self, pixels: Array) -> Array:
        bands = pixels[..., None] if self.plain.ndim == 2 else pixels
        return bands if self.has_alpha else bands[..., :3]

    def seen(self, window: Window) -> Pixels:
        return Pixels(shown(self._bands(window.of_array(self.plain)), self._limits))

    def colors_seen(self, colors: Array, *, alpha: bool) -> Bytes:
        """Return (K, C) colors in the units of the picture as (K, 4) uint8 colors to show."""
        bands = colors if alpha else colors[:, :3]
        if bands.shape[1] == 2:  # gray and alpha
            bands = bands[:, [0, 0, 0, 1]]
        rows = shown(np.ascontiguousarray(bands), self._limits)
        rgba = np.full((len(rows), 4), 255, np.uint8)
        rgba[:, : rows.shape[1]] = rows
        return rgba

    def described(self) -> Json:
        return {
            "id": self.key,
            "name": Path(self.name).name,
            "path": self.name,
            "bytes": self.path.stat().st_size,
            "width": self.size[1],
            "height": self.size[0],
            "frames": len(self.frames.images) if self.frames else 1,
            "noun": self.noun,
            "channels": self.channels,
            "channel": 0 if self.chosen else -1,
            "bands": not self.chosen,
            "tints": _usual_hexes(len(self.channels)),
            "durations": getattr(self.frames, "durations", None),
            "exact": self.array.dtype == np.uint8,
        }


def _channel_names(header: ImageInfo) -> list[str]:
    """Return the names of the channels of a file, or their numbers; nothing for one channel, and for colors."""
    along = header.axes.find("C")
    n_channels = header.shape[along] if along >= 0 else len(header.bands) if header.bands[0] == "B1" else 1
    names = header.channels if len(header.channels) == n_channels else range(1, n_channels + 1)
    return [f"{name}" for name in names] if n_channels > 1 else []


def _usual_hexes(n_channels: int) -> tuple[str, ...]:
    return tuple(f"#{bytes(tint(name)).hex()}" for name in usual_tints(n_channels))
