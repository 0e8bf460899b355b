"""The text of ``cvtimg --help`` and ``cvtimg --version``, printed without importing Typer, which takes longest."""

from __future__ import annotations

import os
from contextlib import suppress

#: The commands in the order of ``--help``, each with its line there.
COMMANDS = {
    "quantize": "Reduce images to a palette of N colors.",
    "explore": "Try settings and see their results at once, in the browser.",
    "palette": "Print the palette of images and the share of the pixels of each color.",
    "segment": "Divide images into N segments of similar color.",
    "restore": "Restore one image from several noisy or incomplete versions of it.",
    "stipple": "Reproduce the tones of images by N dots, for pen plotters and print.",
    "mosaic": "Turn images into mosaics of N convex, single-colored tiles.",
    "mesh": "Divide masks, label images and polygons into triangles.",
    "surface": "Place N points evenly on surfaces, and join them by triangles.",
    "sphere": "Place N points on the globe as the cells of a grid for ocean and atmosphere models.",
    "cluster": "Cluster the rows of tables into N groups.",
    "elbow": "Suggest how many colors or clusters images and tables need.",
    "design": "Place N points for experiments evenly in a box.",
    "basis": "Find N modes that nearly contain all frames of an animation or rows of an array.",
    "info": "Show the size, format, bands, bit depth and number of distinct colors of images.",
}
_OPTIONS = {
    "--version": "Show the version and exit.",
    "--install-completion SHELL": "Install completion for bash, zsh or fish.",
    "--show-completion SHELL": "Show the completion script for bash, zsh or fish.",
    "-h, --help": "Show this message and exit. Each command has its own: cvtimg COMMAND --help.",
}
_ABOUT = (
    "Palettes, segments, restored images, drawings in dots, meshes, grids of the globe, designs of experiments and "
    "clusters, by centroidal Voronoi tessellations."
)
_STATUS = "Exit status: 0 all inputs done; 1 some input failed, the others are done; 2 wrong usage; 130 interrupted."


def overview() -> str:
    """Return the text of ``cvtimg --help``."""
    width = _width()
    lines = ["Usage: cvtimg [OPTIONS] COMMAND [ARGS]...", "", *_wrapped(_ABOUT, "  ", width)]
    for title, entries in (("Options:", _OPTIONS), ("Commands:", COMMANDS)):
        lines += ["", title]
        margin = 4 + max(map(len, entries))
        for name, text in entries.items():
            first, *others = _wrapped(text, " " * margin, width)
            lines += [f"  {name}".ljust(margin) + first.lstrip(), *others]
    return "\n".join([*lines, "", *_wrapped(_STATUS, "  ", width)])


def _width() -> int:
    """Columns of the terminal, at most 100."""
    with suppress(ValueError, OSError, AttributeError):
        return min(max(int(os.environ.get("COLUMNS") or os.get_terminal_size().columns), 50), 100)
    return 80


def _wrapped(text: str, indent: str, width: int) -> list[str]:
    """Break a text into lines; `textwrap` would take longer to import than all of this."""
    lines = [indent]
    for word in text.split():
        if len(lines[-1]) + 1 + len(word) > width and lines[-1] != indent:
            lines.append(indent)
        lines[-1] += word if lines[-1] == indent else f" {word}"
    return lines


def version() -> str:
    """Return the text of ``cvtimg --version``."""
    import cvtimg

    return f"cvtimg {cvtimg.__version__}"
