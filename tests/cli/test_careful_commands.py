"""Commands touch nothing that was not named, and say before what they would do."""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from commands import RowOf, Run

from cvtimg import find_images, read_image, read_palette, write_image
from cvtimg.bases import read_basis
from cvtimg.batch.plans import find
from cvtimg.batch.tasks import WrongUsageError
from cvtimg.cli.overview import COMMANDS
from cvtimg.labels import read_labels
from cvtimg.options import options_of
from cvtimg.options.common import quality
from cvtimg.options.record import File
from cvtimg.tables import find_tables, read_table

#: A call of each command that writes, without names of outputs that are its own to choose.
WRITING = {
    "quantize": "quantize in -k 4 --out-dir out",
    "quantize --shared-palette": "quantize in -k 4 --shared-palette --save-palette p.hex --out-dir out",
    "quantize --in-place": "quantize in -k 4 --in-place",
    "palette": "palette in/a.png --save-palette p.gpl",
    "segment": "segment in --out-dir out --write labels,table",
    "restore": "restore in/a.png in/b.png -o r.png --sheet s.png",
    "stipple": "stipple in/a.png -n 9",
    "mosaic": "mosaic in/a.png -n 9",
    "mesh": "mesh mask.png -n 9 -o m.vtu",
    "sphere": "sphere -n 12 -o g.csv",
    "cluster": "cluster in/t.csv -k 2 --generators g.csv",
    "elbow": "elbow in/t.csv --csv e.csv",
    "design": "design -n 4 -d 2 -o d.csv",
    "basis": "basis in/a.png in/b.png -n 1 -o b.npz",
}


@pytest.fixture(autouse=True)
def inputs(here: Path) -> None:
    Path("in").mkdir()
    rng = np.random.default_rng(0)
    for name in ("a.png", "b.png"):
        write_image(Path("in", name), rng.integers(0, 256, (12, 16, 3), np.uint8))
    write_image("mask.png", np.full((12, 16), 255, np.uint8))
    Path("in/t.csv").write_text("a,b\n" + "".join(f"{a},{b}\n" for a, b in rng.normal(size=(20, 2))))


def contents() -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}


@pytest.mark.parametrize("verb", COMMANDS)
def test_no_command_takes_an_empty_name(verb: str, run: Run) -> None:
    before = contents()
    for option in options_of(verb):
        if isinstance(option.kind, File) or not option.words:
            with pytest.raises(ValueError, match="an empty text is no value"):
                option.parse([""] if option.many else "")
            assert run(verb, *(["in/a.png"] if option.words else []), *option.words[-1:], "").status == 2
    assert contents() == before


def test_a_list_of_names_is_no_empty_name_and_finding_takes_none(run: Run) -> None:
    for takes in (find_images, find_tables, read_image, read_labels, read_palette, read_table, read_basis):
        with pytest.raises(ValueError, match="an empty name names no file"):
            takes("")
    for text in ("", "@"):
        with pytest.raises(WrongUsageError, match="an empty name names no file"):
            find([text])
    assert run("quantize", "@", "-k", "4", "--in-place").status == 2


def test_the_images_of_a_folder_are_replaced_only_if_that_is_allowed(
    run: Run, row_of: RowOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = contents()
    Path("list").write_text("in\n")
    for folder in ("in", "./in/", "i*", "@list"):
        outcome = run("quantize", folder, "-k", "4", "--in-place")
        assert (outcome.status, contents().items() >= before.items()) == (2, True)
        assert "--in-place would replace 2 images in " in outcome.err
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    for answer, status in ((False, 1), (True, 0)):
        monkeypatch.setattr("typer.confirm", lambda text, *, err, said=answer: said and "2 images" in text)
        assert run("quantize", "in", "-k", "200", "--in-place").status == status
        assert (contents()[Path("in/a.png")] == before[Path("in/a.png")]) == (not answer)
    monkeypatch.undo()


@pytest.mark.parametrize("given", [["in", "--yes"], ["in", "-y"], ["in", "--overwrite"], ["in/*.png"], ["in/a.png"]])
def test_images_that_are_named_and_folders_that_are_allowed_are_replaced(given: list[str], run: Run) -> None:
    before = contents()
    assert run("quantize", *given, "-k", "4", "--in-place").status == 0
    assert contents()[Path("in/a.png")] != before[Path("in/a.png")]


@pytest.mark.parametrize("words", WRITING.values(), ids=WRITING)
def test_a_dry_run_names_the_files_that_the_run_writes_and_touches_nothing(words: str, run: Run) -> None:
    before, folders = contents(), {path for path in Path().rglob("*") if path.is_dir()}
    outcome = run(*words.split(), "--dry-run")
    assert outcome.status == 0, outcome.err
    assert contents() == before
    assert {path for path in Path().rglob("*") if path.is_dir()} == folders
    named = {Path(line.partition("-> ")[2]) for line in outcome.out.splitlines()}
    ended = run(*words.split(), *(["--yes"] if "--in-place" in words else []))
    assert ended.status == 0, ended.err
    assert named == {path for path, content in contents().items() if before.get(path) != content}


def test_a_dry_run_tells_its_outputs_as_json(run: Run) -> None:
    Path("o.png").touch()
    (row,) = run("quantize", "in/a.png", "-k", "4", "-o", "o.png", "--dry-run", "--overwrite", "--json").rows
    assert row == {"input": "in/a.png", "output": "o.png", "outputs": {"-o": "o.png"}}


@pytest.mark.parametrize("verb", COMMANDS)
def test_options_that_name_files_say_whether_these_are_read_or_written(verb: str) -> None:
    for option in options_of(verb):
        if isinstance(option.kind, File) and option.name not in ("report", "out_dir"):
            assert option.role in ("reads", "writes"), option.name
            is_output = re.match(
                r"(?!Image|Map)\w*(?:.*: )?(?:[Ww]rite|Plot|Draw|Output|Grid: |Mesh file)", option.help
            )
            assert (option.role == "writes") == bool(is_output), option.help


def test_a_file_that_is_replaced_keeps_its_mode_owner_and_times_and_other_names_their_content(run: Run) -> None:
    path, other = Path("in/a.png"), Path("other.png")
    before = path.read_bytes()
    path.chmod(0o640)
    os.utime(path, (10**9, 10**9))
    other.hardlink_to(path)
    if os.geteuid() == 0:
        os.chown(path, 1234, 2345)
    owner = path.stat().st_uid, path.stat().st_gid
    assert run("quantize", path, "-k", "4", "--in-place", "--preserve").status == 0
    status = path.stat()
    assert (status.st_mode & 0o777, (status.st_uid, status.st_gid), status.st_mtime) == (0o640, owner, 10**9)
    assert other.read_bytes() == before != path.read_bytes()
    assert run("quantize", path, "-k", "3", "--in-place").status == 0
    assert path.stat().st_mtime > 10**9


def test_usual_short_forms_are_taken(run: Run) -> None:
    assert re.fullmatch(r"cvtimg \d+\.\d+\.\d+\S*\n", run("-V").out)
    assert run("palette", "in/a.png", "-k", "2", "-q").out == ""
    assert [quality(text) for text in ("80-", "-80", "60-80", "80")] == [(80, 100), (0, 80), (60, 80), 80]
    for wrong in ("-", "80-60", "a-", "--"):
        with pytest.raises(ValueError, match="or a range such as 60-80"):
            quality(wrong)
