"""The server of the page without a browser: who is let in, what is taken, and what is answered."""

import io
import json
import os
import re
import shlex
import signal
import struct
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from threading import Event, Timer, current_thread
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
import tifffile
from numpy.typing import NDArray
from PIL import Image

import cvtimg
from cvtimg._shared.progress import tell

pytest.importorskip("starlette")

from starlette.testclient import TestClient, WebSocketTestSession
from starlette.websockets import WebSocketDisconnect

from cvtimg.cli.app import main
from cvtimg.explore import TABS, serve, store
from cvtimg.explore.app import STATIC, Server
from cvtimg.explore.controls import parse_settings
from cvtimg.explore.guard import SESSION, Credentials
from cvtimg.explore.opened import HELD_PIXELS, MOST_PIXELS
from cvtimg.explore.tabs.base import Request

OWN = Credentials(8123, "right")
HOST = "http://127.0.0.1:8123"
ORIGIN = {"origin": HOST}
LIVE = "ws://127.0.0.1:8123/live"
PROTOCOLS = ["cvtimg", OWN.session]


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server(OWN)
    yield made
    made.store.close()


@pytest.fixture
def stranger(server: Server) -> TestClient:
    return TestClient(server.app, base_url=HOST, follow_redirects=False)


@pytest.fixture
def page(stranger: TestClient) -> TestClient:
    stranger.headers[SESSION] = OWN.session
    return stranger


def png(pixels: Any) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(buffer, "PNG")
    return buffer.getvalue()


class Reply(NamedTuple):
    number: int
    about: dict[str, Any]
    content: bytes

    @property
    def indices(self) -> NDArray[Any]:
        start = 4 * self.about["colors"]
        kind = f"<u{self.about['size']}"
        return np.frombuffer(self.content, kind, offset=start).reshape(self.about["height"], self.about["width"])

    @property
    def colors(self) -> NDArray[np.uint8]:
        return np.frombuffer(self.content, np.uint8, 4 * self.about["colors"]).reshape(-1, 4)

    @property
    def seen(self) -> NDArray[np.uint8]:
        return self.colors[self.indices][..., :3]


def answer(socket: WebSocketTestSession) -> dict[str, Any]:
    """Return the next message that does not only tell how far a search is, as under load any may."""
    message: dict[str, Any] = socket.receive()
    while "share" in json.loads(message.get("text") or "{}"):
        message = socket.receive()
    return message


def request(page: TestClient, picture: str, tab: str = "colors", lane: str = "exact", **more: Any) -> Reply:
    """Request for a result by a socket of its own."""
    settings = more.pop("settings", {})
    with page.websocket_connect(LIVE, PROTOCOLS, headers=dict(ORIGIN)) as socket:
        socket.send_json({"seq": 7, "lane": lane, "picture": picture, "tab": tab, "settings": settings, **more})
        return unpacked(answer(socket))


def unpacked(message: dict[str, Any]) -> Reply:
    if message.get("text"):
        return Reply(7, json.loads(message["text"]), b"")
    number, length = struct.unpack_from("<II", message["bytes"])
    about = json.loads(message["bytes"][8 : 8 + length])
    return Reply(number, about, message["bytes"][8 + length :])


def opened(page: TestClient, content: bytes, name: str = "a.png") -> dict[str, Any]:
    answer = page.post("/picture", params={"name": name}, content=content)
    assert answer.status_code == 200, answer.text
    about: dict[str, Any] = answer.json()
    return about


# Who is let in


def test_only_a_token_gives_the_session_that_opens_the_page(stranger: TestClient) -> None:
    assert stranger.get("/enter?token=wrong").status_code == 403
    assert stranger.get("/enter").status_code == 403
    answer = stranger.get("/enter?token=right")
    assert answer.status_code == 303
    place, _, session = answer.headers["location"].partition("#session=")
    assert place == "/"
    assert stranger.get("/about", headers={SESSION: session}).status_code == 200


def test_the_session_is_no_cookie_which_browsers_send_to_other_ports(stranger: TestClient) -> None:
    assert "set-cookie" not in stranger.get("/enter?token=right").headers
    for path in ("/about", "/curve/x/rgb", "/file/x/o.png", "/picture/x", "/nowhere"):
        for given in ("", "right", "wrong", "\xe9\x00".encode("latin-1")):
            assert stranger.get(path, headers={SESSION: given}).status_code == 403
    refused = stranger.get("/about", headers={"cookie": f"{SESSION}={OWN.session}"})
    assert (refused.status_code, refused.text) == (403, "open the address that cvtimg explore printed")


