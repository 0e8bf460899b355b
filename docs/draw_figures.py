"""Draw the figures of the pages with the scripts of the gallery: ``python docs/draw_figures.py [NAME...]``.

Each NAME stands for the script ``examples/gallery/plot_NAME.py`` and the figure ``docs/NAME.png``; by default, all
figures that have a script are drawn.
"""

import contextlib
import runpy
import sys
from pathlib import Path

import cvtimg

DOCS = Path(__file__).parent
GALLERY = DOCS.parent / "examples" / "gallery"


def main(names: list[str]) -> None:
    """Run the scripts, and write the `sheet` that each defines, in 256 colors, or the `figure`, the bytes of a PNG."""
    drawn = [path.stem for path in sorted(DOCS.glob("*.png")) if (GALLERY / f"plot_{path.stem}.py").exists()]
    for name in names or drawn:
        with contextlib.chdir(GALLERY):
            left = runpy.run_path(f"plot_{name}.py")
        path = DOCS / f"{name}.png"
        if "figure" in left:
            path.write_bytes(left["figure"])
        else:
            sheet = cvtimg.quantize(left["sheet"], 256)
            cvtimg.write_image(path, sheet.indices, palette=sheet.palette, overwrite=True)


if __name__ == "__main__":
    main(sys.argv[1:])
