"""Files elsewhere are read and written where the work is, whole or not at all."""

import functools
import http.server
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cvtimg import quantize, read_image, write_image
from cvtimg.cli import app as cli
from cvtimg.cli.gridding import read_grid_points
from cvtimg.files import find_images
from cvtimg.files.remote import is_remote, local_copy, url_of
from cvtimg.files.whole import local_path, whole_file
from cvtimg.labels import read_labels, write_labels
from cvtimg.palettes import read_palette, write_palette
from cvtimg.pictures import (
    Form,
    Frames,
    Metadata,
    image_info,
    is_animated,
    open_bands,
    read_frames,
    read_metadata,
    read_pages,
    write_bands,
    write_frames,
    write_pages,
)

fsspec = pytest.importorskip("fsspec")
RNG = np.random.default_rng(9)
PICTURES = {name: RNG.integers(0, 256, (9, 12, 3), np.uint8) for name in ("a.png", "deep/b.png", "c.bmp")}


@pytest.fixture
def memory(here: Path) -> Iterator[object]:
    """Put pictures into a file system in memory; work in an empty folder."""
    files = fsspec.filesystem("memory")
    for name, picture in PICTURES.items():
        write_image(f"x{Path(name).suffix}", picture, overwrite=True)
        files.makedirs(f"/in/{Path(name).parent}", exist_ok=True)
        files.put_file(f"x{Path(name).suffix}", f"/in/{name}")
    files.pipe_file("/in/notes.txt", b"no picture")
    yield files
    files.store.clear()
    files.pseudo_dirs[:] = [""]


def test_urls_are_paths_and_come_back() -> None:
    for url in ("s3://bucket/a b.png", "https://host:80/a/b.png", "memory://x"):
        assert is_remote(url)
        assert is_remote(Path(url))
        assert url_of(Path(url)) == url
    for path in ("a.png", "/a/b.png", "C:/a.png", "a:b.png", "-"):
        assert not is_remote(path)
        assert url_of(path) == path


