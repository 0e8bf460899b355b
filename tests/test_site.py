"""What the site and the release are made from: gallery scripts, manual pages, the version and its citation."""

import contextlib
import importlib
import re
import runpy
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cvtimg.cli.overview import COMMANDS, described, recorded

ROOT = Path(__file__).parent.parent
GALLERY = ROOT / "examples" / "gallery"

pytestmark = [
    pytest.mark.skipif(not GALLERY.exists(), reason="the tests run without the checkout"),
    pytest.mark.timeout(120),
]


@pytest.fixture
def command_line(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the module that writes the reference of the commands."""
    monkeypatch.syspath_prepend(ROOT / "docs" / "_extensions")
    return importlib.import_module("command_line")


@pytest.mark.slow
@pytest.mark.parametrize("script", sorted(GALLERY.glob("plot_*.py")), ids=lambda path: path.stem)
def test_a_script_of_the_gallery_draws_its_figure(script: Path) -> None:
    with contextlib.chdir(GALLERY):
        left = runpy.run_path(script.name)
    if hasattr(left.get("figure"), "savefig"):
        assert left["figure"].axes
    elif "figure" in left:
        assert left["figure"].startswith(b"\x89PNG")
    else:
        assert left["sheet"].ndim == 3
        assert len(np.unique(left["sheet"])) > 16


def test_every_figure_of_the_pages_has_a_script() -> None:
    measured = {"grid", "looks", "tables", "time_energy"}  # by benchmarks/looks.py, tables.py, engine.py
    drawn = {path.stem.removeprefix("plot_") for path in GALLERY.glob("plot_*.py")}
    drawn |= {path.stem.removeprefix("draw_") for path in (ROOT / "docs").glob("draw_*.py")}
    drawn |= {path.stem for path in (ROOT / "examples").glob("*.py")}
    for path in (ROOT / "docs").glob("*.webp"):
        assert path.stem in drawn | measured or path.stem.split("_")[0] in drawn, path.name


def test_a_manual_page_has_every_option_and_example(command_line: Any) -> None:
    for command in map(described, COMMANDS):
        page = command_line.as_manual(command).replace("\\-", "-").replace("\\(aq", "'").replace("\\e", "\\")
        names = [name for options in command.panels.values() for name in recorded(options)]
        assert len(names) > 2
        assert command.examples
        for text in (command.paragraphs[0][:-1], *names, *map(str.strip, command.examples)):
            assert text in page


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("groff") is None, reason="needs groff")
def test_groff_reads_the_manual_pages_without_a_warning(command_line: Any) -> None:
    for command in map(described, COMMANDS):
        words = ["groff", "-man", "-ww", "-Tutf8", "-z"]
        done = subprocess.run(words, input=command_line.as_manual(command), capture_output=True, text=True, timeout=20)
        assert done.returncode == 0
        assert done.stderr == ""


def test_on_a_package_index_every_link_of_the_readme_is_absolute() -> None:
    absolute = runpy.run_path(str(ROOT / ".ci" / "absolute_links.py"))["absolute"]
    text = (ROOT / "README.md").read_text()
    links = re.findall(r"(!?)\[[^\]]*\]\(([^)]+)\)", absolute(text, "https://example.org/cvtimg/", "v1"))
    assert ("!", "https://example.org/cvtimg/raw/v1/docs/hero.webp") in links
    assert ("", "https://example.org/cvtimg/blob/v1/docs/faq.md") in links
    assert all(target.startswith(("https://", "#")) for _, target in links)
