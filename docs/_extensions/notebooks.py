"""Notebooks of the tutorials, made from their pages: ``python docs/_extensions/notebooks.py FOLDER`` writes them.

Examples become cells without their prompts, and a cell ends where the page shows what comes of it. Commands become
cells for the shell.
"""

from __future__ import annotations

import doctest
import json
import re
import sys
from pathlib import Path
from typing import Any

TUTORIALS = Path(__file__).parents[1] / "tutorials"

FENCE = re.compile(r"^```(\w+)\n(.*?)^```\n?", flags=re.DOTALL | re.MULTILINE)
#: Figures of the page, and how they are drawn: the notebook has figures of its own.
FIGURE = re.compile(r"^!\[[^\]]*\]\([^)]*\)\n|^`python docs/.*figure\..*\n", flags=re.MULTILINE)
#: Links to other pages, of which the words stay.
LINK = re.compile(r"\[([^\]]*)\]\((?![a-z]+://)[^)]*\)")

HEAD = (
    """*Start Jupyter in the root of the checkout.* The notebook works on a copy of `sample_images` in a new folder."""
)
SETUP = """import os, shutil, tempfile

folder = tempfile.mkdtemp()
shutil.copytree("sample_images", f"{folder}/sample_images")
os.chdir(folder)"""


def pages() -> list[Path]:
    """Return the pages of the tutorials."""
    return sorted(page for page in TUTORIALS.glob("*.md") if page.stem != "index")


def notebook(page: Path) -> dict[str, Any]:
    """Return the notebook of a page, in version 4.5 of the format."""
    cells = [("markdown", HEAD), ("code", SETUP)]
    at = 0
    text = FIGURE.sub("", page.read_text())
    for block in FENCE.finditer(text):
        cells.append(("markdown", LINK.sub(r"\1", text[at : block.start()])))
        at = block.end()
        if block[1] == "python":
            cells += [("code", code) for code in examples(block[2])]
        elif block[1] == "console":
            cells.append(("code", re.sub(r"^\$ ", "!", block[2], flags=re.MULTILINE)))
        else:
            cells.append(("markdown", block[0]))
    cells.append(("markdown", LINK.sub(r"\1", text[at:])))
    # The title of the page comes first.
    title, _, rest = cells[2][1].partition("\n")
    cells[0], cells[2] = ("markdown", f"{title}\n\n{HEAD}"), ("markdown", rest)
    kept = [(kind, source.strip()) for kind, source in cells if source.strip()]
    return {
        "cells": [cell(number, kind, source) for number, (kind, source) in enumerate(kept)],
        "metadata": {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def examples(block: str) -> list[str]:
    """Return the code of a block in parts, each up to a line whose result the page shows."""
    parts, lines = [], ""
    for example in doctest.DocTestParser().get_examples(block):
        lines += example.source
        if example.want:
            parts.append(lines)
            lines = ""
    return [*parts, lines] if lines else parts


def cell(number: int, kind: str, source: str) -> dict[str, Any]:
    """Return a cell without results."""
    ran = {"execution_count": None, "outputs": []} if kind == "code" else {}
    return {"id": f"cell-{number}", "cell_type": kind, "metadata": {}, "source": source, **ran}


def write(folder: Path) -> None:
    """Write the notebook of each tutorial."""
    folder.mkdir(parents=True, exist_ok=True)
    for page in pages():
        folder.joinpath(f"{page.stem}.ipynb").write_text(
            json.dumps(notebook(page), indent=1, ensure_ascii=False) + "\n"
        )


def offer(app: Any, name: str, source: list[str]) -> None:
    """Add a link to its notebook to the page of a tutorial."""
    folder, _, stem = name.rpartition("/")
    if folder == "tutorials" and stem != "index":
        source[0] += f"\n\n{{download}}`This page as a notebook <../generated/notebooks/{stem}.ipynb>`\n"


def setup(app: Any) -> dict[str, Any]:
    """Write the notebooks for the site."""
    app.connect("builder-inited", lambda app: write(Path(app.srcdir) / "generated" / "notebooks"))
    app.connect("source-read", offer)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    write(Path(sys.argv[1]))
