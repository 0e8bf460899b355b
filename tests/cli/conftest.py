"""Tests of commands work in an empty folder."""

from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def here(here: Path) -> Path:
    """Work in an empty folder."""
    return here
