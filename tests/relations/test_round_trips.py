"""What is written is what is read: pictures, labels, palettes and contours; outputs are inputs that change no more."""

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from numpy.typing import NDArray
from relations.relation import quick_and_wide
from relations.remembering import beside
from relations.test_pictures import color_picture, gray_picture

import cvtimg
from cvtimg._shared.types import Array, Bytes, Ints
from cvtimg.pictures.pages import read_pages, write_pages
from cvtimg.pictures.tiles import Form, open_bands, write_bands

Indexed = tuple[Array, Bytes]


def again(write: Callable[[Path, Any], None], read: Callable[[Path], Any], name: str) -> Callable[[Any], Array]:
    def result(content: Any) -> Array:
        with tempfile.TemporaryDirectory() as folder:
            write(Path(folder) / name, content)
            return np.asarray(read(Path(folder) / name))

    return result


def deep(rng: np.random.Generator) -> NDArray[np.uint16]:
    return color_picture(rng).astype(np.uint16) * np.uint16(211) + np.uint16(7)


def of_type(name: str) -> Callable[[np.random.Generator], Array]:
    """Return what makes up to nine bands of all values of a type; one row could be bands to a .npy file."""

    def inputs(rng: np.random.Generator) -> Array:
        n_bands = int(rng.integers(1, 10))
        shape = (*rng.integers(10, 40, 2), *[n_bands] * (n_bands > 1))
        if name.startswith("float"):
            values = (rng.normal(size=shape) * 10.0 ** rng.integers(-30, 30)).astype(name)
            values[1, 2] = np.nan
            return values
        ends = np.iinfo(name)
        return rng.integers(ends.min, ends.max, shape, np.dtype(name).type, endpoint=True)

    return inputs


def stack(name: str) -> Callable[[np.random.Generator], Array]:
    """Return what makes pages, two or more."""

    def inputs(rng: np.random.Generator) -> Array:
        page = of_type(name)(rng)
        return np.stack([np.roll(page, number, axis=1) for number in range(rng.integers(2, 5))])

    return inputs


def opaque(rng: np.random.Generator, n_bands: int = 3) -> Indexed:
    """Return indices and their colors, one to 256."""
    colors = rng.integers(0, 256, (int(rng.integers(1, 257)), n_bands), np.uint8)
    kind = rng.choice(["uint8", "int32", "uint64"])
    return rng.integers(0, len(colors), rng.integers(1, 20, 2)).astype(kind), colors


def half_seen(rng: np.random.Generator) -> Indexed:
    """Return indices and colors of which one at least is not opaque."""
    indices, colors = opaque(rng, 4)
    colors[0, 3] = 10
    return indices, colors


def colored(indexed: Indexed) -> Bytes:
    return indexed[1][indexed[0]]


def write_indexed(path: Path, indexed: Indexed) -> None:
    cvtimg.write_image(path, indexed[0], palette=indexed[1])


def write_tiles(path: Path, image: Array) -> None:
    write_bands(path, Form(image.shape, image.dtype), [image])


def write_as_others(path: Path, image: Array, **how: Any) -> None:
    """Write a TIFF as other programs do."""
    bands = {"photometric": "minisblack", "planarconfig": "contig"} if image.ndim == 3 else {}
    tifffile.imwrite(path, image, **bands, **how)


def read_tiles(path: Path) -> Array:
    return np.concatenate(list(open_bands(path)))


def read_stack(path: Path) -> Array:
    pages = read_pages(path)
    assert (pages.axes, pages.shape) == ("Q", (len(pages.images),))
    return np.stack(pages.images)


def see_through(rng: np.random.Generator) -> Bytes:
    """Return a picture of which a part is transparent."""
    return np.dstack([color_picture(rng), gray_picture(rng)])


