"""The server's addresses."""

import json
import mimetypes
import re
import time
import zipfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from cvtimg._shared.choices import Json, SpaceName
from cvtimg.explore.channel import Channel
from cvtimg.explore.controls import UnfitRequestError, understood
from cvtimg.explore.guard import ENTRANCE, Credentials, Guard
from cvtimg.explore.opened import most_pixels
from cvtimg.explore.outcomes import WANTED, fitting, seen_quality
from cvtimg.explore.pasted import change_presets, presets, settings_of
from cvtimg.explore.store import KNOWN, MOST_BYTES, Store
from cvtimg.explore.tabs import TABS, opened, requested
from cvtimg.pictures.formats.encoding import encode_image

#: The files of the page; no other file is ever sent.
STATIC = Path(__file__).parent / "static"
mimetypes.add_type("text/javascript", ".js")  # which Windows may call text


class Server:
    """The ASGI application `app`, what is open, and when it was last used."""

    def __init__(self, credentials: Credentials, paths: Sequence[Path] = (), keep: bool = True) -> None:
        self.store = Store()
        self._own, self._paths, self._keep = credentials, paths, keep
        self._n_pages, self._last_used = 0, time.monotonic()
        routes: list[Any] = [
            Route(ENTRANCE, self._enter),
            Route("/about", self._about),
            Route("/thumbnail/{key}", self._thumbnail),
            Route("/all.zip", self._all),
            Route("/file/{result}/{output}", self._file),
            WebSocketRoute("/live", self._live),
        ]
        store = self.store
        asked: dict[str, Callable[..., Json]] = {
            "/picture/{key}": lambda key: store.entry(key).about,
            "/distinct/{key}": lambda key: {"distinct": store.picture(key).samples.n_colors},
            "/given/{number:int}": self._given,
            "/curve/{picture}/{space}": self._curve,
        }
        sent: dict[str, Callable[[str, bytes], Json]] = {
            "/picture": store.open_sent,
            "/sample": lambda name, content: store.open_sent("sample.png", _sample()),
            "/palette": store.open_palette,
            "/forget": lambda name, content: store.forget(),
            "/command": lambda name, content: settings_of(content.decode(errors="replace")),
            "/all": lambda name, content: _add_result(store, understood(content)),
            "/presets": lambda name, content: self._presets(understood(content)),
            "/resize": lambda name, content: self._resized(understood(content)),
        }
        for address, make in asked.items():
            routes.append(Route(address, partial(self._answer, make), methods=["GET", "POST"]))
        routes += [Route(address, partial(self._take, use), methods=["POST"]) for address, use in sent.items()]
        routes.append(Mount("/", StaticFiles(directory=STATIC, html=True)))
        refused = {UnfitRequestError: lambda request, error: PlainTextResponse(str(error), 422)}
        app = Starlette(routes=routes, exception_handlers=refused)
        self.app = Guard(app, credentials, ["/", *(f"/{path.name}" for path in STATIC.iterdir())])

    @property
    def idle_seconds(self) -> float:
        """Seconds since the last page went; 0 while one is open."""
        return 0.0 if self._n_pages else time.monotonic() - self._last_used

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
        return _json(about)

    async def _thumbnail(self, request: Request) -> Response:
        return Response(self.store.entry(request.path_params["key"]).thumbnail, media_type="image/png")

    async def _all(self, request: Request) -> Response:
        return FileResponse(self.store.archive, media_type="application/zip")

    def _presets(self, asked: Json) -> Json:
        if not self._keep:
            raise UnfitRequestError("with --no-store nothing is kept, and settings are not saved by name")
        return change_presets(asked)

    async def _answer(self, make: Callable[..., Json], request: Request) -> Response:
        return _json(await run_in_threadpool(make, **request.path_params))

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
        return _json(await run_in_threadpool(use, request.query_params.get("name", "image"), bytes(content)))

    def _given(self, number: int) -> Json:
        if number >= len(self._paths):
            raise UnfitRequestError("there is no such image")
        return self.store.entry(self.store.key_of(self._paths[number])).about

    def _resized(self, asked: Json) -> Json:
        return self.store.resized(opened(self.store, asked), asked.get("width"))

    def _curve(self, picture: str, space: SpaceName) -> Json:
        curve = self.store.picture(picture).curve(space, wait=True)
        if curve is None:
            raise UnfitRequestError("the energy curve cannot be computed")
        psnr = None if curve.psnr is None else [round(float(value), 2) for value in curve.psnr if value < 1e3]
        floor = curve.scale.floor(curve.energies) or 1.0
        heights = [(float(energy) + floor) / (float(curve.energies[0]) + floor) for energy in curve.energies]
        return {"heights": heights, "elbow": int(curve.elbow()), "psnr": psnr}

    async def _file(self, request: Request) -> Response:
        outcome = self.store.results.get(request.path_params["result"])
        if outcome is None:  # whose size may be asked for just when another result begins
            said = "this result is gone; change a setting to make it again"
            return Response(status_code=204) if request.method == "HEAD" else PlainTextResponse(said, 404)
        output = request.path_params["output"]
        is_weighed = request.method == "HEAD" and re.match(r"o\.|\d", output) and fitting(outcome.image)
        try:
            named = await run_in_threadpool(outcome.file, output)
            quality = await run_in_threadpool(seen_quality, outcome.image, named[1]) if named and is_weighed else None
        except (OSError, ValueError, ImportError) as error:
            raise UnfitRequestError(str(error)) from error
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


def _sample() -> bytes:
    """Return a photograph in the public domain that comes with scikit-image."""
    from skimage.data import astronaut

    return encode_image(".png", astronaut())  # type: ignore[no-untyped-call]


def _json(answer: Json) -> Response:
    # In letters of ASCII: names of files need not be valid text.
    return Response(json.dumps(answer, allow_nan=False), media_type="application/json")


def _add_result(store: Store, asked: Json) -> Json:
    """Add the file ``output`` that the settings of a tab make of a picture to the archive, which the ``first`` empties.

    The archive lies on the disk, so that only one of them is in memory. Return the name of the file, and its size.
    """
    if asked.get("first"):
        store.archive.unlink(missing_ok=True)
    tab, request = requested(store, asked)
    picture = Path(request.picture.name).name
    try:
        file = tab.exact(request).file(str(asked.get("output")))
    except (ValueError, TypeError, OSError, ImportError, MemoryError) as error:
        raise UnfitRequestError(f"{picture}: {tab.worded(str(error))}") from error
    if file is None:
        raise UnfitRequestError(f"{picture}: there is no such file of this picture")
    name, content = file
    stem, dot, suffix = name.partition(".")
    with zipfile.ZipFile(store.archive, "a") as archive:  # files are compressed already
        number = 2
        while name in archive.namelist():  # pictures of two folders may have the same
            name, number = f"{stem}-{number}{dot}{suffix}", number + 1
        archive.writestr(name, content)
    return {"name": name, "bytes": len(content)}
