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
    drawn = [path.stem for path in sorted(figures.DOCS.glob("*.webp")) if (GALLERY / f"plot_{path.stem}.py").exists()]
    for name in names or drawn:
        with contextlib.chdir(GALLERY):
            left = runpy.run_path(f"plot_{name}.py")
        figures.write(name, left["figure"])


if __name__ == "__main__":
    main(sys.argv[1:])
