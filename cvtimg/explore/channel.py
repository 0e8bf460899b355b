"""The WebSocket of a page: requests for drafts, results and the picture itself, the newest of each.

A person who drags a slider sends more requests than there is time to answer. In each lane one request is under way, and
of those that come meanwhile only the newest waits. Drafts overtake results; a new draft ends the search for a result.
"""

from __future__ import annotations

import asyncio
import json
import logging
from contextlib import suppress
from typing import Any, NoReturn

from starlette.concurrency import run_in_threadpool
from starlette.websockets import WebSocket, WebSocketDisconnect

from cvtimg._shared.messages import one_line
from cvtimg.explore.controls import UnfitRequestError, parse_settings
from cvtimg.explore.layers import Window, packed
from cvtimg.explore.outcomes import Outcome
from cvtimg.explore.store import Store
from cvtimg.explore.tabs import TABS
from cvtimg.explore.tabs.base import Request

__all__ = ["Channel"]

#: Pixels that are sent at most of a result.
EXACT_PIXELS = 1 << 23
_LONGEST = 1 << 16


class OvertakenError(Exception):
    """A newer request makes this one pointless."""


class Channel:
    """The requests of a page."""

    def __init__(self, socket: WebSocket, store: Store) -> None:
        self._socket, self._store = socket, store
        self._waiting: dict[str, dict[str, Any]] = {}
        self._woken = {lane: asyncio.Event() for lane in ("draft", "exact", "before")}
        self._newest = 0
        self._last: tuple[Any, str, Outcome] | None = None
        self._weighing: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Answer requests until the page goes."""
        await self._socket.accept()
        jobs = [asyncio.create_task(self._work(lane)) for lane in self._woken]
        try:
            with suppress(WebSocketDisconnect):
                while True:
                    await self._take(await self._socket.receive_text())
        finally:
            self._newest = -1
            for job in (*jobs, *self._weighing):
                job.cancel()

    async def _take(self, text: str) -> None:
        try:
            request = json.loads(text) if len(text) <= _LONGEST else None
        except (ValueError, RecursionError):
            request = None
        asked: dict[str, Any] = request if isinstance(request, dict) else {}
        number, lane = asked.get("seq"), asked.get("lane")
        if not isinstance(number, int) or not 0 <= number < 1 << 31 or lane not in ("draft", "exact", "before"):
            await self._refuse(0, "", "this request is not understood")
            return
        if lane != "before":
            self._newest = number
        self._waiting[lane] = asked
        self._woken[lane].set()

    async def _work(self, lane: str) -> None:
        while True:
            await self._woken[lane].wait()
            self._woken[lane].clear()
            request = self._waiting.pop(lane)
            try:
                await self._answer(lane, request)
            except OvertakenError:
                await self._refuse(request["seq"], lane, "")
            except UnfitRequestError as error:
                await self._refuse(request["seq"], lane, str(error))
            except MemoryError:
                await self._refuse(request["seq"], lane, "needs more memory than there is")
            except (ValueError, TypeError, OSError, ImportError) as error:
                await self._refuse(request["seq"], lane, one_line(error))
            except (WebSocketDisconnect, RuntimeError):
                return  # the page is gone
            except Exception as error:  # a page goes on whatever happens
                logging.getLogger(__name__).exception("request failed")
                await self._refuse(request["seq"], lane, f"{type(error).__name__}: {one_line(error)}")

    async def _refuse(self, number: int, lane: str, why: str) -> None:
        await self._socket.send_text(json.dumps({"seq": number, "lane": lane, "error": why}))

    async def _answer(self, lane: str, asked: dict[str, Any]) -> None:
        number = asked["seq"]
        picture = self._store.files.picture(str(asked.get("picture")))
        view = asked.get("view")
        if lane == "before":
            window = Window.of(view, picture.size, EXACT_PIXELS)
            about = {"lane": lane, "picture": picture.key}
            reply = await run_in_threadpool(lambda: packed(number, about, picture.seen(window), window, window))
            await self._socket.send_bytes(reply)
            return
        tab = TABS.get(str(asked.get("tab")))
        if tab is None:
            raise UnfitRequestError("there is no such tab")
        settings = parse_settings(tab.controls, asked.get("settings"))
        window = Window.of(view, picture.size, tab.draft_pixels(settings) if lane == "draft" else EXACT_PIXELS)

        def watch(step: int, energy: float) -> bool:
            if self._newest != number:
                _overtaken()
            return False

        request = Request(picture, settings, self._store.files, window, watch)

        def answered() -> tuple[bytes, Outcome | None, str]:
            key, outcome = "", None
            recipe = tab.recipe(request)
            outputs = tab.outputs(request)
            recipes = [{**recipe.shown(one, picture.stem), "key": one.key, "label": one.label} for one in outputs]
            about: dict[str, Any] = {"lane": lane, "recipes": recipes}
            if lane == "draft":
                outcome = tab.draft(request)
            elif self._last and self._last[0] == (tab.name, picture.key, settings):
                key, outcome = self._last[1:]
            else:
                outcome = tab.exact(request)
                key = self._store.keep_result(outcome)
                self._last = ((tab.name, picture.key, settings), key, outcome)
            if outcome is None:
                return b"", None, json.dumps({"seq": number, "none": True, **about})
            about |= {"facts": outcome.facts, "result": key}
            return packed(number, about, outcome.layer, window, outcome.drawn), outcome, key

        reply, outcome, key = await run_in_threadpool(answered)
        if outcome is None:
            await self._socket.send_text(key)
            return
        await self._socket.send_bytes(reply)
        if lane == "exact":  # the picture first; the size of its file after, for which no other request waits
            job = asyncio.create_task(self._weigh(number, outcome))
            self._weighing.add(job)
            job.add_done_callback(self._weighing.discard)

    async def _weigh(self, number: int, outcome: Outcome) -> None:
        """Tell the size of the main file of a result."""
        with suppress(WebSocketDisconnect, RuntimeError, ValueError, OSError, MemoryError):  # downloads tell why
            named = await run_in_threadpool(outcome.file, outcome.outputs[0].key)
            if named is not None:
                await self._socket.send_text(json.dumps({"seq": number, "lane": "exact", "bytes": len(named[1])}))


def _overtaken() -> NoReturn:
    raise OvertakenError
