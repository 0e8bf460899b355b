"""``cvtimg explore`` as a program: the address that it prints, whom it serves, and how it ends."""

import http.client
import re
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest
from commands import SAMPLES, Run

pytest.importorskip("starlette")


@pytest.fixture
def program() -> Iterator[subprocess.Popen[str]]:
    words = [sys.executable, "-P", "-m", "cvtimg", "explore", "--no-browser", str(SAMPLES / "drawing.png")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as started:
        yield started
        started.kill()


@pytest.mark.slow
def test_the_address_is_printed_on_one_line_and_lets_in(program: subprocess.Popen[str]) -> None:
    assert program.stdout is not None
    line = program.stdout.readline()
    found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)(/enter\?token=[\w-]{32,})\n", line)
    assert found, line
    connection = http.client.HTTPConnection("127.0.0.1", int(found[1]), timeout=20)
    connection.request("GET", found[2])
    entered = connection.getresponse()
    entered.read()
    session = entered.headers["location"].partition("#session=")[2]
    connection.request("GET", "/about", headers={"x-cvtimg-session": session})
    assert b"drawing.png" in connection.getresponse().read()
    connection.close()
    program.send_signal(signal.SIGINT)
    _, errors = program.communicate(timeout=20)
    assert (program.returncode, errors) == (130, "")


def test_a_server_that_nobody_uses_ends(capsys: pytest.CaptureFixture[str]) -> None:
    from cvtimg.explore import serve

    serve(browser=False, idle_minutes=0.001)
    assert capsys.readouterr().out.startswith("http://127.0.0.1:")


def test_a_port_that_is_taken_is_named(run: Run) -> None:
    import socket

    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        outcome = run("explore", "--no-browser", "--port", port)
    assert outcome == (1, "", f"cvtimg: port {port}: address already in use\n")
