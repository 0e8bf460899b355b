"""What several tests look at."""

import gc
import os
import signal
from pathlib import Path
from typing import Any

import pytest
from commands import Outcome, RowOf, Run
from hypothesis import HealthCheck, settings

from cvtimg._shared.types import Array

# Results prove themselves, also in the processes that tests start; read when cvtimg is imported, so before that.
os.environ["CVTIMG_CHECK"] = "1"

from cvtimg import read_image

# What imports and collection make stays until the end: the garbage collector need not walk it again and again, which
# takes a fifth of the time of all tests.
gc.disable()

# What a shell starts in the background ignores Ctrl-C, which tests send to themselves and to programs they start.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Machines that run tests are busy, or emulated: slow examples are not a failure. Examples are the same in each run, so
# that none fails by chance; `pytest --hypothesis-profile=explore` looks for others.
settings.register_profile("explore", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("cvtimg", settings.get_profile("explore"), derandomize=True, database=None)
settings.load_profile("cvtimg")

SAMPLES = Path(__file__).parent.parent / "sample_images"


def pytest_collection_finish() -> None:
    """Collect garbage among what the tests make."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def photograph() -> Array:
    """Return a photograph of 256 x 256 RGB pixels."""
    return read_image(SAMPLES / "astronaut.png")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run the command line."""
    from cvtimg.cli.app import main

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