def labels(rng: np.random.Generator, most: int = 65535) -> Ints:
    """Return labels of which the highest needs any number of bits."""
    return (gray_picture(rng).astype(np.int32) // 40) * int(most ** rng.uniform(0, 1) // 6)


def many_labels(rng: np.random.Generator) -> Ints:
    """Return labels, some of which may need more than 16 bits."""
    return labels(rng, 2**31 - 1)


def colors(n_channels: int, least: int = 1, most: int = 256) -> Callable[[np.random.Generator], Bytes]:
    return lambda rng: rng.integers(0, 256, (rng.integers(least, most + 1), n_channels), np.uint8)


def quantized(rng: np.random.Generator) -> Bytes:
    return cvtimg.quantize(color_picture(rng), 8).image


_PICTURES = {
    ".png": (color_picture, gray_picture, deep, see_through),
    ".webp": (color_picture, see_through),
    ".tif": (color_picture, gray_picture, deep),
    ".npy": (color_picture, gray_picture, deep),
    ".bmp": (color_picture, gray_picture),
    ".ppm": (color_picture,),
    ".pgm": (gray_picture,),
}
_TYPES = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64")
_PALETTES = (".gpl", ".json", ".hex", ".act", ".ase", ".css", ".scss", ".svg", ".pal", ".txt", ".png")
_FILES: list[tuple[str, str, Any, Any]] = [
    ("read_image", f"{suffix}, {inputs.__name__}", inputs, again(cvtimg.write_image, cvtimg.read_image, f"a{suffix}"))
    for suffix, kinds in _PICTURES.items()
    for inputs in kinds
]
_FILES += [
    ("read_image", f"{suffix}, {name}", of_type(name), again(cvtimg.write_image, cvtimg.read_image, f"a{suffix}"))
    for suffix in (".tif", ".npy")
    for name in _TYPES
]
_FILES += [
    ("read_image", f".tif, {name}", of_type(kind), again(partial(write_as_others, **how), cvtimg.read_image, "a.tif"))
    for name, kind, how in [
        *((method, "float32", {"compression": method, "tile": (16, 16)}) for method in ("zlib", "lzw", "zstd")),
        *((f"big-endian {kind}", kind, {"byteorder": ">"}) for kind in ("int16", "uint16", "uint32")),
    ]
]
_FILES += [
    ("segment_file", f"tiles of {suffix}, {name}", of_type(name), again(write_tiles, read_tiles, f"a{suffix}"))
    for suffix in (".tif", ".zarr")
    for name in _TYPES
]
_FILES += [
    ("read_pages", name, stack(name), again(write_pages, read_stack, "a.tif"))
    for name in ("uint8", "uint16", "float32")
]
_FILES += [
    ("read_labels", suffix, inputs, again(cvtimg.write_labels, cvtimg.read_labels, f"a{suffix}"))
    for suffix, inputs in ((".png", labels), (".tif", many_labels), (".tiff", many_labels), (".npy", many_labels))
]
_FILES += [
    ("read_palette", f"{suffix}{kind}", inputs, again(cvtimg.write_palette, cvtimg.read_palette, f"a{suffix}"))
    for kind, inputs in (("", colors(3)), (", alpha", colors(4)), (", more than 256", colors(3, 257, 400)))
    for suffix in _PALETTES
    if not kind or suffix != ".act"
]
_FILES += [("quantize", "its own output", quantized, lambda image: cvtimg.quantize(image, 8).image)]


def same(before: Array, after: Array) -> None:
    """Assert that values and their type are the same."""
    np.testing.assert_array_equal(after, before, strict=True)


RELATIONS = [
    beside(verb, change, inputs, lambda content: content, result, same) for verb, change, inputs, result in _FILES
] + [
    beside(
        "read_image",
        f"{suffix}, indexed, {inputs.__name__}",
        inputs,
        colored,
        again(write_indexed, cvtimg.read_image, f"a{suffix}"),
        same,
    )
    for inputs, suffixes in {
        opaque: (".png", ".tif", ".tiff", ".webp", ".gif", ".bmp", ".ppm", ".npy"),
        half_seen: (".png", ".tif", ".webp"),
    }.items()
    for suffix in suffixes
]
test_what_is_written_is_read, test_whatever_is_written_is_read = quick_and_wide(RELATIONS)