def test_a_file_is_not_replaced_unless_asked(memory: object, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["quantize", "memory://in/a.png", "-o", "memory://out/a.png", "--quiet"]
    assert cli.main([*command, "-k", "4"]) == 0
    assert cli.main([*command, "-k", "2"]) == 1
    assert "cvtimg: memory://in/a.png: memory://out/a.png: exists already" in capsys.readouterr().err
    assert cli.main([*command, "-k", "2", "--skip-existing"]) == 0
    assert cli.main([*command, "-k", "2", "--overwrite"]) == 0
    assert len(np.unique(read_image("memory://out/a.png").reshape(-1, 3), axis=0)) == 2


@pytest.mark.parametrize("output", ["memory://in/a.png", "memory:///in/a.png"])
def test_an_input_elsewhere_is_never_replaced(memory: object, capsys: pytest.CaptureFixture[str], output: str) -> None:
    before = in_memory("in/a.png")
    assert cli.main(["quantize", "memory://in/a.png", "-k", "4", "-o", output, "--overwrite"]) == 2
    assert "memory://in/a.png is an input" in capsys.readouterr().err.replace(":///", "://")
    assert in_memory("in/a.png") == before


def test_a_report_elsewhere_keeps_the_rows_of_earlier_runs(memory: object) -> None:
    for name in ("memory://in/a.png", "memory://in/c.bmp"):
        command = ["quantize", name, "-k", "4", "--out-dir", "out", "--quiet", "--skip-existing"]
        assert cli.main([*command, "--report", "memory://rows.csv"]) == 0
    assert in_memory("rows.csv").count(b"\ndone,memory://in/") == 2


def test_an_array_that_replaces_another_keeps_none_of_its_chunks(memory: object) -> None:
    zarr = pytest.importorskip("zarr")
    for value in (1, 0):  # chunks of zeros are not stored
        array = zarr.create_array(f"{value}.zarr", shape=(4,), dtype="u1", fill_value=0)
        array[:] = value
        with local_path("memory://out/a.zarr", overwrite=True) as copy:
            shutil.copytree(f"{value}.zarr", copy)
    with local_copy("memory://out/a.zarr") as copy:
        assert (zarr.open_array(str(copy))[:] == 0).all()


def test_an_array_elsewhere_is_segmented_in_tiles(memory: object) -> None:
    zarr = pytest.importorskip("zarr")
    zarr.create_array("near.zarr", data=PICTURES["a.png"], chunks=(4, 4, 3))
    with local_path("memory://far.zarr", overwrite=False) as copy:
        shutil.copytree("near.zarr", copy)
    for source, output in (("memory://far.zarr", "memory://labels.zarr"), ("near.zarr", "labels.zarr")):
        assert cli.main(["segment", source, "-k", "2", "-o", output, "--quiet"]) == 0
    with local_copy("memory://labels.zarr") as copy:
        np.testing.assert_array_equal(zarr.open_array(str(copy))[:], zarr.open_array("labels.zarr")[:])


def test_errors_of_any_kind_name_the_url_of_a_copy(memory: object) -> None:
    with local_copy("memory://in/notes.txt") as copy:
        assert copy.read_text(encoding="utf-8") == "no picture"
    with pytest.raises(ValueError, match="can't decode byte"), local_copy("memory://in/a.png") as copy:
        copy.read_text(encoding="utf-8")


def test_a_bad_file_is_named_by_its_url_and_writes_nothing(memory: object, capsys: pytest.CaptureFixture[str]) -> None:
    with fsspec.open("memory://in/bad.png", "wb") as file:
        file.write(b"no picture")
    assert cli.main(["quantize", "memory://in", "-k", "4", "--out-dir", "memory://out", "--quiet"]) == 1
    assert capsys.readouterr().err == "cvtimg: memory://in/bad.png: cannot be read: unknown image format\n"
    assert len(fsspec.filesystem("memory").find("/out")) == 3
    assert cli.main(["info", "memory://in/none.png", "--quiet"]) == 1
    assert "memory://in/none.png: no such file" in capsys.readouterr().err


def in_memory(name: str) -> bytes:
    with fsspec.open(f"memory://{name}", "rb") as file:
        content: bytes = file.read()
    return content


def test_one_palette_for_a_folder_in_memory_is_that_for_a_folder_here(memory: object) -> None:
    for name, picture in PICTURES.items():
        Path("here", name).parent.mkdir(parents=True, exist_ok=True)
        write_image(f"here/{name}", picture)
    options = ["-k", "4", "--shared-palette", "--quiet"]
    far = ["--out-dir", "memory://out", "--save-palette", "memory://p.gpl", "--report", "memory://r.csv"]
    assert cli.main(["quantize", "memory://in", *options, *far]) == 0
    assert cli.main(["quantize", "here", *options, "--out-dir", "out", "--save-palette", "p.gpl"]) == 0
    assert not any("memory:" in path.name for path in Path().iterdir())
    assert in_memory("p.gpl") == Path("p.gpl").read_bytes()
    assert in_memory("out/deep/b.png") == Path("out/deep/b.png").read_bytes()
    assert in_memory("r.csv").count(b"memory://in/") == 3
    assert cli.main(["quantize", "memory://in/a.png", "--palette", "memory://p.gpl", "-o", "b.png", "--quiet"]) == 0
    assert Path("b.png").read_bytes() == in_memory("out/a.png")


def test_files_that_are_read_besides_may_be_elsewhere(memory: object, capsys: pytest.CaptureFixture[str]) -> None:
    write_image("mask.png", np.tile(np.uint8([0, 255]), (9, 6)))
    fsspec.filesystem("memory").put_file("mask.png", "/mask.png")
    for mask, output in (("memory://mask.png", "memory://far.png"), ("mask.png", "near.png")):
        assert cli.main(["segment", "memory://in/a.png", "-k", "3", "--mask", mask, "-o", output, "--quiet"]) == 0
    assert in_memory("far.png") == Path("near.png").read_bytes()
    assert cli.main(["segment", "memory://in/a.png", "-k", "3", "--mask", "memory://none.png", "-o", "c.png"]) == 1
    assert "memory://none.png: cannot be read" in capsys.readouterr().err


def test_a_file_that_fails_half_way_is_not_there(memory: object) -> None:
    with pytest.raises(ZeroDivisionError), whole_file("memory://half.txt") as file:
        file.write(bytes(1 // 0))
    assert not fsspec.filesystem("memory").exists("/half.txt")


def test_designs_and_grids_go_on_from_tables_elsewhere(memory: object) -> None:
    tables = {"axes": "name,low,high\nx,0,1\ny,2,9\n", "runs": "x,y\n0.1,3\n0.6,8\n", "grid": "x,y,z\n1,0,0\n0,1,0\n"}
    for name, text in tables.items():
        Path(f"{name}.csv").write_text(text)
        fsspec.filesystem("memory").put_file(f"{name}.csv", f"/{name}.csv")
    for place, output in (("", "near.csv"), ("memory://", "memory://far.csv")):
        given = ["--bounds", f"{place}axes.csv", "--existing", f"{place}runs.csv", "-o", output]
        assert cli.main(["design", "-n", "4", *given, "--quiet"]) == 0
    assert in_memory("far.csv") == Path("near.csv").read_bytes()
    assert read_grid_points(Path("memory://grid.csv")).shape == (2, 3)


def test_a_server_is_read(here: Path) -> None:
    pytest.importorskip("aiohttp")
    Path("site").mkdir()
    write_image("site/a.png", PICTURES["a.png"])

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *arguments: object) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory="site"))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        url = f"http://127.0.0.1:{server.server_port}/a.png"
        assert cli.main(["quantize", url, "-k", "4", "-o", "b.png", "--quiet"]) == 0
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    np.testing.assert_array_equal(read_image("b.png"), quantize(PICTURES["a.png"], 4).image)


