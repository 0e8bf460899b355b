"""A page in the browser, and what it saves, for the tests of the page and its benchmark."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, Self

#: Seconds that anything on the page may take; machines that run tests are busy.
PATIENCE = 60.0


@contextmanager
def served(folder: Path, *names: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Start a server in a folder, with pictures to open, and return its address and its process."""
    words = [sys.executable, "-P", "-m", "cvtimg", "explore", "--no-browser", *names]
    environment = {**os.environ, "XDG_CONFIG_HOME": str(folder / "config")}
    with subprocess.Popen(words, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        yield program.stdout.readline().strip(), program
        program.terminate()


class Visit:
    """A page in the browser, and what went wrong on it."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.said: list[str] = []
        self.requested: list[str] = []
        page.set_default_timeout(PATIENCE * 1000)
        page.on("console", lambda message: self.said.append(message.text))
        page.on("pageerror", lambda error: self.said.append(str(error)))
        page.on("request", lambda request: self.requested.append(request.url))
        page.on("websocket", lambda socket: self.requested.append(socket.url))

    def until(self, expression: str) -> Any:
        """Wait until an expression of JavaScript is true; policies of the page forbid Playwright's own way."""
        end = time.monotonic() + PATIENCE
        while not (value := self.page.evaluate(expression)):
            assert time.monotonic() < end, f"{expression}; {self.page.inner_text('#problem')}; {self.said}"
            time.sleep(0.02)
        return value

    def result(self) -> None:
        """Wait for an exact result."""
        self.until("document.getElementById('download').ariaDisabled === 'false'")

    def settled(self) -> None:
        """Wait until nothing is under way: there is a result, and the size of its file."""
        self.result()
        self.until("!/working|reading/.test(document.getElementById('facts').textContent)")

    def command(self) -> str:
        """Return the command that is shown once nothing is under way."""
        self.settled()
        return str(self.page.inner_text("#command"))

    def at(self, address: str) -> Self:
        """Open the page."""
        self.page.goto(address)
        self.until("document.body.dataset.ready === 'true'")
        return self

    def place(self, right: float, down: float) -> tuple[float, float]:
        """Return where on the page a place of the stage is, in shares of its width and height."""
        box = self.page.locator("#stage").bounding_box()
        return box["x"] + right * box["width"], box["y"] + down * box["height"]

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag the mouse from one place to another."""
        self.page.mouse.move(*start)
        self.page.mouse.down()
        self.page.mouse.move(*end, steps=8)
        self.page.mouse.up()

    def choose(self, tab: str, **values: str) -> None:
        """Go to a tab and choose values of controls."""
        self.page.click(f"#tab-{tab}")
        for name, value in values.items():
            self.page.select_option(f"#c-{name}", value)


def without_history(content: bytes) -> Any:
    """Return the variables of a netCDF file, whose history names the command; any other file as it is."""
    from scipy.io import netcdf_file

    if not content.startswith(b"CDF"):
        return content
    with netcdf_file(BytesIO(content)) as file:
        return {name: variable[...].tobytes() for name, variable in file.variables.items()}
