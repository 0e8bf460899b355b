"""The server's addresses."""

from __future__ import annotations

import asyncio
import json
import re
import time
from collections.abc import Callable, Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from cvtimg._shared.choices import Json, SpaceName
from cvtimg.colors import SPACES
from cvtimg.explore.alternatives import WANTED, fitting, seen_quality
from cvtimg.explore.channel import Channel
from cvtimg.explore.collection import add_result
from cvtimg.explore.controls import UnfitRequestError
from cvtimg.explore.guard import ENTRANCE, Credentials, Guard
from cvtimg.explore.opened import most_pixels
from cvtimg.explore.pasted import settings_of
from cvtimg.explore.presets import change_presets, presets
from cvtimg.explore.store import KNOWN, MOST_BYTES, Store
from cvtimg.explore.tabs import TABS, opened

_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
}
_STATIC = Path(__file__).parent / "static"


def static_files() -> dict[str, Path]:
    """Return the files of the page by their addresses; no other file is ever sent."""
    files = {f"/{path.name}": path for path in sorted(_STATIC.iterdir()) if path.suffix in _KINDS}
    return {"/": files.pop("/index.html"), **files}


class Server:
    """The ASGI application `app`, what is open, and when it was last used."""

    def __init__(self, credentials: Credentials, paths: Sequence[Path] = (), keep: bool = True) -> None:
        self.store = Store()
        self._own, self._paths, self._keep = credentials, paths, keep
        self._n_pages, self._last_used = 0, time.monotonic()
        files = static_files()
        routes: list[Any] = [Route(address, self._static(path)) for address, path in files.items()]
        routes += [
            Route(ENTRANCE, self._enter),
            Route("/about", self._about),
            Route("/thumbnail/{key}", self._thumbnail),
            Route("/all.zip", self._all),
            Route("/forget", self._forget, methods=["POST"]),
            Route("/file/{result}/{output}", self._file),
            WebSocketRoute("/live", self._live),
        ]
        store, described = self.store, self.store.described
        asked: dict[str, Callable[..., Json]] = {
            "/picture/{key}": described,
            "/distinct/{key}": lambda key: {"distinct": store.picture(key).samples.n_colors},
            "/given/{number:int}": self._given,
            "/curve/{picture}/{space}": self._curve,
        }
        sent: dict[str, Callable[[str, bytes], Json]] = {
            "/picture": lambda name, content: described(store.open_sent(name, content).key),
            "/sample": lambda name, content: described(store.open_sent("sample.png", _sample()).key),
            "/palette": store.open_palette,
            "/command": lambda name, content: settings_of(content.decode(errors="replace")),
            "/all": lambda name, content: add_result(store, _understood(content)),
            "/presets": lambda name, content: self._presets(_understood(content)),
            "/resize": lambda name, content: self._resized(_understood(content)),
        }
        routes += [
            Route(address, partial(self._answer, make), methods=["GET", "POST"]) for address, make in asked.items()
        ]
        routes += [Route(address, partial(self._take, use), methods=["POST"]) for address, use in sent.items()]
        self.app = Guard(Starlette(routes=routes), credentials, files)

    @property
    def idle_seconds(self) -> float:
        """Seconds since the last page went; 0 while one is open."""
        return 0.0 if self._n_pages else time.monotonic() - self._last_used

    def _static(self, path: Path) -> Callable[[Request], Any]:
        async def send(request: Request) -> Response:
            self._last_used = time.monotonic()
            return Response(path.read_bytes(), media_type=_KINDS[path.suffix])

        return send

    async def _enter(self, request: Request) -> Response:
        if not self._own.admit(request.query_params.get("token", "")):
            return PlainTextResponse("open the address that cvtimg explore printed", 403)
        self._last_used = time.monotonic()
        return RedirectResponse(f"/#session={self._own.session}", 303)  # what is behind # is never sent

    async def _about(self, request: Request) -> Response:
        about = {
            "tabs": [tab.described() for tab in TABS.values()],
            "given": [path.name for path in self._paths],
            "keep": self._keep,
            "presets": presets(),
            "wanted": WANTED.described(),
            "megapixels": most_pixels() // 10**6,
            "megabytes": MOST_BYTES // 10**6,
            "palettes": [{"id": name, "name": name} for name in KNOWN],
        }
        return JSONResponse(about)

    async def _thumbnail(self, request: Request) -> Response:
        try:
            return Response(self.store.thumbnail(request.path_params["key"]), media_type="image/png")
        except UnfitRequestError as error:
            return PlainTextResponse(str(error), 422)

    async def _all(self, request: Request) -> Response:
        return FileResponse(self.store.archive, media_type="application/zip")

    def _presets(self, asked: Json) -> Json:
        if not self._keep:
            raise UnfitRequestError("with --no-store nothing is kept, and settings are not saved by name")
        return change_presets(asked)

    async def _answer(self, make: Callable[..., Json], request: Request) -> Response:
        return await _answered(lambda: make(**request.path_params))

    async def _take(self, use: Callable[[str, bytes], Json], request: Request) -> Response:
        """Take a file that a page sends, up to the limit."""
        self._last_used = time.monotonic()
        most = f"{MOST_BYTES / 1e6:.0f} MB, more than the page takes; use the command line, or name it there to open it"
        too_large = PlainTextResponse(f"the file has over {most}", 413)
        announced = request.headers.get("content-length", "0")
        if not announced.isdigit() or int(announced) > MOST_BYTES:
            return too_large
        content = bytearray()
        async for part in request.stream():
            content += part
            if len(content) > MOST_BYTES:
                return too_large
        return await _answered(lambda: use(request.query_params.get("name", "image"), bytes(content)))

    def _given(self, number: int) -> Json:
        if number >= len(self._paths):
            raise UnfitRequestError("there is no such image")
        return self.store.described(self.store.key_of(self._paths[number]))

    def _resized(self, asked: Json) -> Json:
        return self.store.described(self.store.resized(opened(self.store, asked), asked.get("width")).key)

    async def _forget(self, request: Request) -> Response:
        self.store.forget()
        return JSONResponse({})

    def _curve(self, picture: str, space: SpaceName) -> Json:
        if space not in SPACES:
            raise UnfitRequestError("there is no such color space")
        curve = self.store.picture(picture).curve(space, wait=True)
        if curve is None:
            raise UnfitRequestError("the energy curve cannot be computed")
        psnr = None if curve.psnr is None else [round(float(value), 2) for value in curve.psnr if value < 1e3]
        floor = curve.scale.floor(curve.energies) or 1.0
        heights = [(float(energy) + floor) / (float(curve.energies[0]) + floor) for energy in curve.energies]
        return {"heights": heights, "elbow": int(curve.elbow()), "psnr": psnr}

    async def _file(self, request: Request) -> Response:
        outcome = self.store.result(request.path_params["result"])
        if outcome is None:
            return PlainTextResponse("this result is gone; change a setting to make it again", 404)
        output = request.path_params["output"]
        is_weighed = request.method == "HEAD" and re.match(r"o\.|\d", output) and fitting(outcome.image)
        try:
            named = await run_in_threadpool(outcome.file, output)
            quality = await run_in_threadpool(seen_quality, outcome.image, named[1]) if named and is_weighed else None
        except (OSError, ValueError, ImportError) as error:
            return PlainTextResponse(str(error), 422)
        except asyncio.CancelledError:
            return _ended()
        if named is None:
            return PlainTextResponse("there is no such file", 404)
        name, content = named
        sent = {"content-disposition": f"attachment; filename*=UTF-8''{quote(name, safe='')}"}
        if quality is not None:
            sent["x-quality"] = f"{quality:.0f}"
        return Response(content, media_type="application/octet-stream", headers=sent)

    async def _live(self, socket: WebSocket) -> None:
        self._n_pages += 1
        try:
            await Channel(socket, self.store).run()
        finally:
            self._n_pages -= 1
            self._last_used = time.monotonic()
            if not self._keep and not self._n_pages:
                self.store.forget()


def _understood(content: bytes) -> Json:
    """Return what a page asks for in JSON."""
    try:
        return dict(json.loads(content))
    except (ValueError, TypeError, RecursionError) as error:
        raise UnfitRequestError("this request is not understood") from error


def _sample() -> bytes:
    """Return a photograph in the public domain that comes with scikit-image."""
    from PIL import Image
    from skimage.data import astronaut

    stream = BytesIO()
    photograph = astronaut()  # type: ignore[no-untyped-call]
    Image.fromarray(photograph).save(stream, "PNG")
    return stream.getvalue()


async def _answered(make: Callable[[], Json]) -> Response:
    """Return what a function makes as JSON, or the reason why it cannot."""
    try:
        made = await run_in_threadpool(make)
    except UnfitRequestError as error:
        return PlainTextResponse(str(error), 422)
    except asyncio.CancelledError:
        return _ended()
    return Response(json.dumps(made, allow_nan=False), media_type="application/json")


def _ended() -> Response:
    """Return the answer of a server that ends, and waits no longer for what is computed."""
    return PlainTextResponse("the server ends", 503)
