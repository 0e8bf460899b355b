"""The WebSocket of a page: requests for drafts, results and the picture itself, the newest of each.

A person who drags a slider sends more requests than there is time to answer. In each lane one request is under way, and
of those that come meanwhile only the newest waits. Drafts overtake results; a new draft ends the search for a result,
and so does a person who has waited long enough.
"""

import asyncio
import json
import logging
import math
import secrets
import time
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import replace
from threading import Thread
from typing import Any, Generic, TypeVar

from starlette.concurrency import run_in_threadpool
from starlette.websockets import WebSocket, WebSocketDisconnect

from cvtimg._shared.budgets import PIXELS_AT_ONCE, ROWS_AT_ONCE
from cvtimg._shared.choices import Json
from cvtimg._shared.messages import one_line
from cvtimg._shared.progress import watched
from cvtimg.explore.controls import UnfitRequestError, understood
from cvtimg.explore.layers import Window, packed
from cvtimg.explore.outcomes import Outcome, fitting
from cvtimg.explore.store import Store
from cvtimg.explore.tabs import TABS, frame_of, opened, requested
from cvtimg.explore.tabs.base import Request, Tab

#: Seconds between messages of how far a search is.
_PATIENCE = 0.2
T = TypeVar("T")


class OvertakenError(Exception):
    """A newer request makes this one pointless, or nobody waits for it any longer."""


class Work(Generic[T]):
    """A function in a thread of its own, which ends when it next tells how far it is if nobody waits any longer."""

    def __init__(self, function: Callable[[], T]) -> None:
        self.share, self._work = 0.0, Future[T]()  # how much of it is done; it has an outcome once it is not wanted
        self.result = asyncio.wrap_future(self._work)
        Thread(target=self._run, args=(function,), daemon=True).start()

    def end(self) -> None:
        with suppress(InvalidStateError):
            self._work.set_exception(OvertakenError())

    def _run(self, function: Callable[[], T]) -> None:
        with suppress(InvalidStateError):  # nobody waits any longer
            try:
                with watched(self._done):
                    value = function()
            except Exception as error:
                self._work.set_exception(error)
            else:
                self._work.set_result(value)

    def _done(self, share: float) -> None:
        self.share = share
        if self._work.done():
            raise OvertakenError


