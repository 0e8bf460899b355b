"""Who may talk to the server: pages that came from it, on this machine, with its token.

Any page in the browser can send requests to 127.0.0.1, and any name can be made to point there. So a request needs the
cookie that the address with the token gives, the server's own name as its host, and, where the browser says where it
comes from, the server's own pages as its origin.
"""

from __future__ import annotations

import secrets
from typing import NamedTuple

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

__all__ = ["Credentials", "Guard"]

#: The only address that is open to all: it takes the token and gives the cookie.
ENTRANCE = "/enter"
_REFUSED = 4403  # code of a closed WebSocket


class Credentials(NamedTuple):
    """What lets a page in: the port of the server and the token."""

    port: int
    token: str

    @property
    def cookie(self) -> str:
        """Name of the cookie; servers on other ports have others."""
        return f"cvtimg_{self.port}"

    @property
    def hosts(self) -> tuple[str, str]:
        """Names that the server has."""
        return f"127.0.0.1:{self.port}", f"localhost:{self.port}"

    def fits(self, token: str) -> bool:
        """Whether a token is the right one, compared in constant time."""
        return secrets.compare_digest(token.encode(), self.token.encode())


class Guard:
    """Middleware that refuses what does not come from a page of the server, and says what its pages may do."""

    def __init__(self, app: ASGIApp, own: Credentials) -> None:
        self._app, self._own = app, own
        sockets = " ".join(f"ws://{host}" for host in own.hosts)
        policy = (
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
            f"connect-src 'self' {sockets}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        self._headers = {
            "content-security-policy": policy,
            "x-content-type-options": "nosniff",
            "referrer-policy": "no-referrer",
            "cross-origin-resource-policy": "same-origin",
            "cross-origin-opener-policy": "same-origin",
            "cache-control": "no-store",
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(self._headers)
            await send(message)

        app = self._app
        if refused := self._refused(HTTPConnection(scope)):
            status, why = refused
            app = WebSocketClose(_REFUSED) if scope["type"] == "websocket" else PlainTextResponse(why, status)
        await app(scope, receive, send_guarded)

    def _refused(self, request: HTTPConnection) -> tuple[int, str] | None:
        """Return status and reason if the request is refused."""
        headers, is_socket = request.headers, request.scope["type"] == "websocket"
        # Starlette's TrustedHostMiddleware would let other ports and a second name pass.
        if len(names := headers.getlist("host")) != 1 or names[0] not in self._own.hosts:
            return 421, "this server has another name"
        origins = {f"http://{host}" for host in self._own.hosts}
        if "origin" in headers and headers["origin"] not in origins:
            return 403, "the request comes from another page"
        if is_socket and "origin" not in headers:
            return 403, "the request comes from no page"
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return 403, "the request comes from another site"
        if request.scope["path"] == ENTRANCE and not is_socket:
            return None
        if not self._own.fits(request.cookies.get(self._own.cookie, "")):
            return 403, "open the address that cvtimg explore printed"
        return None
