"""Pictures that are open on the page, and what is computed of each once."""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, wait
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from importlib import import_module
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import numpy as np

from cvtimg import energy_curve, read_image
from cvtimg._shared.choices import Json, SpaceName
from cvtimg._shared.types import Array, Bools, Bytes
from cvtimg.colors import ColorSamples, color_samples
from cvtimg.colors.places import without_idle_alpha
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.explore.calls import Code, call
from cvtimg.explore.controls import UnfitRequestError
from cvtimg.explore.layers import Pixels, Window
from cvtimg.explore.outcomes import safe_name
from cvtimg.pictures import Frames, ImageInfo, Pages, image_info, read_frames, read_pages
from cvtimg.pictures.pages import one_page
from cvtimg.pictures.showing import natural_limits, shown
from cvtimg.pictures.stacks import not_missing

#: Largest picture; its header is checked before pixels are decoded.
MOST_PIXELS = 1 << 27
#: Bytes that a pixel takes, with its colors, their sorting, and a result.
_BYTES = 48
#: Length of the energy curve, and pixels of the picture in a small size, which searches for drafts use.
N_CURVE = 64
SMALL = 1 << 18
#: What results import for a second or so, in the background before they are wanted.
_IMPORTED = ("scipy.ndimage", "scipy.optimize", "scipy.spatial", "skimage.color", "skimage.measure", "scipy.stats")
#: Colors of channels that are shown together, in the order of Fiji; of two they are those that all people tell apart.
_TINTS = {
    "red": (1, 0, 0),
    "green": (0, 1, 0),
    "blue": (0, 0, 1),
    "white": (1, 1, 1),
    "cyan": (0, 1, 1),
    "magenta": (1, 0, 1),
    "yellow": (1, 1, 0),
}
#: Samples of windows, and trees of segments, that are kept, and pixels of all of them but the last two.
_KEPT, _MOST_KEPT = 4, 1 << 24


