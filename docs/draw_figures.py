"""Draw the figures of the pages with the scripts of the gallery: ``python docs/draw_figures.py [NAME...]``.

Each NAME stands for the script ``examples/gallery/plot_NAME.py`` and the figure ``docs/NAME.png``; by default, all
figures that have a script are drawn.
"""

import contextlib
import runpy
import sys
from io import BytesIO
from pathlib import Path

from PIL import Image

import cvtimg

DOCS = Path(__file__).parent
GALLERY = DOCS.parent / "examples" / "gallery"


def main(names: list[str]) -> None:
    """Run the scripts, and write the `sheet` or the `figure` (bytes of a PNG) that each defines, in full color.

    Pages compare images with their originals, so figures are never quantized.
    """
    drawn = [path.stem for path in sorted(DOCS.glob("*.png")) if (GALLERY / f"plot_{path.stem}.py").exists()]
    for name in names or drawn:
        with contextlib.chdir(GALLERY):
            left = runpy.run_path(f"plot_{name}.py")
        shown = Image.open(BytesIO(left["figure"])).convert("RGB") if "figure" in left else left["sheet"]
        cvtimg.write_image(DOCS / f"{name}.png", shown, overwrite=True)


if __name__ == "__main__":
    main(sys.argv[1:])