def test_a_token_for_one_visit_lets_in_once(stranger: TestClient) -> None:
    address = OWN.entrance(once=True).removeprefix(HOST)
    assert [stranger.get(address).status_code for _ in range(2)] == [303, 403]
    assert [stranger.get(OWN.entrance().removeprefix(HOST)).status_code for _ in range(2)] == [303, 303]


def test_the_browser_is_opened_through_a_file_of_this_user_that_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    def open_browser(address: str) -> None:
        path = Path(address.removeprefix("file://"))
        seen.append((path.stat().st_mode & 0o777, path.read_text()))

    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.setattr("webbrowser.open", open_browser)
    serve(idle_minutes=0, say=seen.append)
    (mode, text), printed = seen[1], seen[0]
    assert mode == 0o600
    assert "/enter?token=" in text
    assert printed not in text
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"host": "evil.example:8123"}, 421),
        ({"host": "127.0.0.1:80"}, 421),
        ({"host": "127.0.0.1:8123.evil.example"}, 421),
        ({"origin": "http://evil.example"}, 403),
        ({"origin": "null"}, 403),
        ({"origin": "https://127.0.0.1:8123"}, 403),
        ({"origin": "http://127.0.0.1:8124"}, 403),
        ({"sec-fetch-site": "cross-site"}, 403),
        ({"sec-fetch-site": "same-site"}, 403),
    ],
    ids=str,
)
def test_requests_of_other_pages_and_under_other_names_are_refused(
    headers: dict[str, str], status: int, page: TestClient
) -> None:
    assert page.get("/", headers=headers).status_code == status
    assert page.post("/picture", content=b"x", headers=headers).status_code == status
    assert page.get("/enter?token=right", headers=headers).status_code == status
    with pytest.raises(WebSocketDisconnect), page.websocket_connect(LIVE, PROTOCOLS, headers={**ORIGIN, **headers}):
        pass


def test_a_socket_needs_an_origin_and_the_session(page: TestClient) -> None:
    for protocols, headers in ((PROTOCOLS, {}), (None, ORIGIN), (["cvtimg", "wrong"], ORIGIN), (["cvtimg"], ORIGIN)):
        with pytest.raises(WebSocketDisconnect), page.websocket_connect(LIVE, protocols, headers=dict(headers)):
            pass
    with page.websocket_connect(LIVE, PROTOCOLS, headers=dict(ORIGIN)) as socket:
        assert socket.accepted_subprotocol == "cvtimg"
        socket.send_text("?")
        assert "not understood" in socket.receive_text()


@pytest.mark.parametrize("path", ["/", "/enter?token=wrong", "/enter?token=right", "/nowhere", "/curve/x/rgb"])
def test_every_answer_says_what_pages_may_do(path: str, page: TestClient) -> None:
    headers = page.get(path).headers
    policy = dict(part.split(" ", 1) for part in headers["content-security-policy"].split("; "))
    assert policy["default-src"] == policy["base-uri"] == policy["frame-ancestors"] == "'none'"
    assert "unsafe" not in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == "no-store"


@pytest.mark.parametrize(
    "path", ["/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/static/page.js", "/page.js/x", "/app.py", "/file/../x"]
)
def test_no_path_leads_out_of_the_page(path: str, page: TestClient) -> None:
    assert page.get(path).status_code == 404


def test_the_page_is_small_and_names_nothing_outside() -> None:
    files = [path.read_bytes().decode("latin-1") for path in STATIC.iterdir()]
    assert sum(map(len, files)) <= 120_000
    for text in files:
        outside = text.replace("http://www.w3.org/2000/svg", "")
        assert "http" not in outside
        assert "//cdn" not in outside


