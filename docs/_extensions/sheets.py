"""Figures of the gallery: what a script's block assigns to `figure`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst


def scrape_sheets(block: tuple[str, str, int], variables: dict[str, Any], gallery: dict[str, Any]) -> str:
    """Write the `figure` of a block, of matplotlib or a PNG, and return what shows it."""
    if "\nfigure = " not in f"\n{block[1]}":
        return ""
    figure, path = variables["example_globals"]["figure"], Path(next(variables["image_path_iterator"]))
    if hasattr(figure, "savefig"):
        figure.savefig(path)
    else:
        path.write_bytes(figure)
    return figure_rst([str(path)], gallery["src_dir"])
