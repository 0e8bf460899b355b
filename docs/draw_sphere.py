"""Draws sphere.png: four of the grids of examples/globe.py, with its two continents or the land of a map.

python docs/draw_sphere.py [MAP]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import cvtimg

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent / "examples"))

import globe  # noqa: E402  (an example is no package)

NAMES = ("regional", "nested", "coast", "lights")
HEIGHT = 560


def main(land: Path | None) -> None:
    """Draw four globes, two beside two."""
    with tempfile.TemporaryDirectory() as folder:
        globe.main(Path(folder), land=land)
        panels = [Image.open(f"{folder}/{name}.png").convert("RGB") for name in NAMES]
    panels = [panel.resize((round(panel.width * HEIGHT / panel.height), HEIGHT)) for panel in panels]
    width = max(panel.width for panel in panels)
    sheet = Image.new("RGB", (2 * width, 2 * HEIGHT), "white")
    for number, panel in enumerate(panels):
        sheet.paste(panel, (number % 2 * width, number // 2 * HEIGHT))
    cvtimg.quantize(np.asarray(sheet), 256).save(DOCS / "sphere.png", overwrite=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
