"""
How files become pixels
=======================

Above, the numbers as four files store them, shown as if they were sRGB; below, what ``read_image`` makes of them:
upright sRGB, with transparency as a fourth channel.
"""

from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

import cvtimg
from cvtimg.plotting import draw_sheet

SAMPLES = Path("../../sample_images")


def encoded(image: Image.Image, form: str, **options: object) -> bytes:
    """Return the bytes of a file."""
    content = BytesIO()
    image.save(content, form, **options)
    return content.getvalue()


# %%
# Adobe RGB, an image upside down, inks, and a palette of which one entry is transparent.

cup = Image.open(SAMPLES / "coffee.png").convert("RGB").resize((450, 300))
drawing = (
    Image.open(SAMPLES / "drawing.png")
    .convert("RGB")
    .resize((400, 300), Image.Resampling.NEAREST)
    .crop((0, 20, 400, 287))
)
indexed = drawing.quantize(8)
turned = Image.Exif()
turned[0x0112] = 3
files = {
    "JPEG in Adobe RGB": (SAMPLES / "rocket.jpg").read_bytes(),
    "JPEG, rotated by EXIF": encoded(Image.open(SAMPLES / "chelsea.png").rotate(180), "JPEG", exif=turned),
    "TIFF in cyan, magenta, yellow, black": encoded(cup.convert("CMYK"), "TIFF"),
    "GIF with a transparent color": encoded(indexed, "GIF", transparency=indexed.getpixel((5, 5))),
}


def numbers(content: bytes) -> np.ndarray:
    """Return the numbers of a file as they are; of inks, the first three."""
    stored = Image.open(BytesIO(content))
    values = np.asarray(stored.convert("RGB") if stored.mode == "P" else stored)
    return values[..., :3]


stored = [(numbers(content), "\n".join((name, "as stored"))) for name, content in files.items()]
read = [(cvtimg.read_image(content), "as read") for content in files.values()]

figure = draw_sheet([stored, read], ".png")
