"""Figures of the pages: WebP in full color, as small as it can be without a loss that is seen."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

DOCS = Path(__file__).parent
#: Figures whose pixels are compared with those of their sources.
EXACT = {"before_after", "exposures", "hard_cases", "quantization"}
#: Pixels that a page shows side by side, on screens of two for each of its own.
WIDEST = 1500


def write(name: str, shown: Any) -> None:
    """Write an array, the bytes of a PNG, a Pillow image or a chart as the figure `docs/NAME.webp`.

    Pages compare images with their originals, so figures never have a palette. Drawings are smaller without loss, and
    most photographs with a loss at a quality of 92.
    """
    image = _as_image(shown).convert("RGB")
    if name not in EXACT:
        image.thumbnail((WIDEST, 10 * WIDEST), Image.Resampling.LANCZOS)
    ways = [{"lossless": True, "quality": 100}]
    if name not in EXACT:
        ways.append({"quality": 92, "use_sharp_yuv": True})
    (DOCS / f"{name}.webp").write_bytes(min((_encoded(image, **way) for way in ways), key=len))


def _as_image(shown: Any) -> Image.Image:
    if hasattr(shown, "savefig"):
        content = BytesIO()
        shown.savefig(content, format="png")
        return Image.open(content)
    if isinstance(shown, bytes):
        return Image.open(BytesIO(shown))
    return Image.fromarray(shown) if isinstance(shown, np.ndarray) else shown


def _encoded(image: Image.Image, **way: Any) -> bytes:
    content = BytesIO()
    image.save(content, "WEBP", method=4, **way)
    return content.getvalue()
