"""Draw the figures of docs/explore.md: the page in headless Chromium.

    python docs/draw_explore.py

Needs Playwright and Chromium (CHROMIUM names another).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import figures
from PIL import Image
from playwright.sync_api import Browser, sync_playwright

DOCS = Path(__file__).parent
SAMPLES = DOCS.parent / "sample_images"
sys.path.insert(0, str(DOCS.parent / "tests"))

import visits  # noqa: E402
from visits import Visit  # noqa: E402

visits.PATIENCE = 600.0  # figures are also drawn on busy machines

#: A photograph, and a drawing, which is more likely to be meshed.
IMAGES = ("coffee.png", "drawing.png")
#: The tabs of the figure, and controls that are set before.
CHOICES: dict[str, dict[str, str]] = {
    "palette": {},
    "segments": {"way": "hierarchy"},
    "mosaic": {"shape": "triangles"},
    "sphere": {},
    "design": {},
    "mesh": {},
}


def shot(browser: Browser, address: str, tab: str, *, scheme: str, size: tuple[int, int]) -> Image.Image:
    """Draw a tab."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme)
    one = Visit(page)
    page.goto(address)
    one.until("document.body.dataset.ready === 'true'")
    one.page.select_option("#pictures", label=IMAGES[tab == "mesh"])
    one.until("document.body.dataset.ready === 'true'")
    one.choose(tab, **CHOICES.get(tab, {}))
    one.settled()
    page.wait_for_timeout(1000)
    picture = Image.open(BytesIO(page.screenshot())).convert("RGB")
    page.close()
    return picture


def tiles(pictures: list[Image.Image], across: int, scale: float, gap: int = 12) -> Image.Image:
    """Lay out pictures of one size in rows."""
    width, height = (round(scale * length) for length in pictures[0].size)
    n_rows = -(-len(pictures) // across)
    sheet = Image.new("RGB", (across * (width + gap) - gap, n_rows * (height + gap) - gap), "white")
    for number, picture in enumerate(pictures):
        place = (number % across * (width + gap), number // across * (height + gap))
        sheet.paste(picture.resize((width, height), Image.Resampling.LANCZOS), place)
    return sheet


def main() -> None:
    """Draw the figures with a server of their own."""
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    words = [sys.executable, "-m", "cvtimg", "explore", "--no-browser", *IMAGES]
    with subprocess.Popen(words, cwd=SAMPLES, stdout=subprocess.PIPE, text=True) as program:
        try:
            assert program.stdout is not None
            address = program.stdout.readline().strip()
            with sync_playwright() as play:
                browser = play.chromium.launch(
                    executable_path=chromium, args=["--no-sandbox", "--disable-dev-shm-usage"]
                )
                drawn = draw(browser, address)
        finally:
            program.terminate()
    for name, figure in drawn.items():
        figures.write(name, figure)


def draw(browser: Browser, address: str) -> dict[str, Image.Image]:
    """Draw the figures, by name."""
    wide, middle, narrow = (1280, 800), (900, 640), (390, 844)
    first = shot(browser, address, "colors", scheme="light", size=wide)
    schemes = ["dark", "light", "light", "dark", "dark", "light"]
    others = [
        shot(browser, address, tab, scheme=scheme, size=middle) for tab, scheme in zip(CHOICES, schemes, strict=True)
    ]
    small = [
        shot(browser, address, tab, scheme=scheme, size=narrow)
        for tab, scheme in (("colors", "light"), ("segments", "dark"), ("stipple", "light"), ("mesh", "dark"))
    ]
    return {"explore": first, "explore_tabs": tiles(others, 2, 0.9), "explore_narrow": tiles(small, 4, 0.7)}


if __name__ == "__main__":
    main()
