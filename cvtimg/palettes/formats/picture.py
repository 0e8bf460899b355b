"""Images as palettes: write one square per color, and read the colors of any image that has few."""

from io import BytesIO

import numpy as np
from PIL import Image, UnidentifiedImageError

from cvtimg._shared.types import Array, Bytes
from cvtimg.colors.samples import color_samples
from cvtimg.colors.spaces import to_depth
from cvtimg.palettes.swatches import Swatches
from cvtimg.pictures.formats.decoding import decode, to_srgb
from cvtimg.pictures.formats.encoding import encode_image
from cvtimg.pictures.formats.opening import UnfitContentError, open_picture


def read_picture(content: bytes) -> Bytes:
    """Read the palette of an indexed image, or the distinct colors of other images in order of first appearance."""
    file = BytesIO(content)
    try:
        with open_picture(file) as image:
            if image.mode == "P":
                return _entries(image)
    except UnidentifiedImageError:  # `decode` reads more formats than Pillow
        file.seek(0)
    file.seek(0)
    return _distinct(decode(file))


def _entries(image: Image.Image) -> Bytes:
    """Return the colors of the palette: all of them for PNG, and those in use for formats that pad the palette."""
    image.load()
    n_entries = len(image.getpalette("RGB") or b"") // 3
    numbers = np.arange(n_entries) if image.format == "PNG" else np.unique(np.asarray(image))
    strip = Image.fromarray(numbers[np.newaxis].astype(np.uint8))
    strip.putpalette(image.getpalette("RGB") or b"")
    strip.info = image.info
    return np.asarray(to_srgb(strip))[0]


def _distinct(image: Array, most: int = 1 << 16) -> Bytes:
    """Return the colors of an image without a palette, as many as that may have."""
    if image.dtype.kind == "f" or (image.ndim == 3 and image.shape[2] not in (3, 4)):
        raise UnfitContentError("has floating point samples or bands that are not colors")
    samples = color_samples(to_depth(image, np.dtype(np.uint8)))
    if samples.n_colors > most:
        raise UnfitContentError(f"has {samples.n_colors} colors, over the limit of {most}; quantize it first")
    first = np.unique(samples.inverse, return_index=True)[1]
    ordered = samples.colors[np.argsort(first)]
    return np.repeat(ordered, 3, axis=1) if ordered.shape[1] == 1 else ordered


def write_picture(swatches: Swatches) -> bytes:
    """Write a PNG with one square per color; the rest of the last row repeats the last color."""
    n_colors = len(swatches.colors)
    widest = min(n_colors, max(16, int(np.ceil(np.sqrt(n_colors)))))
    n_columns = min(range(widest, widest // 2, -1), key=lambda number: -n_colors % number)
    n_rows = -(-n_colors // n_columns)
    side = 32 if n_colors <= 256 else 8
    fields = np.minimum(np.arange(n_rows * n_columns), n_colors - 1).reshape(n_rows, n_columns)
    layout = fields.repeat(side, axis=0).repeat(side, axis=1)
    if n_colors <= 256:
        return encode_image(".png", layout, palette=swatches.colors)
    return encode_image(".png", swatches.colors[layout])
