from __future__ import annotations

import doctest
import re
import shlex
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cvtimg.cli.app import app

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
DOCUMENTS = pytest.mark.parametrize("document", [README, ROOT / "docs" / "quantization.md"], ids=lambda path: path.stem)

pytestmark = pytest.mark.skipif(not README.exists(), reason="the tests run without the checkout")


@DOCUMENTS
def test_the_python_examples_print_what_is_said(document: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    results = doctest.testfile(str(document), module_relative=False)
    assert results.attempted > 3
    assert results.failed == 0


@DOCUMENTS
def test_the_commands_run(document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(ROOT / "sample_images", tmp_path / "sample_images")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```console\n(.*?)```", document.read_text(), flags=re.DOTALL)
    commands = [
        line.removeprefix("$ ") for block in blocks for line in block.splitlines() if line.startswith("$ cvtimg")
    ]
    assert len(commands) > 3
    for command in commands:
        words = shlex.split(command.split("  #")[0])[1:]
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, f"{command}: {result.output}"