class Channel:
    """The requests of a page."""

    def __init__(self, socket: WebSocket, store: Store) -> None:
        self._socket, self._store = socket, store
        self._waiting: dict[str, Json] = {}
        self._woken = {lane: asyncio.Event() for lane in ("draft", "exact", "before")}
        self._paces: dict[str, float] = {}  # seconds that a unit of work took, by tab
        self._search: Work[Any] | None = None
        self._last: tuple[Any, str, Outcome] | None = None

    async def run(self) -> None:
        await self._socket.accept("cvtimg")
        jobs = [asyncio.create_task(self._work(lane)) for lane in self._woken]
        try:
            with suppress(WebSocketDisconnect):
                while True:
                    await self._take(await self._socket.receive_text())
        finally:
            self._end_search()
            for job in jobs:
                job.cancel()

    def _end_search(self) -> None:
        self._waiting.pop("exact", None)
        if self._search is not None:
            self._search.end()

    async def _take(self, text: str) -> None:
        asked: Json = {}
        with suppress(UnfitRequestError):
            asked = understood(text)
        number, lane = asked.get("seq"), asked.get("lane")
        if not isinstance(number, int) or not 0 <= number < 1 << 31 or lane not in ("cancel", *self._woken):
            await self._refuse(0, "", "this request is not understood")
            return
        if lane != "before":
            self._end_search()
        if lane == "cancel":
            return
        self._waiting[lane] = asked
        self._woken[lane].set()

    async def _work(self, lane: str) -> None:
        while True:
            await self._woken[lane].wait()
            self._woken[lane].clear()
            request = self._waiting.pop(lane, None)
            if request is None:  # it is no longer wanted
                continue
            try:
                await self._answer(lane, request)
            except (WebSocketDisconnect, RuntimeError):
                return  # the page is gone
            except Exception as error:  # a page goes on whatever happens
                tab = TABS.get(str(request.get("tab")))
                await self._refuse(request["seq"], lane, tab.worded(_said(error)) if tab else _said(error))

    async def _refuse(self, number: int, lane: str, why: str) -> None:
        await self._socket.send_text(json.dumps({"seq": number, "lane": lane, "error": why}))

    async def _answer(self, lane: str, asked: Json) -> None:
        number = asked["seq"]
        if lane == "before":
            picture = opened(self._store, asked)
            window = Window.of(asked.get("view"), picture.size, PIXELS_AT_ONCE)
            about = {"lane": lane, "picture": asked.get("picture")}
            seen = await run_in_threadpool(lambda: packed(number, about, picture.seen(window), window, window))
            await self._socket.send_bytes(seen)
            return
        tab, request = requested(self._store, asked, is_draft=lane == "draft")
        same = (tab.name, request.opened and request.source.key, request.settings)
        last = self._last if self._last and self._last[0] == same else None
        if lane == "exact" and not last:
            self._last = self._store.newest = None  # two results of a large picture take much memory

        def answered() -> tuple[bytes | str, str, Outcome | None]:
            about: Json = {"lane": lane, "recipes": _recipes(tab, request)}
            key, outcome, begun = secrets.token_hex(8), None, time.monotonic()
            if last and (lane == "exact" or last[2].frames):
                _, key, outcome = last
            elif lane == "draft":
                key, outcome = "", tab.draft(request)
            else:
                outcome = tab.exact(request)
                if request.opened and math.prod(request.size) > ROWS_AT_ONCE:  # a small one does not tell of large ones
                    self._paces[tab.name] = (time.monotonic() - begun) / tab.work(request, outcome)
            about["seconds"] = self._paces.get(tab.name, tab.pace) * tab.work(request, outcome)
            if outcome is None:
                return json.dumps({"seq": number, "none": True, **about}), "", None
            layer, facts = outcome.frames[frame_of(asked)] if outcome.frames else (outcome.layer, outcome.facts)
            about |= {"facts": facts, "result": key, "lossy": fitting(outcome.image)}
            return packed(number, about, layer, request.window, outcome.drawn), key, outcome

        work = Work(answered)
        if lane == "exact":
            self._search = work
            await self._tell_shares(number, work)
        reply, key, outcome = await work.result
        if lane == "exact" and outcome:  # here, as a search that is overtaken may end after the newer one
            self._last = (same, key, outcome)
            self._store.results[key] = self._store.newest = outcome
        await (self._socket.send_text(reply) if isinstance(reply, str) else self._socket.send_bytes(reply))

    async def _tell_shares(self, number: int, work: Work[Any]) -> None:
        told = 0.0
        while not (await asyncio.wait([work.result], timeout=_PATIENCE))[0]:
            if work.share > told:
                told = work.share
                await self._socket.send_text(json.dumps({"seq": number, "lane": "exact", "share": round(told, 3)}))


def _said(error: Exception) -> str:
    """Say why a request is not answered; nothing of one that is not wanted any longer."""
    if isinstance(error, (OvertakenError, UnfitRequestError)):
        return str(error)
    if isinstance(error, (ValueError, TypeError, OSError, ImportError, MemoryError)):
        return one_line(error)
    logging.getLogger(__name__).error("request failed", exc_info=error)
    return f"{type(error).__name__}: {one_line(error)}"


def _recipes(tab: Tab, request: Request) -> list[dict[str, str]]:
    """Return what the page shows for each file of a result."""
    recipe, outputs = tab.recipe(request), tab.outputs(request)
    if before := request.opened and request.store.lines.get(request.opened.key):
        recipe = replace(recipe, made=before)
    return [
        {**recipe.shown(outputs[0] if output.read else output, request.stem), "key": output.key, "label": output.label}
        | ({"file": output.pattern.format(request.stem)} if output.read else {})
        for output in outputs
    ]
