"""Links from each page of the API to the guides, tutorials and gallery examples that use it."""

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1]
GALLERY = DOCS.parent / "examples" / "gallery"

FENCE = re.compile(r"^```python\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)
#: A name that is imported, called, or taken from a package of cvtimg; not a method of a result.
NAME = re.compile(r"(?:(?<![\w.])|(?<=cvtimg\.)|cvtimg\.(\w+)\.)([A-Za-z_]\w+)\b")
#: Pages that compare and list; they use a little of everything.
LISTS = {"coming_from", "faq", "glossary", "guides", "index", "installation", "project", "reference"}
#: So many pages of each kind are named, those first that use a name most.
MOST = 3


@cache
def pages() -> dict[str, dict[str, Counter[str]]]:
    """Return the names that the code of each page uses, by kind and by page."""
    guides = {path.stem: path for path in sorted(DOCS.glob("*.md")) if path.stem not in LISTS}
    tutorials = {f"tutorials/{path.stem}": path for path in sorted((DOCS / "tutorials").glob("*.md"))}
    examples = {f"generated/gallery/{path.stem}": path for path in sorted(GALLERY.glob("plot_*.py"))}
    return {
        "Guides": {page: _names("\n".join(FENCE.findall(path.read_text()))) for page, path in guides.items()},
        "Tutorials": {page: _names("\n".join(FENCE.findall(path.read_text()))) for page, path in tutorials.items()},
        "Gallery": {page: _names(path.read_text()) for page, path in examples.items()},
    }


def _names(code: str) -> Counter[str]:
    return Counter(match[2] for match in NAME.finditer(code))


def links(names: list[str], fallback: list[str] | None = None) -> list[str]:
    """Return the lines that link the pages which use these names, or those of the fallback where none does."""
    found = {kind: _most_used(names, counts) for kind, counts in pages().items()}
    if not any(found.values()) and fallback:
        found = {kind: _most_used(fallback, counts)[:1] for kind, counts in pages().items()}
    kinds = [f"{kind}: {', '.join(f':doc:`/{page}`' for page in used)}" for kind, used in found.items() if used]
    return [".. rubric:: Where it is used", "", *(f"| {line}" for line in kinds), ""] if kinds else []


def _most_used(names: list[str], counts: dict[str, Counter[str]]) -> list[str]:
    uses = {page: sum(used[name] for name in names) for page, used in counts.items()}
    return [page for page in sorted(uses, key=lambda page: -uses[page]) if uses[page]][:MOST]


def append(app: Any, kind: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """Append the links to the text of a public function or class."""
    from api_pages import neighbors

    if kind in ("function", "class", "exception"):
        package, _, each = name.rpartition(".")
        lines += ["", *links([each], neighbors(package))]


def setup(app: Any) -> dict[str, bool]:
    """Append links when numpydoc is done with a docstring."""
    app.connect("autodoc-process-docstring", append, priority=900)
    return {"parallel_read_safe": True}
