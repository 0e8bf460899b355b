"""What the pages show is what happens: their Python lines, their commands, the options and files that they name."""

import contextlib
import doctest
import io
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from PIL import Image

import cvtimg
from cvtimg._shared.extras import Extra
from cvtimg.cli.app import main
from cvtimg.cli.overview import COMMANDS
from cvtimg.options import options_of

ROOT = Path(__file__).parent.parent
WRITTEN = (page for page in sorted((ROOT / "docs").rglob("*.md")) if "generated" not in page.parts)
EXAMPLES = [ROOT / "README.md", *WRITTEN]
PAGES = [*EXAMPLES, ROOT / "CONTRIBUTING.md", ROOT / "benchmarks" / "README.md", ROOT / "sample_images" / "README.md"]
#: Pages whose commands, or whose lines of Python, take over a third of a second.
SLOW = {
    "README.md",
    "artwork.md",
    "batch.md",
    "elbow.md",
    "globe.md",
    "grid_files.md",
    "hierarchy.md",
    "index.md",
    "merging_exposures.md",
    "mesh_from_mask.md",
    "meshes.md",
    "meshless.md",
    "modes.md",
    "number_of_colors.md",
    "ocean_grid.md",
    "plotter.md",
    "quantization.md",
    "remesh_scan.md",
    "restoration.md",
    "segment_outputs.md",
    "segmentation.md",
    "sphere.md",
    "stack.md",
    "supports.md",
    "surfaces.md",
    "table_in_blocks.md",
    "web_images.md",
    "two_channels.md",
}
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE

pytestmark = [
    pytest.mark.skipif(not EXAMPLES[0].exists(), reason="the tests run without the checkout"),
    pytest.mark.timeout(120),
]


def blocks(page: Path, *languages: str) -> list[str]:
    """Return the blocks of code of a page that are marked with one of these languages."""
    return [code for language, code in BLOCK.findall(page.read_text()) if language in languages]


def parameters(pages: list[Path]) -> list[object]:
    """Name the parameters by the pages, and mark the slow ones."""
    return [
        pytest.param(page, id=str(page.relative_to(ROOT)), marks=[pytest.mark.slow] if page.name in SLOW else [])
        for page in pages
    ]


