"""Serve the page until nobody uses it any more."""

import asyncio
import logging
import os
import secrets
import socket
import tempfile
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path

from cvtimg._shared.choices import Json
from cvtimg._shared.messages import one_line
from cvtimg.batch.runner import Ending
from cvtimg.explore.guard import Credentials
from cvtimg.explore.outcomes import own_prefix


def serve(
    paths: Sequence[Path] = (),
    *,
    port: int = 0,
    browser: bool = True,
    keep: bool = True,
    idle_minutes: float = 15.0,
    say: Callable[[str], None] = print,
) -> None:
    """Serve the page on this machine, 127.0.0.1, until it is interrupted or nobody uses it any more.

    Parameters
    ----------
    paths : sequence of Path
        Images to open.
    port : int
        Port of the server; 0 takes a free one. OSError is raised if it is taken.
    browser : bool
        Open the page in the browser.
    keep : bool
        Whether the browser keeps settings while its page is open, so that a reload finds them again.
    idle_minutes : float
        Minutes without an open page after which the server ends.
    say : callable
        Told the address, which contains the token that lets a page in.
    """
    import uvicorn

    from cvtimg.explore.app import Server

    listener = _bound(port)
    credentials = Credentials(listener.getsockname()[1], secrets.token_urlsafe(24))
    server = Server(credentials, paths, keep)

    async def end_when_idle(running: uvicorn.Server) -> None:
        while (left := 60 * idle_minutes - server.idle_seconds) > 0:
            await asyncio.sleep(max(left, 0.05))
        running.should_exit = True

    # Ctrl-C while something is computed is no error.
    logging.getLogger("uvicorn.error").addFilter(lambda record: "graceful shutdown" not in record.getMessage())

    async def run() -> None:
        sockets: Json = {"ws": "websockets-sansio", "ws_per_message_deflate": False, "ws_max_size": 1 << 20}
        quiet: Json = {"log_level": "error", "lifespan": "off", "server_header": False}
        running = uvicorn.Server(uvicorn.Config(server.app, **sockets, **quiet, timeout_graceful_shutdown=1))
        watch = asyncio.create_task(end_when_idle(running))
        say(credentials.entrance())
        with _door(credentials) if browser else nullcontext():
            await running.serve(sockets=[listener])
        watch.cancel()

    try:
        with Ending():
            asyncio.run(run())
    except KeyboardInterrupt as interrupt:  # what follows cleans up, also for SIGTERM, and SIGHUP of a closed terminal
        raise SystemExit(128 + interrupt.args[0]) from None
    finally:
        listener.close()
        server.store.close()


@contextmanager
def _door(credentials: Credentials) -> Iterator[None]:
    """Open the browser through a file that only this user can read: all users see the arguments of programs.

    It lies in the home folder under a name without a dot, since confined browsers read no other files.
    """
    home = Path.home()
    number, name = tempfile.mkstemp(".html", own_prefix(), home if os.access(home, os.W_OK) else None)
    os.close(number)
    door, address = Path(name), credentials.entrance(once=True)
    try:
        refresh = f'<meta http-equiv="refresh" content="0;url={address}">'
        door.write_text(f'<!doctype html>{refresh}<a href="{address}">Open</a>\n')
        webbrowser.open(door.as_uri())
        yield
    finally:
        door.unlink(missing_ok=True)


def _bound(port: int) -> socket.socket:
    """Return a socket bound on this machine alone."""
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(("127.0.0.1", port))
        listener.listen()  # who reads the address may come at once
    except OSError as error:
        listener.close()
        raise OSError(f"port {port}: {one_line(error)}") from error
    return listener