def most_pixels() -> int:
    """Return how many pixels a picture may have: as many as free memory holds with what is computed of them."""
    import psutil

    free: int = psutil.virtual_memory().available
    return min(MOST_PIXELS, free // _BYTES)


class Picture:
    """A picture that is open on the page: its key in requests, its name in commands, its file and its array.

    An animation, or a file of pages, has `frames`, and shows the first of them. A frame or page, counted from 1, is a
    picture of the same file, and so is a channel of a page, where each has a page of its own.
    """

    def __init__(
        self, key: str, name: str, path: Path, *, whole: Picture | None = None, page: int = 0, channel: int = 0
    ) -> None:
        self.key, self.name, self.path = key, name, path
        self.whole_file, self.page, self.channel = whole, page, channel  # of which it is a frame or a page
        header = replace(whole.header, frames=1) if whole else image_info(path)
        self.header: ImageInfo = header
        n_pixels, most = header.width * header.height * header.frames, most_pixels()
        if n_pixels > most:
            inside = f" in all {self.noun.lower()}s" if header.frames > 1 else ""
            said = f"{name} has {n_pixels:,} pixels{inside}; the page takes up to {most:,}, as far as memory allows"
            raise UnfitRequestError(f"{said}. Use the command line, which has --max-pixels, or a smaller image")
        self.frames: Frames | Pages | None = None
        if header.kind == "pages":
            self.frames = read_pages(path).joined()
        elif header.kind == "frames":
            self.frames = read_frames(path)
        if whole and isinstance(whole.frames, Pages):
            self.array = one_page(whole.frames, page)[..., channel - 1] if channel else one_page(whole.frames, page)
        elif whole and whole.frames:
            self.array = whole.frames.images[page - 1]
            self.header = replace(header, has_alpha=self.array.shape[2:] == (4,))
        else:
            self.array = self.frames.images[0] if self.frames else read_image(path)
        self.n_bytes = path.stat().st_size
        self._lock = threading.Lock()
        self._kept: OrderedDict[Any, Any] = OrderedDict()
        self._curves: dict[str, Future[EnergyCurve]] = {}
        self._closed = False

    @property
    def noun(self) -> str:
        return "Page" if (self.whole_file or self).header.kind == "pages" else "Frame"

    @property
    def channels(self) -> list[str]:
        """Names of channels that lie on pages of their own, which few commands read together."""
        pages = (self.whole_file or self).frames
        if not (isinstance(pages, Pages) and pages.is_joined):
            return []
        n_channels = pages.images[0].shape[2]
        named = len(pages.channels) == n_channels
        return list(pages.channels) if named else [f"{number + 1}" for number in range(n_channels)]

    @property
    def place(self) -> Mapping[str, int]:
        """Where a page is: by "page", or of a channel by the axes of the stack."""
        if self.channel and self.whole_file and isinstance(self.whole_file.frames, Pages):
            pages = self.whole_file.frames
            return {**(pages.places[self.page - 1] if len(pages.images) > 1 else {}), "channel": self.channel}
        return {"page": self.page} if self.page else {}

    @property
    def words(self) -> list[str]:
        return [safe_name(self.name), *(word for name, at in self.place.items() for word in (f"--{name}", f"{at}"))]

    @property
    def python(self) -> Code:
        if self.channel:
            pages = call("cvtimg.pictures.read_pages", self.name)
            return Code(f"{pages}.joined().images[{self.page - 1}][..., {self.channel - 1}]")
        return call("cvtimg.read_image", self.name, **self.place)

    def frame(self, number: int, channel: int = 0) -> Picture:
        """Return a frame or a page, or a channel of it, from 1; of other pictures the picture itself."""
        if self.frames is None:
            return self
        if not 0 <= number < len(self.frames.images):
            raise UnfitRequestError(f"there is no {self.noun.lower()} {number + 1}")
        if not 0 <= channel <= len(self.channels):
            raise UnfitRequestError(f"there is no channel {channel}")
        about: Json = {"whole": self, "page": number + 1, "channel": channel}
        key = f"{self.key}/{number}/{channel}"
        picture: Picture = self.kept(key, lambda: Picture(key, self.name, self.path, **about))
        return picture

    @property
    def size(self) -> tuple[int, int]:
        return self.array.shape[0], self.array.shape[1]

    @property
    def stem(self) -> str:
        """Name of the file without folder and suffix, with the number of the frame or page."""
        return Path(self.name).stem + "".join(f"-{name}-{at}" for name, at in self._numbers.items())

    @property
    def _numbers(self) -> Mapping[str, int]:
        return {self.noun.lower(): self.page} if self.page and not self.channel else self.place

    @cached_property
    def has_alpha(self) -> bool:
        """Whether the last channel is transparency, and some pixels are not opaque."""
        return self.header.has_alpha and self.plain.shape[2:] == (4,)

    @cached_property
    def plain(self) -> Array:
        """The array, without transparency where all pixels are opaque."""
        declared = self.header.has_alpha and self.array.shape[2:] == (4,)
        return without_idle_alpha(self.array) if declared else self.array

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
            while len(self._kept) > max(2, min(_KEPT, _MOST_KEPT // math.prod(self.size))):
                self._kept.popitem(last=False)
        return made

    def curve(self, space: SpaceName, *, wait: bool) -> EnergyCurve | None:
        """Return the energy curve; without `wait`, None until it is there. It is computed in the background."""
        with self._lock:
            if space not in self._curves:
                self._curves[space] = Future()
                threading.Thread(target=self._measure, args=(space,), daemon=True).start()
            curve = self._curves[space]
        with suppress(Exception):  # who waits for the curve is told that there is none
            return curve.result(None if wait else 0)
        return None

    def _measure(self, space: SpaceName) -> None:
        curve = self._curves[space]
        try:
            energies = energy_curve(self.samples, N_CURVE, space=space, callback=lambda step, energy: self._closed)
            curve.set_result(energies)
        except Exception as error:
            curve.set_exception(error)
        for name in _IMPORTED:
            import_module(name)

    def close(self, *, wait_for: bool = True) -> None:
        """End what is computed in the background; by default, wait for that."""
        self._closed = True
        if wait_for:
            wait(list(self._curves.values()))

    @property
    def tints(self) -> Sequence[str]:
        """Names of the colors in which all channels are shown together."""
        n_channels = 0 if self.channel else len(self.channels)
        return ("green", "magenta") if n_channels == 2 else [*islice(cycle(_TINTS), n_channels)]

    @cached_property
    def _limits(self) -> list[tuple[float, float]]:
        """The range of all bands, or, of channels in colors, of each."""
        bands = self._bands(self.plain)
        values = bands if self.known is None else bands[self.known]
        return [natural_limits(values[..., [n]]) for n in range(len(self.tints))] or [natural_limits(values)]

    def _shown(self, bands: Array) -> Bytes:
        if not self.tints:
            return shown(bands, self._limits[0])
        levels = [np.interp(bands[..., n], limits, (0.0, 255.0)) for n, limits in enumerate(self._limits)]
        colors = np.stack(levels, axis=-1) @ [_TINTS[name] for name in self.tints]
        return np.rint(colors.clip(0, 255)).astype(np.uint8)

    def _bands(self, pixels: Array) -> Array:
        bands = pixels[..., None] if self.plain.ndim == 2 else pixels
        return bands if self.has_alpha or self.tints else bands[..., :3]

    def seen(self, window: Window) -> Pixels:
        return Pixels(self._shown(self._bands(window.of_array(self.plain))))

    def colors_seen(self, colors: Array, *, alpha: bool) -> Bytes:
        """Return (K, C) colors in the units of the picture as (K, 4) uint8 colors to show."""
        bands = colors if alpha or self.tints or colors.shape[1] <= 3 else colors[:, :3]
        if bands.shape[1] == 2 and not self.tints:  # gray and alpha
            bands = bands[:, [0, 0, 0, 1]]
        rows = self._shown(np.ascontiguousarray(bands))
        rgba = np.full((len(rows), 4), 255, np.uint8)
        rgba[:, : rows.shape[1]] = rows
        return rgba

    def described(self) -> Json:
        about = {"id": self.key, "name": Path(self.name).name, "path": self.name, "bytes": self.n_bytes}
        return {
            **about,
            "width": self.size[1],
            "height": self.size[0],
            "frames": len(self.frames.images) if self.frames else 1,
            "noun": self.noun,
            "channels": self.channels,
            "tints": self.tints,
            "durations": getattr(self.frames, "durations", None),
            "exact": self.array.dtype == np.uint8,
        }
