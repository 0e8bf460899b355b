"""The notebook of each tutorial runs from its first cell to its last, and shows what comes of it."""

import importlib.util
import os
import sys
import sysconfig
import warnings
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent
SOURCE = ROOT / "docs" / "_extensions" / "notebooks.py"
if not SOURCE.exists():
    pytest.skip("the tests run without the checkout", allow_module_level=True)
spec = importlib.util.spec_from_file_location("notebooks", SOURCE)
assert spec is not None
assert spec.loader is not None
notebooks = importlib.util.module_from_spec(spec)
spec.loader.exec_module(notebooks)


def test_a_cell_ends_where_a_result_is_shown() -> None:
    block = ">>> a = 1\n>>> a\n1\n>>> for b in range(2):\n...     a += b\n>>> a\n2\n>>> c = 3\n"
    assert notebooks.examples(block) == ["a = 1\na\n", "for b in range(2):\n    a += b\na\n", "c = 3\n"]


def test_a_page_becomes_text_code_and_commands(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# Title\n\nWords, [a link](other.md).\n\n![figure](a.png)\n\n`python docs/draw.py a` draws this figure.\n\n"
        "```python\n>>> 1 + 1\n2\n\n```\n\n```console\n$ cvtimg --version\n```\n\n```sh\nrm it\n```\n"
    )
    cells = [(cell["cell_type"], cell["source"]) for cell in notebooks.notebook(page)["cells"]]
    assert cells == [
        ("markdown", f"# Title\n\n{notebooks.HEAD}"),
        ("code", notebooks.SETUP),
        ("markdown", "Words, a link."),
        ("code", "1 + 1"),
        ("code", "!cvtimg --version"),
        ("markdown", "```sh\nrm it\n```"),
    ]


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("page", notebooks.pages(), ids=lambda page: page.stem)
def test_the_notebook_of_a_tutorial_runs(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        nbformat = pytest.importorskip("nbformat")
        nbclient = pytest.importorskip("nbclient")
        pytest.importorskip("ipykernel")
        monkeypatch.setenv("PATH", f"{sysconfig.get_path('scripts')}{os.pathsep}{os.environ['PATH']}")
        monkeypatch.setenv("PYTHONWARNINGS", "default")
        book: Any = nbformat.from_dict(notebooks.notebook(page))
        nbformat.validate(book)
        client = nbclient.NotebookClient(book, timeout=200, resources={"metadata": {"path": str(ROOT)}})
        client.create_kernel_manager().kernel_cmd = [
            sys.executable,
            "-m",
            "ipykernel_launcher",
            "-f",
            "{connection_file}",
        ]
        client.execute()
    shown = [output for cell in book.cells if cell.cell_type == "code" for output in cell.outputs]
    assert "not found" not in "".join(output.text for output in shown if output.output_type == "stream")
    assert any(output.output_type == "execute_result" for output in shown)