# What is taken


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"hello", "unknown image format"),
        (png(np.random.default_rng(0).integers(0, 256, (30, 30)))[:400], "truncated or damaged"),
        (b"<svg xmlns='http://www.w3.org/2000/svg'/>", "unknown image format"),
    ],
    ids=["empty", "text", "cut", "svg"],
)
def test_a_hostile_file_gets_a_message_and_the_page_goes_on(content: bytes, message: str, page: TestClient) -> None:
    answer = page.post("/picture", params={"name": "a.png"}, content=content)
    assert answer.status_code == 422
    assert message in answer.text
    assert answer.text.startswith("a.png: ")
    assert "/" not in answer.text
    assert opened(page, png(np.zeros((4, 5))))["width"] == 5


def test_a_file_that_claims_too_many_pixels_is_refused_by_its_header(page: TestClient) -> None:
    content = bytearray(png(np.zeros((4, 5))))
    content[16:24] = struct.pack(">II", 20_000, 8_000)
    content[29:33] = struct.pack(">I", __import__("zlib").crc32(bytes(content[12:29])))
    answer = page.post("/picture", params={"name": "a.png"}, content=bytes(content))
    assert answer.status_code == 422
    assert "160,000,000 pixels" in answer.text
    assert "--max-pixels" in answer.text


