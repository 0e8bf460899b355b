"""Who may talk to the server: pages that came from it, on this machine, with its token.

Any page in the browser can send requests to 127.0.0.1, and any name can be made to point there. So a request needs the
cookie that the address with the token gives, the server's own name as its host, and, where the browser says where it
comes from, the server's own pages as its origin.
"""

from __future__ import annotations

import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, NamedTuple, TypeAlias

__all__ = ["Credentials", "Guard"]

Scope: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send: TypeAlias = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App: TypeAlias = Callable[[Scope, Receive, Send], Awaitable[None]]

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

    def __init__(self, app: App, own: Credentials) -> None:
        self._app, self._own = app, own
        sockets = " ".join(f"ws://{host}" for host in own.hosts)
        policy = (
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
            f"connect-src 'self' {sockets}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        headers = {
            "content-security-policy": policy,
            "x-content-type-options": "nosniff",
            "referrer-policy": "no-referrer",
            "cross-origin-resource-policy": "same-origin",
            "cross-origin-opener-policy": "same-origin",
            "cache-control": "no-store",
        }
        self._headers = [(name.encode(), value.encode()) for name, value in headers.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Credentials a request on, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def send_guarded(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *self._headers]
            await send(message)

        refused = self._refused(scope)
        if refused is None:
            await self._app(scope, receive, send_guarded)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": _REFUSED})
        else:
            status, why = refused
            plain = [(b"content-type", b"text/plain; charset=utf-8")]
            await send_guarded({"type": "http.response.start", "status": status, "headers": plain})
            await send_guarded({"type": "http.response.body", "body": why.encode()})

    def _refused(self, scope: Scope) -> tuple[int, str] | None:
        """Return status and reason if the request is refused."""
        names = [name.lower() for name, _ in scope["headers"]]
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        if headers.get("host") not in self._own.hosts or names.count(b"host") > 1:
            return 421, "this server has another name"
        origins = {f"http://{host}" for host in self._own.hosts}
        if "origin" in headers and headers["origin"] not in origins:
            return 403, "the request comes from another page"
        if scope["type"] == "websocket" and "origin" not in headers:
            return 403, "the request comes from no page"
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return 403, "the request comes from another site"
        if scope["path"] == ENTRANCE and scope["type"] == "http":
            return None
        if not self._own.fits(_cookie(headers.get("cookie", ""), self._own.cookie)):
            return 403, "open the address that cvtimg explore printed"
        return None


def _cookie(header: str, name: str) -> str:
    # Servers on other ports share the cookies, whose values may be anything; the module http.cookies stops at those.
    pairs = (part.strip().partition("=") for part in header.split(";"))
    return next((value for key, _, value in pairs if key == name), "")
