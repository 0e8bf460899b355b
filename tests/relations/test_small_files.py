"""What must not change in small files for eyes: by hidden colors, containers, canvases, and by being made twice."""

import json
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import PIL.Image
from relations.relation import Relation, close, equal, not_above, quick_and_wide
from relations.remembering import beside
from relations.test_pictures import gray_picture

import cvtimg
from cvtimg._shared.types import Array
from cvtimg.cli.app import main
from cvtimg.quantization import QuantizeOptions, quantize_file

Pixels = Array


def logo(rng: np.random.Generator) -> Pixels:
    """Return discs and bars with soft edges on nothing, (64, 96, 4)."""
    y, x = np.mgrid[:64, :96]
    pixels = np.zeros((64, 96, 4), np.uint8)
    for _ in range(3):
        row, column, radius = rng.uniform((20, 20, 5), (44, 76, 14))
        share = np.clip(radius - np.hypot(y - row, x - column) + 0.5, 0, 1)[..., None]
        pixels = np.where(
            share > 0, np.dstack([*np.broadcast_arrays(*rng.integers(0, 256, 3), 255 * share[..., 0])]), pixels
        )
    return pixels.astype(np.uint8)


def opaque(rng: np.random.Generator) -> Pixels:
    """Return a logo on white."""
    pixels = logo(rng).astype(float)
    share = pixels[..., 3:] / 255
    return np.rint(pixels[..., :3] * share + 255 * (1 - share)).astype(np.uint8)


def shown(pixels: Pixels) -> Pixels:
    """Return what is seen of a result for eyes: its colors, none where it is clear."""
    image = cvtimg.quantize(pixels, goal="eyes", alpha=True, effort="fast").image
    return image * (image[..., 3:] > 0)


def repainted(pixels: Pixels) -> Pixels:
    """Give clear pixels other colors, which nobody sees."""
    hidden = np.arange(pixels.size).reshape(pixels.shape).astype(np.uint8)
    hidden[..., 3] = 0
    return np.where(pixels[..., 3:] > 0, pixels, hidden)


def file_of(pixels: Pixels, suffix: str = ".png") -> bytes:
    """Return the small file that is made of a file."""
    with TemporaryDirectory() as folder:
        source, target = Path(folder, f"a{suffix}"), Path(folder, "b.png")
        PIL.Image.fromarray(pixels).save(source, **({"lossless": True, "exact": True} if suffix == ".webp" else {}))
        quantize_file(source, target, QuantizeOptions(goal="eyes", engine={"effort": "fast"}))
        return target.read_bytes()


def told(pixels: Pixels) -> int:
    """Return the number of colors that the command info tells of a file."""
    with TemporaryDirectory() as folder, redirect_stdout(StringIO()) as printed:
        PIL.Image.fromarray(pixels).save(path := Path(folder, "a.png"))
        assert main(["info", str(path), "--json"]) == 0
    return int(json.loads(printed.getvalue())["distinct_colors"])


def fed_back(pixels: Pixels) -> int:
    """Return the bytes of the small file of a small file."""
    with TemporaryDirectory() as folder:
        Path(folder, "a.png").write_bytes(file_of(pixels))
        return len(file_of(np.asarray(PIL.Image.open(Path(folder, "a.png")).convert("RGB"))))


def lossless(pixels: Pixels) -> int:
    """Return the bytes of a PNG that Pillow makes as small as it can."""
    with TemporaryDirectory() as folder:
        PIL.Image.fromarray(pixels).save(path := Path(folder, "a.png"), optimize=True)
        return path.stat().st_size


def loss(pixels: Pixels, form: Callable[[Pixels], Pixels] = np.asarray) -> float:
    """Return what the content of a logo loses to levels in steps of 48, both in another form."""
    return 100 - cvtimg.content_quality(form(pixels), form(pixels // 48 * 51))


def on_canvas(pixels: Pixels) -> Pixels:
    """Put a picture on a canvas of the color of its corner, as wide as windows of 5 pixels reach at a scale of 1/32."""
    return np.pad(pixels, ((160, 192), (192, 160), (0, 0)), "edge")


TOLD, PHOTOGRAPH = "2026-11-27", partial(gray_picture, shape=(64, 64))
RELATIONS = [
    Relation("quantize for eyes", "other colors of clear pixels", logo, shown, repainted, equal, TOLD),
    Relation("info", "other colors of clear pixels", logo, told, repainted, equal, "2026-11-28"),
    *(
        beside("quantize_file", f"a {suffix}", opaque, file_of, partial(file_of, suffix=suffix), since=TOLD)
        for suffix in (".webp", ".bmp", ".tif")
    ),
    beside("quantize_file", "its own output", opaque, fed_back, lambda a: len(file_of(a)), not_above(), TOLD),
    beside("quantize_file", "the file", PHOTOGRAPH, lambda a: len(file_of(a)), lossless, not_above(), TOLD),
    Relation("content_quality", "a canvas", lambda rng: on_canvas(opaque(rng)), loss, on_canvas, close(1e-6), TOLD),
    *(
        beside("content_quality", name, PHOTOGRAPH, loss, partial(loss, form=form), close(1e-4))
        for name, form in {"16 bits": lambda a: a * np.uint16(257), "floats in 0..1": lambda a: a / 255}.items()
    ),
    Relation("content_quality", "three equal bands", PHOTOGRAPH, loss, lambda a: np.dstack([a] * 3), close(1e-3), TOLD),
]
test_a_result_follows_its_input, test_a_result_follows_any_input = quick_and_wide(RELATIONS)
