"""A server and a real browser for the tests of the page."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from visits import Visit, served

#: Where Debian and others have Chromium; CHROMIUM names another.
NAMES = ("chromium", "chromium-browser", "google-chrome")
SAMPLES = Path(__file__).parent.parent.parent / "sample_images"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """Start Chromium, or skip the test where there is none."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    found = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip("no Chromium: the page is not tested in a browser")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=["--no-sandbox", "--disable-dev-shm-usage"])
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with pictures, in which the server runs."""
    made = tmp_path_factory.mktemp("pictures")
    with Image.open(SAMPLES / "astronaut.png") as photograph:
        photograph.convert("RGB").crop((40, 0, 200, 120)).save(made / "photo.png")
        noise = np.random.default_rng(7).normal(0, 12, (512, 512, 3))
        large = np.clip(np.asarray(photograph.convert("RGB").resize((512, 512))) + noise, 0, 255)
        Image.fromarray(large.astype(np.uint8)).save(made / "large.png")
    scene = Image.open(made / "photo.png")
    for number in range(3):
        noise = np.random.default_rng(number).normal(0, 12, (120, 160, 3))
        Image.fromarray(np.clip(np.asarray(scene) + noise, 0, 255).astype(np.uint8)).save(made / f"scan_{number}.png")
    y, x = np.mgrid[:120, :160]
    Image.fromarray(np.uint8(255) * ((x - 80) ** 2 + (y - 60) ** 2 < 2500).astype(np.uint8)).save(made / "mask.png")
    (made / "two.hex").write_text("102030\nf0e0d0\n")
    (made / "hostile.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    (made / "empty.png").write_bytes(b"")
    return made


@pytest.fixture(scope="session")
def address(folder: Path) -> Iterator[str]:
    """Start the server, with one picture, and return its address."""
    with served(folder, "photo.png") as (address, _):
        yield address


@pytest.fixture
def visit(chromium: Any, address: str) -> Iterator[Callable[..., Visit]]:
    """Return a function that opens the page; afterwards nothing must have gone wrong on it."""
    with ExitStack() as stack:
        visits = []

        def go(width: int = 1280, height: int = 800, scheme: str = "light", **options: Any) -> Visit:
            viewport = {"width": width, "height": height}
            context = chromium.new_context(
                viewport=viewport, color_scheme=scheme, permissions=["clipboard-read", "clipboard-write"], **options
            )
            stack.callback(context.close)
            made = Visit(context.new_page())
            visits.append(made)
            return made.at(address)

        yield go
        own = (address.partition("/enter")[0], "ws" + address.partition("/enter")[0][4:], "blob:http://127.0.0.1")
        for one in visits:
            assert one.said == []
            assert [url for url in one.requested if not url.startswith(own)] == []