def test_whatever_is_written_at_a_url_is_read_back_from_there(memory: object) -> None:
    picture = PICTURES["a.png"]
    frames = Frames((picture, picture[::-1].copy()), (40.0, 60.0), 0)
    write_frames("memory://film.png", frames)
    assert is_animated("memory://film.png")
    assert read_frames("memory://film.png").durations == frames.durations
    write_pages("memory://pages.tif", np.stack(frames.images))
    assert image_info("memory://pages.tif").frames == 2
    np.testing.assert_array_equal(read_pages("memory://pages.tif").images[1], frames.images[1])
    write_image("memory://marked.png", picture, metadata=Metadata(dpi=(300, 300)))
    assert round(read_metadata("memory://marked.png").dpi[0]) == 300
    write_labels("memory://labels.png", [[0, 1, 200]])
    assert read_labels("memory://labels.png").tolist() == [[0, 1, 200]]
    write_palette("memory://colors.hex", picture[0])
    np.testing.assert_array_equal(read_palette("memory://colors.hex"), picture[0])
    for name in ("memory://tiles.tif", "memory://tiles.zarr"):
        if name.endswith("zarr"):
            pytest.importorskip("zarr")
        write_bands(name, Form(picture.shape, picture.dtype), [picture])
        np.testing.assert_array_equal(np.concatenate(list(open_bands(name))), picture)
    assert [path.name for path in find_images("memory://in")] == ["a.png", "c.bmp", "b.png"]


def test_a_server_that_does_not_answer_is_not_a_missing_file(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("aiohttp")
    assert cli.main(["info", "http://127.0.0.1:9/a.png", "--quiet"]) == 1
    err = capsys.readouterr().err
    assert "http://127.0.0.1:9/a.png: cannot be read" in err
    assert "no such file" not in err
