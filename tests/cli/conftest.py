"""Tests of commands work in an empty folder and run the command line in their own process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from commands import Outcome, RowOf, Run

from cvtimg.cli.app import main


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run the command line."""

    def run(*arguments: object) -> Outcome:
        capsys.readouterr()  # of libraries that the test called before
        status = main([str(argument) for argument in arguments])
        return Outcome(status, *capsys.readouterr())

    return run


@pytest.fixture
def row_of(run: Run) -> RowOf:
    """Run the command line, which must succeed; return its one row."""

    def row_of(*arguments: object) -> dict[str, Any]:
        outcome = run(*arguments, "--json")
        assert outcome.status == 0, outcome.err
        (row,) = outcome.rows
        return row

    return row_of


@pytest.fixture
def told(run: Run) -> RowOf:
    """Run the command line; return its first row, the status, and what it complains of under "error"."""

    def told(*arguments: object) -> dict[str, Any]:
        outcome = run(*arguments, "--overwrite", "--json")
        return {**(outcome.rows[0] if outcome.out else {}), "status": outcome.status, "error": outcome.err}

    return told
