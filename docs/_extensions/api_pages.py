"""The reference of the API: a page per subject, written from what its package's face lists."""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path
from typing import Any

from uses import links

import cvtimg

PACKAGE = Path(__file__).parents[2] / "cvtimg"
VERBS = "All functions that most programs need, in one namespace."


def write_pages(app: Any, config: Any) -> None:
    """Write ``generated/api/PACKAGE.rst`` for each package with a face, and the page of the verbs."""
    folder = Path(app.srcdir) / "generated" / "api"
    folder.mkdir(parents=True, exist_ok=True)
    subjects = sorted(stub.parent.name for stub in PACKAGE.glob("*/__init__.pyi"))
    pages = {name: page(name) for name in ("cvtimg", *(f"cvtimg.{subject}" for subject in subjects))}
    for name, text in pages.items():
        write_changed(folder / f"{name}.rst", text)
    config.autosummary_generate = [f"generated/api/{name}.rst" for name in pages]
    for old in (folder / "names").glob("*.rst"):  # of names that are gone
        package, _, each = old.stem.rpartition(".")
        if f"   {each}\n" not in pages.get(package, ""):
            old.unlink()
    toctree = "".join(f"   api/{name}\n" for name in pages)
    subjects_said = "".join(f":doc:`api/{name}`\n   {said(name)}\n\n" for name in pages)
    text = Path(__file__).with_name("api.rst.in").read_text()
    write_changed(folder.parent / "api.rst", f"{text}{toctree}\n{subjects_said}")


def page(name: str) -> str:
    """Return the page of a package: its functions and classes as tables with links, its registries with their keys."""
    package = importlib.import_module(name)
    public = {each: getattr(package, each) for each in package.__all__}
    # A name has one page: a verb in cvtimg, another in the package that defines it. Other packages link there.
    homes = {each: home(each, value, name) for each, value in public.items()}
    functions = [each for each, value in public.items() if inspect.isroutine(value)]
    classes = [each for each, value in public.items() if inspect.isclass(value)]
    registries = {each: value for each, value in public.items() if isinstance(value, dict)}
    if name == "cvtimg":
        title, text = "The verbs: cvtimg", VERBS
    else:
        title, text = name, inspect.getdoc(package) or ""
    parts = [title, "=" * len(title), "", text, "", f".. currentmodule:: {name}", ""]
    for heading, names in (("Functions", functions), ("Classes", classes)):
        if names:
            parts += [heading, "-" * len(heading), ""]
            parts += table([f"~{homes[each]}.{each}" for each in sorted(names) if homes[each] != name])
            parts += table([each for each in sorted(names) if homes[each] == name], "   :toctree: names")
    if registries:
        parts += ["Registries", "----------", ""]
        parts += [f"``{each}``: {', '.join(f'``{key}``' for key in value)}\n" for each, value in registries.items()]
    parts += links(list(public))
    return "\n".join(parts) + "\n"


def said(name: str) -> str:
    """Return the first sentence of what a package says about itself."""
    if name == "cvtimg":
        return VERBS
    return re.split(r"\n\n|(?<=\.)\s", inspect.getdoc(importlib.import_module(name)) or "")[0].replace("\n", " ")


def neighbors(package: str) -> list[str]:
    """Return the public names of a package, or of none."""
    faced = (PACKAGE.parent / package.replace(".", "/") / "__init__.pyi").exists()
    return list(importlib.import_module(package).__all__) if faced else []


def home(each: str, value: Any, name: str) -> str:
    """Return the package in which a name has its page."""
    if each in cvtimg.__all__ or name == "cvtimg":
        return "cvtimg"
    package = ".".join(getattr(value, "__module__", name).split(".")[:2])
    defines = (PACKAGE.parent / package.replace(".", "/") / "__init__.pyi").exists()
    return package if defines and each in importlib.import_module(package).__all__ else name


def table(names: list[str], *options: str) -> list[str]:
    """Return a table of names with the first line of what each says about itself."""
    return [".. autosummary::", *options, "", *(f"   {each}" for each in names), ""] if names else []


def escape(app: Any, kind: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """Keep names such as ``n_iter_`` and bars such as ``|x|`` from being taken for links, but for those in examples."""
    in_example = False
    for number, line in enumerate(lines):
        in_example = line.lstrip().startswith(">>>") or (in_example and bool(line.strip()))
        if not in_example:
            parts = re.split(r"(`+[^`]*`+)", line)
            # An entry's own name, before a colon, is numpydoc's.
            parts[::2] = [re.sub(r"(?<=\w)_(?!\w| :|$)|\|", r"\\\g<0>", part) for part in parts[::2]]
            lines[number] = "".join(parts)


def write_changed(path: Path, text: str) -> None:
    """Write a page if its text has changed, so that Sphinx does not read it again in vain."""
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


def setup(app: Any) -> dict[str, bool]:
    """Write the pages before autosummary looks for them, and docstrings before numpydoc reads them."""
    app.connect("config-inited", write_pages)
    app.connect("autodoc-process-docstring", escape, priority=100)
    return {"parallel_read_safe": True}
