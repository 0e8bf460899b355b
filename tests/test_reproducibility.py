import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from reproducible import RESULTS, hashed

ROOT = Path(__file__).parents[1]
#: Beside this process: three threads; and a processor of 2008, as our kernels, OpenBLAS, NumPy and C are told.
SETTINGS = {
    "threads": {"CVTIMG_THREADS": "3"},
    "old": {
        "CVTIMG_SIMD": "baseline",
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": "X86_V3",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA",
    },
}


@pytest.fixture(scope="module")
def hashes() -> dict[str, dict[str, str]]:
    others = {name: value for name, value in os.environ.items() if name not in SETTINGS["threads"] | SETTINGS["old"]}
    command = [sys.executable, str(ROOT / "tests/reproducible.py")]
    runs = {
        name: subprocess.Popen(command, env={**others, "CVTIMG_THREADS": "1", **chosen}, stdout=subprocess.PIPE)
        for name, chosen in SETTINGS.items()
    }
    here = {name: hashed(result()) for name, result in RESULTS.items()}
    return {"here": here, **{name: json.loads(run.communicate()[0]) for name, run in runs.items()}}


def table() -> list[list[str]]:
    lines = (ROOT / "docs/reproducibility.md").read_text(encoding="utf-8").splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| `")]


def promised(column: int) -> list[str]:
    return [row[0].strip("`") for row in table() if row[column] == "yes"]


def test_the_table_has_a_result_of_each_verb_that_is_compared() -> None:
    assert [row[0] for row in table()] == [f"`{name}`" for name in RESULTS]
    assert {cell for row in table() for cell in row[1:4]} == {"yes", "nearly"}


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", promised(1))
def test_the_number_of_threads_changes_no_byte(name: str, hashes: dict[str, dict[str, str]]) -> None:
    assert hashes["threads"][name] == hashes["here"][name]


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", promised(2))
def test_an_old_processor_gives_the_same_bytes(name: str, hashes: dict[str, dict[str, str]]) -> None:
    assert hashes["old"][name] == hashes["here"][name]
