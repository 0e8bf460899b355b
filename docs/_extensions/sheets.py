"""Figures of the gallery: what a script's block assigns to `sheet` or `figure`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst

import cvtimg


def scrape_sheets(block: tuple[str, str, int], variables: dict[str, Any], gallery: dict[str, Any]) -> str:
    """Write the `sheet` (an image) or the `figure` (of matplotlib, or a PNG) of a block, and return what shows it."""
    names = variables["example_globals"]
    images = variables["image_path_iterator"]
    shown = []
    for name in ("sheet", "figure"):
        if f"\n{name} = " in f"\n{block[1]}":
            path = Path(next(images))
            if hasattr(names[name], "savefig"):
                names[name].savefig(path)
            elif name == "figure":
                path.write_bytes(names[name])
            else:
                cvtimg.write_image(path, names[name], overwrite=True)
            shown.append(str(path))
    return figure_rst(shown, gallery["src_dir"])
