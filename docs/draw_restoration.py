"""Draw what restoration does with three damaged versions of a picture: ``python docs/draw_restoration.py``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import cvtimg
from cvtimg.plotting.sheets import Panel, contact_sheet

ROOT = Path(__file__).parent.parent
SAMPLES = ROOT / "sample_images"
sys.path.append(str(SAMPLES))
from damage import Damage, damaged_versions  # noqa: E402


def main() -> None:
    """Write docs/restoration.png."""
    stored = [cvtimg.read_image(SAMPLES / f"drawing_{number}.png") for number in (1, 2, 3)]
    missing = [Panel(version, ("holes, a large gap, noise",)) for version in stored]
    drawn = [Panel(cvtimg.restore(stored, 6).image, ("restored: 6 segments",))]
    rows = [missing + drawn, row_of_drawing(), row_of_photograph()]
    sheet = cvtimg.quantize(contact_sheet(rows, panel_width=256), 256)
    cvtimg.write_image(ROOT / "docs" / "restoration.png", sheet.indices, palette=sheet.palette, overwrite=True)


def row_of_drawing() -> list[Panel]:
    """Paint parts of a drawing over with its background, and tell nobody where."""
    clean = cvtimg.read_image(SAMPLES / "drawing.png")
    versions, _ = damaged_versions(clean / 255, 3, Damage(noise=0.15, occlusions=4), seed=2)
    panels = [Panel(levels(version), ("parts painted over, no mask, noise",)) for version in versions]
    return [*panels, Panel(levels(cvtimg.restore(versions, 6).image), ("restored: 6 segments",))]


def row_of_photograph() -> list[Panel]:
    """Damage a part of a photograph."""
    clean = cvtimg.read_image(SAMPLES / "chelsea.png")[20:212, 100:356]
    versions, known = damaged_versions(clean / 255, 3, Damage(noise=0.1, holes=0.3, scratches=1), seed=0)
    panels = [
        Panel(np.dstack([levels(version), np.uint8(255) * mask]), ("30 % holes, a scratch, noise",))
        for version, mask in zip(versions, known, strict=True)
    ]
    result = cvtimg.restore(versions, 96, masks=known, detail=True)
    return [*panels, Panel(levels(result.image), ("restored with detail=True",))]


def levels(picture: NDArray[Any]) -> NDArray[np.uint8]:
    """Bring 0..1 to 8 bits."""
    return np.clip(np.rint(255 * picture), 0, 255).astype(np.uint8)


if __name__ == "__main__":
    main()
