"""Draw the figures of the pages with the scripts of the gallery: ``python docs/draw_figures.py [NAME...]``.

Each NAME stands for the script ``examples/gallery/plot_NAME.py`` and the figure ``docs/NAME.webp``; by default, all
figures that have a script are drawn.
"""

import contextlib
import runpy
import sys

import figures

GALLERY = figures.DOCS.parent / "examples" / "gallery"


def main(names: list[str]) -> None:
    """Run the scripts, and write the `figure` (of matplotlib, or bytes of a PNG) that each defines."""
    # Sheets of matplotlib scale images, so that figures with pixels of their sources stay as they were drawn.
    kept = {path.stem for path in figures.DOCS.glob("*.webp")} - figures.EXACT
    drawn = sorted(name for name in kept if (GALLERY / f"plot_{name}.py").exists())
    for name in names or drawn:
        with contextlib.chdir(GALLERY):
            left = runpy.run_path(f"plot_{name}.py")
        figures.write(name, left["figure"])


if __name__ == "__main__":
    main(sys.argv[1:])
