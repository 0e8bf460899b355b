"""The page of `cvtimg explore` in headless Chromium: from the move of a control to the picture on the screen.

    python benchmarks/page.py [--quick] [--data DIR]

Each move is an input event on the slider; its time ends when the browser has painted. Server and browser share the
processors of this machine. Needs Playwright and Chromium (CHROMIUM names another).
"""

import os
import shlex
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from common import ROOT, large_pictures, machine, parser, print_table, progress, write_results
from PIL import Image
from playwright.sync_api import Browser, sync_playwright

sys.path.insert(0, str(ROOT / "tests"))
from visits import Visit

from cvtimg.explore.app import STATIC

#: Sizes of the pictures in pixels, by what they are called.
SIZES = {"0.4": (768, 512), "2": (1732, 1155), "12": (4096, 3000)}
#: Numbers of colors that a drag passes, up and down.
DRAG = (17, 24, 31, 9, 40, 12, 55, 20, 33, 64, 5, 28, 44, 7, 38, 21, 60, 14, 26, 50)
#: Milliseconds to reach: a drag (the 95th percentile; at 12 megapixels the median), and others.
GOALS = {
    "drag 0.4": 60,
    "drag 2": 80,
    "drag 12": 110,
    "storm": 100,
    "dithered drag": 110,
    "exact 2": 700,
    "start": 1000,
}
LISTEN = "window.seen = []; document.addEventListener('shown', event => window.seen.push(event.detail))"
#: One move after another, each once the picture of the one before is painted.
MOVES = """async ([name, numbers]) => {
    window.seen = [];
    const typed = document.querySelector("#c-k ~ input[type=number]"), slider = document.getElementById("c-k");
    for (const number of numbers) {
        const before = window.seen.length;
        slider.value = Math.round(1000 * Math.log(number / 2) / Math.log(128));
        slider.dispatchEvent(new Event("input", {bubbles: true}));
        const start = performance.now();
        while (!window.seen.slice(before).some(one => one.lane === "draft") && performance.now() - start < 20000) {
            await new Promise(done => setTimeout(done, 1));
        }
    }
    return window.seen.filter(one => one.lane === "draft").map(one => one.ms);
}"""
STORM = """async () => {
    window.seen = [];
    const slider = document.getElementById("c-k");
    for (let move = 0; move < 60; move++) {
        slider.value = 200 + 8 * move;
        slider.dispatchEvent(new Event("input", {bubbles: true}));
        await new Promise(done => requestAnimationFrame(done));
    }
    const last = performance.now(), wanted = Number(document.querySelector("#c-k ~ input[type=number]").value);
    while (!window.seen.some(one => one.settings.k === wanted)) await new Promise(done => setTimeout(done, 1));
    return performance.now() - last;
}"""
EXACT = """async () => {
    window.seen = [];
    const slider = document.getElementById("c-k");
    slider.value = 300 + Math.round(300 * Math.random());
    slider.dispatchEvent(new Event("input", {bubbles: true}));
    const last = performance.now();
    while (!window.seen.some(one => one.lane === "exact")) await new Promise(done => setTimeout(done, 1));
    return performance.now() - last;
}"""


def pictures(folder: Path, data: Path | None) -> dict[str, Path]:
    """Make a picture of each size from a large one."""
    with Image.open(large_pictures(data)[-1]) as large:
        found = {}
        for name, size in SIZES.items():
            found[name] = folder / f"photo-{name}.png"
            large.convert("RGB").resize(size, Image.Resampling.LANCZOS).save(found[name], compress_level=1)
    return found


def measure(browser: Browser, folder: Path, name: str, path: Path, repeats: int) -> dict[str, float | bool]:
    """Measure one picture, with a server of its own."""
    start = time.perf_counter()
    words = [sys.executable, "-m", "cvtimg", "explore", "--no-browser", path.name]
    with subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        address = program.stdout.readline().strip()
        row: dict[str, float | bool] = {"start": 1000 * (time.perf_counter() - start)}
        one = Visit(browser.new_page(viewport={"width": 1440, "height": 900}))
        one.page.goto(address)
        one.settled()
        row["opened"] = 1000 * (time.perf_counter() - start)
        one.until("document.querySelector('#curve .marker')")
        one.page.evaluate(LISTEN)
        drags = [ms for _ in range(repeats) for ms in one.page.evaluate(MOVES, ["k", DRAG])]
        row["drag median"], row["drag p95"] = statistics.median(drags), float(np.quantile(drags, 0.95))
        one.settled()
        row["storm"] = statistics.median(one.page.evaluate(STORM) for _ in range(repeats))
        one.settled()
        row["exact"] = statistics.median(_exact(one) for _ in range(repeats))
        one.page.select_option("#c-dither", "floyd-steinberg")
        one.settled()
        row["dithered drag"] = statistics.median(one.page.evaluate(MOVES, ["k", DRAG[:10]]))
        one.settled()
        row["equal"] = equal(one, folder)
        row["outside"] = len([url for url in one.requested if "127.0.0.1" not in url])
        one.page.close()
        program.terminate()
    return row


def _exact(one: Visit) -> float:
    one.settled()
    return float(one.page.evaluate(EXACT))


def equal(one: Visit, folder: Path) -> bool:
    """Whether the command that is shown writes the bytes that are downloaded."""
    with one.page.expect_download() as download:
        one.page.click("#download")
    words = shlex.split(one.page.inner_text("#command"))
    subprocess.run([sys.executable, "-m", *words], cwd=folder, check=True, capture_output=True)
    return (folder / words[-1]).read_bytes() == Path(download.value.path()).read_bytes()


def main() -> None:
    """Measure all sizes, and print what is reached."""
    given = parser(__doc__).parse_args()
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as made, sync_playwright() as playwright:
        folder = Path(made)
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for name, path in pictures(folder, given.data).items():
            progress(f"{name} megapixels")
            rows.append({"megapixels": name, **measure(browser, folder, name, path, 1 if given.quick else 3)})
        browser.close()
    columns = ("start", "opened", "drag median", "drag p95", "storm", "dithered drag", "exact")
    cells = [[row["megapixels"], *(f"{row[column]:.0f}" for column in columns), str(row["equal"])] for row in rows]
    print_table(f"Milliseconds; {machine()}", ["megapixels", *columns, "equal"], cells)
    n_bytes = sum(len(path.read_bytes()) for path in STATIC.iterdir())
    goals = ", ".join(f"{name} {goal}" for name, goal in GOALS.items())
    print(f"\nThe page has {n_bytes} bytes. Requests to other machines: {sum(row['outside'] for row in rows)}.")
    print(f"To reach, in milliseconds: {goals}.")
    write_results("page", {"machine": machine(), "goals": GOALS, "bytes": n_bytes}, rows)


if __name__ == "__main__":
    main()
