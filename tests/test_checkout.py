"""The checkout works as people use it: Python started in its root imports it, compiled code and all."""

import subprocess
import sys
from pathlib import Path

import pytest

import cvtimg

ROOT = Path(__file__).parent.parent

pytestmark = pytest.mark.skipif(
    not Path(cvtimg.__file__).is_relative_to(ROOT), reason="the tests run with an installed wheel"
)


@pytest.mark.timeout(60)
def test_the_lines_of_the_readme_work_when_typed_in_the_root_of_the_checkout() -> None:
    lines = """
import cvtimg
from cvtimg.engine import _kernels
image = cvtimg.read_image("sample_images/drawing.png")
print(len(cvtimg.quantize(image, 16).palette), cvtimg.__file__, _kernels.__file__, sep="\\n")
"""
    done = subprocess.run([sys.executable], input=lines, cwd=ROOT, capture_output=True, text=True, timeout=50)
    assert done.returncode == 0, done.stderr
    n_colors, package, kernels = done.stdout.splitlines()
    assert n_colors == "6"
    assert Path(package).is_relative_to(ROOT)
    assert Path(kernels).is_relative_to(ROOT)
