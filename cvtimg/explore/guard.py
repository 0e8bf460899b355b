"""Who may talk to the server: pages that came from it, on this machine, with its token.

Any page in the browser can send requests to 127.0.0.1, any name can be made to point there, and other users of the
machine can connect to it. So a request needs the session that the entrance gives for a token, the server's own name as
its host, and, where the browser says where it comes from, the server's own pages as its origin. The session is no
cookie, since browsers send cookies to all ports of a machine. Only files of the page, which are no secret, go to all.
"""

import secrets
from asyncio import CancelledError
from collections.abc import Collection

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

#: Takes a token and gives the session.
ENTRANCE = "/enter"
#: The header that carries the session.
SESSION = "x-cvtimg-session"


class Credentials:
    """What lets a page in: the port of the server, tokens for its entrance, and the session that they give."""

    def __init__(self, port: int, token: str) -> None:
        self.port = port
        self.session = secrets.token_urlsafe(24)
        self._token = token  # is printed, and opens any number of pages
        self._once: set[str] = set()

    @property
    def hosts(self) -> tuple[str, str]:
        return f"127.0.0.1:{self.port}", f"localhost:{self.port}"

    def entrance(self, once: bool = False) -> str:
        """Return an address that lets a page in, once or any number of times."""
        token = self._token
        if once:
            self._once.add(token := secrets.token_urlsafe(24))
        return f"http://{self.hosts[0]}{ENTRANCE}?token={token}"

    def admit(self, token: str) -> bool:
        """Whether a token lets in; one that does so once is used up."""
        known = [expected for expected in (self._token, *self._once) if _same(expected, token)]
        self._once.difference_update(known)
        return bool(known)

    def knows(self, request: HTTPConnection) -> bool:
        """Whether a request has the session: in a header, or a socket as the second of its protocols."""
        given = request.headers.get(SESSION, "")
        if request.scope["type"] == "websocket":
            given = (request.scope.get("subprotocols") or [""])[-1]
        return _same(self.session, given)


def _same(expected: str, given: str) -> bool:
    """Whether two texts are equal, compared in constant time."""
    return secrets.compare_digest(expected.encode(), given.encode())


class Guard:
    """Middleware that refuses what does not come from a page of the server, and says what its pages may do."""

    def __init__(self, app: ASGIApp, credentials: Credentials, free: Collection[str]) -> None:
        self._app, self._own = app, credentials
        self._free = {ENTRANCE, *free}  # paths that need no session
        sockets = " ".join(f"ws://{host}" for host in credentials.hosts)
        content = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:"
        policy = f"{content}; connect-src 'self' {sockets}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        self._headers = {
            "content-security-policy": policy,
            "x-content-type-options": "nosniff",
            "referrer-policy": "no-referrer",
            "cross-origin-resource-policy": "same-origin",
            "cross-origin-opener-policy": "same-origin",
            "cache-control": "no-store",
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
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
            app = WebSocketClose(4403) if scope["type"] == "websocket" else PlainTextResponse(why, status)
        try:
            await app(scope, receive, send_guarded)
        except CancelledError:  # the server ends, and waits no longer for what is computed
            if scope["type"] == "http":
                await PlainTextResponse("the server ends", 503)(scope, receive, send_guarded)

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
        is_free = request.scope["path"] in self._free and not is_socket
        # A person may come from anywhere, for example from the file that opened the browser; a script may not.
        is_visit = is_free and headers.get("sec-fetch-mode") == "navigate"
        if not is_visit and headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return 403, "the request comes from another site"
        if not is_free and not self._own.knows(request):
            return 403, "open the address that cvtimg explore printed"
        return None
