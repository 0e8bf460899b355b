"""A file is written whole or not at all, and replaces another only when asked."""

import csv
import errno
import os
import stat
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from images import GREY, RGB
from picture_files import save
from PIL import Image

from cvtimg.files import csv_text, write_csv
from cvtimg.files.whole import whole_file
from cvtimg.pictures.files import read_image, write_image

posix = pytest.mark.skipif(os.name == "nt", reason="POSIX permissions, links and devices")


def fail_midway(_self: Image.Image, file: Any, *_: Any, **__: Any) -> None:
    file.write(b"half")
    raise OSError("encoder error -2 when writing image file")


@pytest.mark.parametrize("old", [None, b"the old one"])
def test_a_failing_encoder_leaves_things_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, old: bytes | None
) -> None:
    path = tmp_path / "a.png"
    if old:
        path.write_bytes(old)
    monkeypatch.setattr(Image.Image, "save", fail_midway)
    with pytest.raises(OSError, match=r"a\.png: cannot be written \(encoder error -2"):
        write_image(path, RGB, overwrite=True)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == ([old] if old else [])


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_an_interrupted_block_leaves_nothing_and_keeps_its_error(tmp_path: Path, error: type[BaseException]) -> None:
    def write_half() -> None:
        with whole_file(tmp_path / "a.txt") as file:
            file.write(b"half")
            raise error

    with pytest.raises(error):
        write_half()
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_named_with_the_path(tmp_path: Path) -> None:
    full = r"a\.txt: cannot be written \(no space left on device\)$"
    with pytest.raises(OSError, match=full), whole_file(tmp_path / "a.txt"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_an_error_about_another_file_is_left_alone(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"elsewhere'$"), whole_file(tmp_path / "a.txt"):
        (tmp_path / "elsewhere").read_bytes()
    with pytest.raises(FileExistsError, match=tmp_path.name), whole_file(tmp_path / "a.txt"):
        tmp_path.mkdir()


def test_a_file_is_not_seen_before_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    with whole_file(path) as file:
        file.write(b"some")
        file.flush()
        assert not path.exists()
    assert path.read_bytes() == b"some"
    assert list(tmp_path.iterdir()) == [path]


def test_an_existing_file_is_replaced_only_when_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.png"
    write_image(path, RGB)
    with monkeypatch.context() as patch:
        patch.setattr(Image.Image, "save", fail_midway)  # refused before the work, not after
        with pytest.raises(FileExistsError, match=r"a\.png: exists already; pass overwrite"):
            write_image(path, GREY)
    np.testing.assert_array_equal(read_image(path), RGB)
    write_image(path, GREY, overwrite=True)
    np.testing.assert_array_equal(read_image(path), GREY)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("links", [True, False], ids=["hard links", "no hard links"])
def test_a_file_that_appears_meanwhile_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool) -> None:
    def unsupported(*_: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    if not links:
        monkeypatch.setattr(Path, "hardlink_to", unsupported)
    with whole_file(tmp_path / "new.txt") as file:
        file.write(b"mine")
    assert (tmp_path / "new.txt").read_bytes() == b"mine"
    with pytest.raises(FileExistsError, match="pass overwrite"), whole_file(tmp_path / "a.txt"):
        (tmp_path / "a.txt").write_bytes(b"theirs")
    assert (tmp_path / "a.txt").read_bytes() == b"theirs"
    assert len(list(tmp_path.iterdir())) == 2


def test_an_output_that_is_a_folder_or_in_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(IsADirectoryError, match=r"folder\.png: is a directory, not a file"):
        write_image(tmp_path / "folder.png", RGB, overwrite=True)
    with pytest.raises(FileNotFoundError, match=r"a\.png: folder .*missing does not exist"):
        write_image(tmp_path / "missing" / "a.png", RGB)


@pytest.fixture
def umask() -> Iterator[None]:
    before = os.umask(0o027)
    yield
    os.umask(before)


@posix
@pytest.mark.usefixtures("umask")
def test_permissions_follow_the_umask_and_stay_when_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    write_image(path, RGB)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    path.chmod(0o604)
    write_image(path, GREY, overwrite=True)
    assert stat.S_IMODE(path.stat().st_mode) == 0o604


@posix
def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "store").mkdir()
    (tmp_path / "a.png").symlink_to("store/real.png")
    for image in (RGB, GREY):
        write_image(tmp_path / "a.png", image, overwrite=True)
        assert (tmp_path / "a.png").is_symlink()
        np.testing.assert_array_equal(read_image(tmp_path / "store" / "real.png"), image)


@posix
def test_a_device_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(OSError, match=r"pipe\.png: is not a regular file"):
        write_image(tmp_path / "pipe.png", RGB, overwrite=True)
    assert (tmp_path / "pipe.png").is_fifo()


@posix
@pytest.mark.skipif(os.name != "nt" and os.geteuid() == 0, reason="root may write anywhere")
def test_what_may_not_be_read_or_written_is_said_so(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", RGB)
    path.chmod(0o444)
    with pytest.raises(PermissionError, match=r"a\.png: is write-protected"):
        write_image(path, RGB, overwrite=True)
    path.chmod(0)
    with pytest.raises(PermissionError, match=r"a\.png: permission denied"):
        read_image(path)
    tmp_path.chmod(0o555)
    with pytest.raises(PermissionError, match=r"b\.png: cannot be written \(permission denied"):
        write_image(tmp_path / "b.png", RGB)
    tmp_path.chmod(0o755)


TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\r\0"))
ROWS = st.integers(1, 4).flatmap(lambda n: st.lists(st.lists(TEXT, min_size=n, max_size=n), min_size=1))


@given(ROWS)
def test_any_text_comes_back_from_a_table(rows: list[list[str]]) -> None:
    names = [f"column {number}" for number in range(len(rows[0]))]
    assert list(csv.reader(StringIO(csv_text(names, rows), newline=""))) == [names, *rows]


def test_a_table_replaces_no_file_unless_asked(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    write_csv(path, ["k", "energy"], [[1, 0.1], [2, None]])
    assert path.read_text() == "k,energy\n1,0.1\n2,\n"
    with pytest.raises(FileExistsError, match=r"a\.csv"):
        write_csv(path, ["k"], [[1]])
    write_csv(path, ["name"], [["a\udcff.png"]], overwrite=True)
    assert path.read_bytes() == b"name\na\xff.png\n"