def test_pixels_are_limited_by_the_memory_there_is(page: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("psutil.virtual_memory", lambda: SimpleNamespace(available=48 * 2_500_000))
    assert page.get("/about").json()["megapixels"] == 2
    answer = page.post("/picture", params={"name": "a.png"}, content=png(np.zeros((2000, 1300))))
    assert answer.status_code == 422
    assert "2,600,000 pixels; the page takes up to 2,500,000" in answer.text


def test_limits_are_those_that_the_documentation_tells() -> None:
    text = " ".join((Path(__file__).parents[2] / "docs" / "explore.md").read_text().split())
    assert f"up to {MOST_PIXELS / 1e6:.0f} million pixels" in text
    assert f"The {dict.fromkeys([12], 'twelve')[store._MOST_PICTURES]} most recently" in text
    assert f"of up to {HELD_PIXELS / 1e6:.0f} megapixels together" in text
    assert f"{store.MOST_BYTES / 1e6:.0f} MB each and {store._MOST_SENT / 1e9:.1f} GB in total" in text


def test_what_is_kept_can_be_forgotten(page: TestClient, server: Server) -> None:
    about = opened(page, png(np.zeros((4, 5))))
    assert page.get(f"/picture/{about['id']}").json() == about  # as a page asks that is reloaded
    assert page.post("/forget").status_code == 200
    assert page.get(f"/picture/{about['id']}").status_code == 422
    assert not list(Path(server.store._folder.name).iterdir())


def test_a_server_that_stores_nothing_forgets_when_its_last_page_goes() -> None:
    server = Server(OWN, keep=False)
    page = TestClient(server.app, base_url=HOST)
    page.headers[SESSION] = OWN.session
    with page.websocket_connect(LIVE, PROTOCOLS, headers=dict(ORIGIN)):
        about = opened(page, png(np.zeros((4, 5))))
        assert page.get(f"/picture/{about['id']}").status_code == 200
    assert page.get(f"/picture/{about['id']}").status_code == 422
    server.store.close()


def test_files_over_the_limit_are_refused_announced_or_not(page: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cvtimg.explore.app.MOST_BYTES", 1000)
    assert page.post("/picture", content=bytes(1001)).status_code == 413
    assert page.post("/picture", content=(bytes(400) for _ in range(3))).status_code == 413
    assert page.post("/picture", content=bytes(999), headers={"content-length": "x"}).status_code in (400, 413)
    assert page.post("/palette", content=bytes(1001)).status_code == 413


@pytest.mark.parametrize("name", ["../../a.png", "..\\a.png", "/etc/a.png", "a.png/", "\x00\x1b[31ma.png", "." * 300])
def test_names_of_files_that_are_sent_lead_nowhere(name: str, page: TestClient, server: Server) -> None:
    about = opened(page, png(np.zeros((4, 5))), name)
    assert not set(about["name"]) & set("/\\\x00\x1b")
    path = server.store.picture(about["id"]).path
    assert path.parent == Path(server.store._folder.name)


def test_animations_and_files_of_pages_are_opened(page: TestClient) -> None:
    frames = [Image.new("L", (4, 4), level) for level in (0, 90)]
    for form, name, noun in (("GIF", "film.gif", "Frame"), ("TIFF", "pages.tif", "Page")):
        buffer = io.BytesIO()
        frames[0].save(buffer, form, save_all=True, append_images=frames[1:])
        answer = page.post("/picture", params={"name": name}, content=buffer.getvalue()).json()
        assert (answer["frames"], answer["noun"]) == (2, noun)


@pytest.mark.parametrize("tab", ["colors", "stipple"])
@pytest.mark.parametrize("how", [{}, {"channel": 2}, {"tints": ["#ff8000", "#00ff00", "#0000ff"]}], ids=str)
@pytest.mark.parametrize("axes", ["ZCYX", "CYX", "YXS"])
def test_channels_are_chosen_in_each_tab_as_the_command_and_python_choose_them(
    axes: str, how: Any, tab: str, page: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    values = np.random.default_rng(0).integers(0, 200, (2, 3, 8, 9), dtype=np.uint8)
    values = {"ZCYX": values, "CYX": values[0], "YXS": values[0, :2].transpose(1, 2, 0)}[axes]
    named = {"metadata": {"axes": axes, "Channel": {"Name": ["DAPI", "GFP", "RFP"]}}} if axes[-1] == "X" else {}
    form = {"photometric": "minisblack", **(named or {"planarconfig": "contig"})}
    tifffile.imwrite("cells.ome.tif", values, **form)
    picture = opened(page, Path("cells.ome.tif").read_bytes(), "cells.ome.tif")
    names = ["DAPI", "GFP", "RFP"] if named else ["1", "2"]
    assert (picture["frames"], picture["channels"]) == (2 if axes == "ZCYX" else 1, names)
    how = {name: value[: len(names)] if name == "tints" else value for name, value in how.items()}
    settings = {"n_dots": 20} if tab == "stipple" else {"k": 4}
    shown = request(page, picture["id"], tab=tab, frame=picture["frames"] - 1, settings=settings, **how).about
    (words, python) = (shown["recipes"][0][name] for name in ("command", "python"))
    assert ("--channel" if "channel" in how else "--composite") in words
    exec(python, {})
    file, unnamed = Path(shown["recipes"][0]["file"]), lambda content: re.sub(b"[0-9a-f-]{36}", b"", content)  # of OME
    content = unnamed(file.read_bytes())
    assert unnamed(page.get(f"/file/{shown['result']}/{shown['recipes'][0]['key']}").content) == content
    assert main([*shlex.split(words)[1:], "--overwrite", "--quiet"]) == 0
    assert unnamed(file.read_bytes()) == content
    assert "no channel 4" in request(page, picture["id"], channel=4).about["error"]


def test_pictures_beyond_those_in_memory_are_opened_again_when_they_are_needed(
    page: TestClient, server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "_MOST_PICTURES", 2)
    keys = [opened(page, png(np.full((4, 5), level)))["id"] for level in range(5)]
    assert [request(page, key).about["facts"]["k"] for key in keys] == [1] * 5
    assert len(server.store._pictures) == 2
    assert page.get(f"/picture/{keys[0]}").json()["id"] == keys[0]


def test_what_pages_send_together_has_a_limit_that_is_said(page: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    opened(page, png(np.zeros((4, 5))))
    monkeypatch.setattr(store, "_MOST_SENT", 100)
    answer = page.post("/picture", params={"name": "more.png"}, content=png(np.zeros((4, 5))))
    assert answer.status_code == 422
    assert answer.text.startswith("more.png: 0.0 GB are open")


def test_messages_speak_of_controls(page: TestClient) -> None:
    key = opened(page, png(np.arange(20).reshape(4, 5)))["id"]
    too_many = request(page, key, tab="mosaic", settings={"n_cells": 21}).about["error"]
    assert too_many.startswith("Tiles: 21 must be in 1..20")
    cells = {"way": "superpixels", "cells": 21}
    assert "Superpixels: 21 must be" in request(page, key, tab="segments", settings=cells).about["error"]


def test_one_archive_has_the_results_of_all_pictures(page: TestClient) -> None:
    keys = [opened(page, png(np.full((4, 5), level)))["id"] for level in (7, 99)]
    asked = {"tab": "colors", "settings": {"k": 2}, "output": "o.png"}
    requests = [json.dumps({**asked, "picture": key, "first": key == keys[0]}) for key in keys]
    sizes = [page.post("/all", content=content).json() for content in requests]
    with zipfile.ZipFile(io.BytesIO(page.get("/all.zip").content)) as archive:
        assert [(file.filename, file.file_size) for file in archive.infolist()] == [
            (one["name"], one["bytes"]) for one in sizes
        ]
        images = [cvtimg.read_image(io.BytesIO(archive.read(name))) for name in archive.namelist()]
    assert [image.min() for image in images] == [image.max() for image in images] == [7, 99]
    wrong = {**asked, "settings": {"k": 0}, "picture": keys[0]}
    assert page.post("/all", content=json.dumps(wrong)).status_code == 422


def test_settings_are_kept_by_name_but_not_what_belongs_to_a_picture(
    page: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    settings = {"regions": 7, "edits": ["merge 1,1 2,2"]}
    page.post("/presets", json={"name": " mine ", "tab": "segments", "settings": settings})
    kept = {"mine": {"tab": "segments", "settings": {"regions": 7}}}
    assert page.get("/about").json()["presets"] == kept
    for wrong in ({"name": ""}, {"name": "a", "tab": "none"}, {"name": "a", "tab": "segments", "settings": {"x": 1}}):
        assert page.post("/presets", json={"settings": {}, **wrong}).status_code == 422
    assert page.post("/presets", json={"name": "mine"}).json() == page.get("/about").json()["presets"] == {}
    (tmp_path / "cvtimg/presets.json").write_text("[1")
    assert page.get("/about").json()["presets"] == {}


@pytest.mark.parametrize("command", ["cvtimg info a.png", "rm -r x", "cvtimg quantize 'a", "cvtimg quantize a -k many"])
def test_a_text_that_is_no_command_of_a_tab_is_refused(page: TestClient, command: str) -> None:
    assert page.post("/command", content=command.encode()).status_code == 422


def test_a_file_that_is_no_image_is_told_by_its_name(page: TestClient) -> None:
    answer = page.post("/picture", params={"name": "a coast.geojson"}, content=b'{"type": "FeatureCollection"}')
    assert answer.status_code == 422
    assert "cvtimg mesh 'a coast.geojson' -o" in answer.text


# What is answered


NO_REQUESTS = (
    "",
    "[]",
    "{}",
    "{" * 5000,
    "9" * 70_000,
    '{"seq": -1, "lane": "draft"}',
    '{"seq": 1, "lane": "other"}',
    '{"seq": true, "lane": []}',
    '{"seq": 1e999, "lane": "draft"}',
)


def test_requests_that_make_no_sense_get_a_message(page: TestClient) -> None:
    for request in NO_REQUESTS:
        with page.websocket_connect(LIVE, PROTOCOLS, headers=dict(ORIGIN)) as socket:
            socket.send_text(request)
            assert json.loads(socket.receive_text())["error"] == "this request is not understood", request[:40]


#: What is changed in a request, and what the page answers.
NOT_ALLOWED: list[tuple[dict[str, Any], str]] = [
    ({"picture": "../x"}, "no longer open"),
    ({"tab": "other"}, "no such tab"),
    ({"settings": []}, "settings must be an object"),
    ({"settings": {"j": 1}}, "no setting 'j'"),
    ({"settings": {"k": "x"}}, "Colors: 'x' must be a whole number in 1..65536"),
    ({"settings": {"k": 2.5}}, "whole number"),
    ({"settings": {"k": True}}, "must be a whole number"),
    ({"settings": {"space": "cmyk"}}, "must be one of rgb, linear, lab, oklab"),
    ({"settings": {"locked": ["red; rm"]}}, "a color as #rrggbb"),
    ({"settings": {"aim": "palette"}}, "choose a palette, or open a file that has one"),
    ({"settings": {"aim": "palette", "palette": ["x"]}}, "no longer open"),
    ({"view": [1, 2]}, "view must be four numbers"),
    ({"view": [1, 2, "x", None]}, "view must be four numbers"),
]


def test_values_that_are_not_allowed_get_a_message(page: TestClient) -> None:
    picture = opened(page, png(np.zeros((1200, 1200, 3))))["id"]
    for changed, message in NOT_ALLOWED:
        reply = request(page, **{"picture": picture, "lane": "draft", "view": None, **changed})
        assert message in reply.about["error"], changed


def test_a_result_is_what_the_function_returns(page: TestClient, photograph: NDArray[Any]) -> None:
    picture = opened(page, png(photograph))["id"]
    reply = request(page, picture, settings={"k": 6, "dither": "blue-noise"})
    wanted = cvtimg.quantize(photograph, 6, dither="blue-noise")
    assert np.array_equal(reply.seen, wanted.image)
    assert reply.about["facts"]["psnr"] == wanted.psnr
    assert reply.about["facts"]["counts"] == np.bincount(wanted.indices.ravel()).tolist()


def test_a_draft_is_near_the_result(page: TestClient, server: Server, photograph: NDArray[Any]) -> None:
    picture = opened(page, png(photograph))["id"]
    server.store.picture(picture).curve("rgb", wait=True)
    draft, exact = (request(page, picture, lane=lane, settings={"k": 9}) for lane in ("draft", "exact"))
    assert len(draft.colors) == len(exact.colors) == 9
    assert abs(draft.about["facts"]["psnr"] - exact.about["facts"]["psnr"]) < 0.3
    locked = request(page, picture, lane="draft", settings={"k": 5, "locked": ["#00ff7f"]})
    assert [0, 255, 127, 255] in locked.colors.tolist()


def test_a_draft_of_a_restoration_shows_its_middle(page: TestClient) -> None:
    noisy = np.random.default_rng(4).normal(120, 9, (140, 150, 3)).astype(np.uint8)
    picture = opened(page, png(noisy))["id"]
    settings = {"way": "flat", "k": 2, "effort": "fast"}
    draft = request(page, picture, "restore", "draft", settings=settings)
    assert draft.about["window"] == [11, 6, 139, 134, 1]
    pixels = np.frombuffer(draft.content, np.uint8).reshape(128, 128, 4)
    assert (pixels[..., :3] != noisy[6:134, 11:139]).any(axis=2).mean() > 0.9


@pytest.mark.slow
def test_how_long_a_restoration_takes_is_told_by_one_of_another_size(
    page: TestClient, monkeypatch: pytest.MonkeyPatch, photograph: NDArray[Any]
) -> None:
    monkeypatch.setattr("cvtimg.explore.channel.ROWS_AT_ONCE", 1e4)
    monkeypatch.setattr("cvtimg.explore.channel.time", SimpleNamespace(monotonic=time.process_time))
    seconds: dict[str, float] = {}
    scene = np.tile(photograph, (3, 3, 1))[:640, :640] + np.random.default_rng(0).normal(0, 12, (640, 640, 3))
    with page.websocket_connect(LIVE, PROTOCOLS, headers=dict(ORIGIN)) as socket:
        for side in (320, 640):  # with five passes, and with four
            key = opened(page, png(np.clip(scene[:side, :side], 0, 255)))["id"]
            for number, lane in enumerate(("draft", "exact")):
                begun = time.process_time()
                socket.send_json({"seq": number, "lane": lane, "picture": key, "tab": "restore", "settings": {}})
                seconds[lane] = unpacked(answer(socket)).about["seconds"]
                taken = time.process_time() - begun
    assert 0.5 < seconds["draft"] / taken < 2


@pytest.mark.slow
def test_drafts_of_large_pictures_are_made_of_few_pixels(
    page: TestClient, server: Server, photograph: NDArray[Any]
) -> None:
    picture = opened(page, png(np.tile(photograph, (4, 4, 1))))["id"]
    asked: dict[str, tuple[dict[str, Any], int]] = {
        "segments": ({}, 10**4),
        "stipple": ({}, 4096),
        "mosaic": ({"n_cells": 5000}, 1024),
        "mesh": ({"n": 10**5}, 9000),
    }
    for tab, (settings, most) in asked.items():
        draft = request(page, picture, tab, "draft", settings=settings).about
        assert draft["window"][:4] == [0, 0, 1024, 1024]
        assert draft["window"][4] >= 3
        assert draft["facts"]["k"] <= most, tab
    settings = parse_settings(TABS["segments"].controls, {"min_size": 900, "smallest_detail": 3})
    opened_one = server.store.picture(picture)
    scaled = TABS["segments"].scaled(Request(opened_one, settings, server.store, opened_one.whole(1 << 20), step=3))
    assert (scaled["min_size"], scaled["smallest_detail"]) == (100, 1)


def test_of_a_large_picture_the_part_that_is_seen_is_sent(page: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cvtimg.explore.channel.PIXELS_AT_ONCE", 10_000)
    pixels = np.arange(400 * 300, dtype=np.uint32).view(np.uint8).reshape(300, 400, 4)[..., :3]
    picture = opened(page, png(pixels))["id"]
    whole = request(page, picture, lane="before").about["window"]
    assert whole == [0, 0, 400, 300, 4]
    reply = request(page, picture, lane="before", view=[100, 100, 160.5, 150])
    left, top, right, bottom, step = reply.about["window"]
    assert left <= 100 < 160 <= right
    assert top <= 100 < 150 <= bottom
    assert step == 1
    assert (right - left) * (bottom - top) <= 10_200
    cut = np.frombuffer(reply.content, np.uint8).reshape(bottom - top, right - left, 4)[..., :3]
    assert np.array_equal(cut, pixels[top:bottom, left:right])


def test_the_size_of_a_file_is_told_without_the_file(page: TestClient, photograph: NDArray[Any]) -> None:
    key = request(page, opened(page, png(photograph))["id"], settings={"k": 4}).about["result"]
    file = page.get(f"/file/{key}/o.png")
    assert page.head(f"/file/{key}/o.png").headers["content-length"] == str(len(file.content))
    assert file.headers["content-disposition"] == "attachment; filename*=UTF-8''a-quantized.png"
    assert page.get(f"/file/{key}/o.exe").status_code == 404
    assert page.get("/file/other/o.png").status_code == 404
    assert page.head("/file/other/o.png").status_code == 204  # which a browser does not report


def test_pages_share_the_pictures_of_the_command_line(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png(np.zeros((4, 5))))
    server = Server(OWN, [tmp_path / "a.png"])
    page = TestClient(server.app, base_url=HOST, headers={SESSION: OWN.session})
    first, second = (page.post("/given/0").json() for _ in range(2))
    assert first == second
    assert (first["name"], first["path"]) == ("a.png", str(tmp_path / "a.png"))
    assert page.post("/given/1").status_code == 422
    server.store.close()


def test_the_curve_is_that_of_the_picture(page: TestClient, photograph: NDArray[Any]) -> None:
    picture = opened(page, png(photograph))["id"]
    curve = page.get(f"/curve/{picture}/rgb").json()
    wanted = cvtimg.energy_curve(photograph, 64)
    assert curve["elbow"] == wanted.elbow()
    assert len(curve["heights"]) == 64
    assert curve["heights"][0] == 1
    assert sorted(curve["heights"], reverse=True) == curve["heights"]
    assert page.get(f"/curve/{picture}/cmyk").status_code == 422
    assert page.get("/curve/other/rgb").status_code == 422


def test_palettes_are_opened_and_used(page: TestClient, photograph: NDArray[Any]) -> None:
    picture = opened(page, png(photograph))["id"]
    palette = page.post("/palette", params={"name": "two.hex"}, content=b"ff0000\n00ff00\n").json()
    assert palette["colors"] == ["#ff0000", "#00ff00"]
    reply = request(page, picture, settings={"aim": "palette", "palette": [palette["id"]]})
    assert reply.colors.tolist() == [[255, 0, 0, 255], [0, 255, 0, 255]]
    assert page.post("/palette", params={"name": "a.ase"}, content=b"no").status_code == 422


def test_of_many_requests_the_last_is_answered_and_others_are_left_out(
    page: TestClient, photograph: NDArray[Any]
) -> None:
    picture = opened(page, png(photograph))["id"]
    answered = []
    with page.websocket_connect(LIVE, PROTOCOLS, headers=dict(ORIGIN)) as socket:
        for number in range(60):
            asked = {"seq": number, "lane": "draft", "picture": picture, "tab": "colors", "settings": {"k": 2 + number}}
            socket.send_json(asked)
        while not answered or answered[-1] != 59:
            answered.append(unpacked(answer(socket)).number)
    assert answered == sorted(answered)
    assert len(answered) < 60


def test_a_search_that_is_canceled_ends(page: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    picture = opened(page, png(np.zeros((4, 5))))["id"]
    begun, ended = Event(), Event()

    def endless(*_: Any) -> None:
        begun.set()
        try:
            while True:
                time.sleep(0.01)
                tell(0.5)
        finally:
            ended.set()

    monkeypatch.setattr(type(TABS["colors"]), "exact", endless)
    for over in ({"lane": "cancel"}, {"lane": "draft", "picture": picture, "tab": "colors", "settings": {}}):
        begun.clear()
        ended.clear()
        with page.websocket_connect(LIVE, PROTOCOLS, headers=dict(ORIGIN)) as socket:
            socket.send_json({"seq": 1, "lane": "exact", "picture": picture, "tab": "colors", "settings": {}})
            assert begun.wait(20)
            socket.send_json({"seq": 2, **over})
            assert json.loads(answer(socket)["text"]) == {"seq": 1, "lane": "exact", "error": ""}
            assert ended.wait(20)


def test_a_search_that_ends_after_a_newer_one_does_not_take_its_place(
    page: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture, exact, late, threads = opened(page, png(np.zeros((4, 5))))["id"], TABS["colors"].exact, Event(), []

    def slow(request: Request) -> Any:
        threads.append(current_thread())
        made = exact(request)  # after which nothing tells how far it is
        assert request.settings["k"] == 3 or late.wait(20)
        return made

    monkeypatch.setattr(TABS["colors"], "exact", slow)
    with page.websocket_connect(LIVE, PROTOCOLS, headers=dict(ORIGIN)) as socket:
        for number in (2, 3):
            asked = {"lane": "exact", "picture": picture, "tab": "colors", "settings": {"k": number}}
            socket.send_json({"seq": number, **asked})
            while len(threads) < number - 1:
                time.sleep(0.01)
        assert unpacked(answer(socket)).about["error"] == ""
        key = unpacked(answer(socket)).about["result"]
        late.set()
        threads[0].join()
        assert page.get(f"/file/{key}/o.png").status_code == 200


def test_a_search_tells_how_far_it_is(page: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def exact(request: Any) -> Any:
        for share in (0.25, 0.5):
            tell(share)
            time.sleep(0.3)
        raise ValueError("the end")

    monkeypatch.setattr(TABS["mosaic"], "exact", exact)
    about = opened(page, png(np.zeros((8, 8, 3))))
    with page.websocket_connect(LIVE, PROTOCOLS, headers=dict(ORIGIN)) as socket:
        socket.send_json({"seq": 1, "lane": "exact", "picture": about["id"], "tab": "mosaic", "settings": {}})
        replies = [socket.receive_json() for _ in range(3)]
    assert [reply.get("share") for reply in replies] == [0.25, 0.5, None]
    assert replies[2]["error"] == "the end"


def test_a_server_is_idle_when_its_last_page_has_gone(page: TestClient, server: Server) -> None:
    with page.websocket_connect(LIVE, PROTOCOLS, headers=dict(ORIGIN)) as socket:
        socket.send_text("?")
        socket.receive_text()
        assert server.idle_seconds == 0
    while not server.idle_seconds:  # until the clock ticks
        time.sleep(0.001)


@pytest.mark.skipif(os.name == "nt", reason="processes are not found by their numbers")
def test_what_a_killed_server_left_goes_at_the_next_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        ended.wait()
    (tmp_path / f"cvtimg-explore-{ended.pid}-door.html").write_text("a token")
    gone = tmp_path / f"cvtimg-explore-{ended.pid}-abc"
    others = [tmp_path / f"cvtimg-explore-{os.getpid()}-abc", tmp_path / "cvtimg-explore-x-abc"]
    for folder in (gone, *others):
        folder.mkdir()
        (folder / "a.png").write_bytes(b"x")
    store.Store().close()
    assert sorted(tmp_path.iterdir()) == sorted(others)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_uploads_go_when_a_signal_ends_the_server(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    number = getattr(signal, name)
    inherited = signal.signal(number, signal.SIG_DFL)  # nohup ignores SIGHUP, also in what it starts
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def soon(_: str) -> None:
        assert any(tmp_path.iterdir())
        Timer(0.1, os.kill, [os.getpid(), number]).start()

    try:
        with pytest.raises(SystemExit, match=str(128 + number)):
            serve(browser=False, say=soon)
        assert not any(tmp_path.iterdir())
        assert signal.getsignal(number) == signal.SIG_DFL
    finally:
        signal.signal(number, inherited)
