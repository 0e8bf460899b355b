"""What several tests look at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from numpy.typing import NDArray

from cvtimg import read_image

# Machines that run tests are busy: a slow example is not a failure.
settings.register_profile("cvtimg", deadline=None)
settings.load_profile("cvtimg")

SAMPLES = Path(__file__).parent.parent / "sample_images"


@pytest.fixture(scope="session")
def photograph() -> NDArray[Any]:
    """Return a photograph of 256 x 256 RGB pixels."""
    return read_image(SAMPLES / "astronaut.png")
