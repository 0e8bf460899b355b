"""Configuration of the documentation site, which ``make docs`` builds without a network."""

import re
import sys
from pathlib import Path
from typing import Any

import cvtimg

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS / "_extensions"))

project = "cvtimg"
author = "the cvtimg developers"
version = release = cvtimg.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "api_pages",
    "command_line",
    "notebooks",
    "uses",
]
templates_path = ["_templates"]
exclude_patterns = ["_extensions", "_templates", "generated/gallery/*.ipynb", "generated/notebooks"]
#: A name in single backquotes in a docstring is a link where it is documented.
default_role = "py:obj"
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3

# Two hyphens are an option of the command line, not a dash.
smartquotes = False

autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

sphinx_gallery_conf = {
    "examples_dirs": ["../examples/gallery"],
    "gallery_dirs": ["generated/gallery"],
    "within_subsection_order": "ExampleTitleSortKey",
    "image_scrapers": ("sheets.scrape_sheets",),
    "reset_modules": (),
    "plot_gallery": True,
    "abort_on_example_error": True,
    "download_all_examples": False,
    # The pages of computation times load scripts from elsewhere.
    "write_computation_times": False,
    "show_memory": False,
    "thumbnail_size": (480, 320),
    "show_signature": False,
    "min_reported_time": 1e9,
}

#: Prompts and results are not copied.
copybutton_prompt_text, copybutton_prompt_is_regexp = r">>> |\.\.\. |\$ ", True

html_theme = "pydata_sphinx_theme"
html_title = f"cvtimg {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_theme_options = {
    "show_prev_next": False,
    "navbar_end": ["theme-switcher"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
copyright = "the cvtimg developers, BSD-3-Clause"


def _end_blocks(app: Any, name: str, source: list[str]) -> None:
    """Take away the empty line that doctest needs at the end of a block; link scripts of the gallery to its pages."""
    source[0] = source[0].replace("\n\n```", "\n```")
    source[0] = re.sub(r"\.\./examples/gallery/(plot_\w+)\.py\)", r"generated/gallery/\1.rst)", source[0])


def _skip(app: Any, kind: str, name: str, value: object, skip: bool, options: object) -> bool | None:
    """Leave out fields of named tuples, which the class describes, and what scikit-learn adds for its own routing."""
    field = (getattr(value, "__doc__", None) or "").startswith("Alias for field number")
    return True if field or name.endswith("_request") else None


def setup(app: Any) -> None:
    """Register what is changed on the way."""
    app.connect("source-read", _end_blocks)
    app.connect("autodoc-skip-member", _skip)
