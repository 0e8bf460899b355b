"""Files that were damaged, or made to harm, end in a right result or in an error of one line."""

import subprocess
import sys
from functools import cache
from pathlib import Path

import hostile
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st


@cache
def seeds() -> dict[str, bytes]:
    """Make the whole files once, and only in a process that runs these tests."""
    return dict(hostile.seeds())


@pytest.mark.slow
def test_files_that_lie_end_in_one_line(tmp_path: Path) -> None:
    verdicts = {}
    for name, content in hostile.made():
        (tmp_path / name).write_bytes(content)
        verdicts[name] = hostile.judge(tmp_path / name)
    assert {name: verdict for name, verdict in verdicts.items() if verdict not in ("right", "error")} == {}
    assert verdicts["tiny.tif"] == verdicts["loop.tif"] == verdicts["wrong-jpeg.png"] == "right"
    for name in ("bomb.png", "empty.png", "pickle.npy", "size-1.tif", "size-7.tif"):
        assert verdicts[name] == "error"


@pytest.mark.parametrize("name", ["stack-plain.tif", "deep-stack-imagej.tif", "bands-u2-big-5.tif"])
def test_pages_and_bands_are_right(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(seeds()[name])
    assert hostile.judge(tmp_path / name) == "right"


@pytest.mark.slow
@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    name=st.deferred(lambda: st.sampled_from(sorted(seeds()))),
    cut=st.integers(0, 4000),
    changes=st.lists(st.tuples(st.integers(0, 400), st.integers(0, 255)), max_size=6),
)
def test_any_damage_ends_in_a_result_or_in_one_line(
    tmp_path: Path, name: str, cut: int, changes: list[tuple[int, int]]
) -> None:
    content = bytearray(seeds()[name])
    for at, value in changes:
        content[at % len(content)] = value
    path = tmp_path / name
    path.write_bytes(content[: len(content) - cut % 50])
    assert hostile.judge(path) in ("right", "error")


def test_libraries_do_not_talk_in_between(tmp_path: Path) -> None:
    content = seeds()["tiff-tiff_lzw.tif"]
    (tmp_path / "bad.tif").write_bytes(content[:200] + bytes(60) + content[260:])
    command = [sys.executable, "-P", "-m", "cvtimg", "info", "bad.tif"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert done.stderr.startswith("cvtimg: bad.tif: is truncated or damaged")