def commands_of(page: Path) -> list[list[str]]:
    """Return each command of a page's console blocks, and the output that the page shows below it."""
    found = []
    for block in blocks(page, "console"):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, output = part.replace("\\\n", " ").partition("\n")
            found.append([command, output.strip()])
    return found


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Go to a folder that looks like the root of the checkout, and may be written to."""
    shutil.copytree(ROOT / "sample_images", tmp_path / "sample_images")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    return tmp_path


@pytest.mark.parametrize("page", parameters([page for page in EXAMPLES if blocks(page, "python")]))
@pytest.mark.usefixtures("checkout")
def test_the_python_examples_print_what_is_said(page: Path) -> None:
    for block in blocks(page, "python"):
        assert block.startswith(">>> "), f"is not checked: {block}"
    results = doctest.testfile(str(page), module_relative=False, optionflags=FLAGS)
    assert results.attempted > 0
    assert results.failed == 0


@pytest.mark.parametrize("page", parameters([page for page in EXAMPLES if commands_of(page)]))
@pytest.mark.usefixtures("checkout")
def test_the_commands_run_and_print_what_is_said(page: Path) -> None:
    for command, expected in commands_of(page):
        words = shlex.split(command, comments=True)
        if words[0] == "python":
            done = subprocess.run([sys.executable, *words[1:]], capture_output=True, text=True, timeout=60)
            status, output = done.returncode, done.stdout + done.stderr
        else:
            assert words[0] == "cvtimg", f"is not checked: {command}"
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
                status = main(words[1:])
            output = printed.getvalue()
        assert status == 0, f"{command}: {output}"
        if expected:
            assert doctest.OutputChecker().check_output(expected, output, FLAGS), f"{command} prints:\n{output}"


def test_the_commands_have_the_options_that_are_named() -> None:
    words = {verb: " ".join(word for option in options_of(verb) for word in option.words) for verb in COMMANDS}
    known = {verb: {*text.replace("/", " ").split()} for verb, text in words.items()} | {"help": set[str]()}
    shown = "\n".join(block for page in PAGES for block in blocks(page, "sh", "console"))
    for line in shown.replace("\\\n", " ").splitlines():
        for name, rest in re.findall(r"(?:^(?:\$ )?|\| )cvtimg ([a-z]+)\b((?:(?! #|\|).)*)", line):
            assert name in known, line
            assert set(re.findall(r"(?<!\S)--?[a-z][a-z-]*", rest)) <= known[name] | {"--help", "-h"}, line


def test_commands_that_are_typed_one_after_another_write_files_of_their_own() -> None:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs" / "tutorials").glob("*.md"))]
    option = r" (?:-o|--(?:out-dir|report|table|plot|csv|overlay|contours|save-palette|sheet|histograms)) ([\w./-]+)"
    written: list[str] = []
    for page in pages:
        lines = "\n".join(blocks(page, "sh", "console")).replace("\\\n", " ").splitlines()
        commands = [line for line in lines if "--skip-existing" not in line or "--report" in line]
        written += [name for line in commands for name in re.findall(option, line)]
        written += re.findall(r"(?:\.save|write_\w+)\(\"([^\"]+)\"", "\n".join(blocks(page, "python")))
    assert {name for name in written if written.count(name) > 1} == set()


def anchors(page: Path) -> set[str]:
    """Return the names by which the headings of a page are linked."""
    headings = re.findall(r"^#+ (.*)$", BLOCK.sub("", page.read_text()), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_the_files_and_headings_that_are_linked_are_there() -> None:
    others = [ROOT / name for name in ("CHANGELOG.md", "SECURITY.md", "plugins/cvtimg-napari/README.md")]
    for page in [*PAGES, *(other for other in others if other.exists())]:
        for name, anchor in re.findall(r"\]\(([^)#\s]*)(?:#([^)\s]+))?\)", BLOCK.sub("", page.read_text())):
            if "://" not in name:
                target = page.parent / name if name else page
                assert target.exists(), f"{page}: {name}"
                assert not anchor or anchor in anchors(target), f"{page}: {name}#{anchor}"


def test_the_scripts_that_are_named_are_there() -> None:
    named = re.compile(r"python ((?:docs|examples|benchmarks|sample_images|tests|\.ci)/[\w/]+\.py)")
    for page in PAGES:
        for script in named.findall(page.read_text()):
            assert (ROOT / script).exists(), f"{page}: {script}"


@pytest.mark.parametrize(
    ("figure", "sample", "part"),
    [
        ("before_after", "coffee.png", np.s_[40:360, 90:510]),
        ("quantization", "coffee.png", np.s_[70:300, 190:460]),
        ("quantization", "rocket.jpg", np.s_[40:270, 150:420]),
        ("hard_cases", "rocket.jpg", np.s_[60:240, 20:290]),
        ("exposures", "coffee.png", np.s_[100:292, 200:456]),
    ],
)
def test_an_original_in_a_figure_has_all_its_colors(figure: str, sample: str, part: tuple[slice, slice]) -> None:
    original = cvtimg.read_image(ROOT / "sample_images" / sample)[part]
    sheet = cvtimg.read_image(ROOT / "docs" / f"{figure}.webp")
    height, width = original.shape[:2]
    found = [
        (top, left)
        for top, left in np.argwhere((sheet == original[0, 0]).all(axis=2))
        if np.array_equal(sheet[top : top + height, left : left + width], original)
    ]
    assert len(found) == 1


def test_each_guide_begins_with_a_figure_and_links_a_tutorial() -> None:
    groups = re.findall(r":caption: (\w+)\n\n(.*?)```", (ROOT / "docs" / "guides.md").read_text(), flags=re.DOTALL)
    guides = [name for caption, names in groups if caption != "Help" for name in names.split()]
    assert len(guides) > 20
    for name in guides:
        text = (ROOT / "docs" / f"{name}.md").read_text()
        assert "![" in text.partition("\n## ")[0], name
        assert "](tutorials/" in text, name


def test_the_tasks_on_the_start_page_are_those_of_the_readme() -> None:
    tables = [re.findall(r"^\|.*\|$", page.read_text().partition("| I want to |")[2].partition("\n\n")[0], re.MULTILINE)
              for page in (ROOT / "README.md", ROOT / "docs" / "index.md")]  # fmt: skip
    assert len(tables[0]) > 10
    assert [row.replace("](docs/", "](") for row in tables[0]] == tables[1]


def test_figures_are_small_and_in_full_color() -> None:
    paths = [path for path in (ROOT / "docs").iterdir() if path.suffix in (".png", ".webp")]
    assert paths
    for path in paths:
        assert path.stat().st_size < 500_000, path.name
        with Image.open(path) as figure:
            assert figure.mode != "P", path.name


def test_the_extra_all_holds_every_optional_part() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    named = re.fullmatch(r"cvtimg\[(.*)\]", *extras["all"])
    assert named
    optional = set(extras) - {"all", "bench", "dist", "docs", "lint", "test", "test-slow"}
    assert set(named[1].split(",")) == optional == set(get_args(Extra))
    page = (ROOT / "docs" / "installation.md").read_text()
    assert set(re.findall(r"^\| `(\w+)` \|", page, flags=re.MULTILINE)) == optional


def test_the_recipe_for_conda_has_the_dependencies_and_the_version_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    recipe = (ROOT / "conda" / "recipe.yaml").read_text()
    wanted = {re.sub(r"(?=>=)", " ", dependency) for dependency in project["dependencies"]}
    run = recipe[recipe.index("  run:") : recipe.index("tests:")]
    assert set(re.findall(r"- (.*)", run)) == wanted | {f"python {project['requires-python']}"}
    version = re.search(r"version: '(.*)'", (ROOT / "meson.build").read_text())
    assert version
    assert version[1] == cvtimg.__version__
    assert f"  version: {version[1]}\n" in recipe
    assert f"\nversion: {version[1]}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"version = {{{version[1]}}}" in (ROOT / "docs" / "citing.md").read_text()
