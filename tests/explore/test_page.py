"""The page in a real browser."""

import shlex
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from PIL import Image
from visits import PATIENCE, Visit, served, without_history

from cvtimg.explore import TABS

pytestmark = pytest.mark.slow
Go = Callable[..., Visit]


@pytest.fixture
def one(visit: Go) -> Visit:
    """Open the page, and wait for its first result."""
    opened = visit()
    opened.settled()
    return opened


@pytest.fixture
def page(one: Visit) -> Any:
    """Return what drives the page."""
    return one.page


@pytest.mark.parametrize("tab", TABS)
def test_the_shown_command_writes_the_bytes_that_are_downloaded(
    tab: str, one: Visit, folder: Path, tmp_path: Path
) -> None:
    one.choose(tab)
    one.settled()
    with one.page.expect_download() as download:
        one.page.click("#download")
    content = Path(download.value.path()).read_bytes()
    words = [shlex.split(line) for line in one.page.inner_text("#command").splitlines()]
    assert download.value.suggested_filename == words[-1][-1]
    (tmp_path / "photo.png").write_bytes((folder / "photo.png").read_bytes())
    for line in words:
        subprocess.run([sys.executable, "-m", *line], cwd=tmp_path, check=True, capture_output=True)
    assert without_history((tmp_path / words[-1][-1]).read_bytes()) == without_history(content)


def test_a_reply_that_comes_too_late_or_after_a_cancel_is_dropped(one: Visit) -> None:
    shown = one.page.evaluate(
        """async () => {
            const {Link} = await import("/link.js");
            const got = [], link = new Link(reply => got.push(reply.seq), () => {});
            await link.ready ?? new Promise(done => setTimeout(done, 500));
            const request = lane => ({lane, request: {}});
            for (let seq = 1; seq <= 9; seq++) link.sent.set(seq, request(seq % 2 ? "draft" : "exact"));
            link.newest = 6;
            for (const seq of [3, 1, 4, 6, 5]) link.take(JSON.stringify({seq}));
            link.take(JSON.stringify({seq: 9, error: "too many"}));
            link.seq = 10;
            link.cancel();
            link.take(JSON.stringify({seq: 8}));
            return got;
        }"""
    )
    assert shown == [3, 6]  # the draft 1 is older than 3, the result 4 than what is wanted, the draft 5 than 6


def test_a_number_that_is_not_allowed_is_refused_and_the_one_in_effect_comes_back(one: Visit, page: Any) -> None:
    typed = page.locator("#controls input[type=number]").first
    for text in ("40", "", "40.5"):
        typed.fill(text)
        typed.press("Enter")
        one.until("document.querySelector('#controls input[type=number]').value === '40'")
        assert "-k 40" in one.command()
    one.until("document.getElementById('problem').textContent.includes('40.5 must be a whole number')")


def test_what_is_typed_and_chosen_before_the_picture_is_read_stays(one: Visit, address: str) -> None:
    page, held = one.page, []
    page.route("**/given/0", lambda route: held.append(route))
    for tab, field in (("colors", "k"), ("segments", "regions"), ("stipple", "n_dots"), ("mesh", "n")):
        page.evaluate("sessionStorage.removeItem('page')")
        page.goto(address)
        page.click(f"#tab-{tab}")
        typed = page.locator(f"#c-{field} ~ input[type=number]")
        typed.press_sequentially("7")
        while not held:
            page.wait_for_timeout(20)
        held.pop().continue_()
        one.result()
        typed.press_sequentially("3")
        typed.press("Enter")
        one.until("/ -[kn] \\d*73 /.test(document.getElementById('command').textContent)")
        assert page.get_attribute(f"#tab-{tab}", "aria-selected") == "true"


def test_a_small_picture_begins_with_as_many_tiles_as_fit(one: Visit, page: Any, tmp_path: Path, folder: Path) -> None:
    with Image.open(folder / "photo.png") as photograph:
        photograph.resize((16, 16)).save(tmp_path / "icon.png")
    page.set_input_files("#open", tmp_path / "icon.png")
    one.choose("mosaic")
    assert "-n 16 " in one.command()
    page.select_option("#pictures", label="photo.png")
    assert "-n 1000 " in one.command() or "-n" not in page.inner_text("#command")


def test_an_animation_plays_and_a_command_that_is_pasted_sets_its_tab(one: Visit, page: Any, tmp_path: Path) -> None:
    frames = [Image.new("RGB", (40, 30), color) for color in ("red", "green", "blue")]
    frames[0].save(tmp_path / "film.gif", save_all=True, append_images=frames[1:], duration=40)
    page.set_input_files("#open", tmp_path / "film.gif")
    one.settled()
    page.click("#play")
    one.until("document.querySelector('#framename').textContent.startsWith('3')")
    page.click("#play")
    page.evaluate(
        """text => {
            const data = new DataTransfer();
            data.setData("text", text);
            dispatchEvent(new ClipboardEvent("paste", {clipboardData: data}));
        }""",
        "cvtimg mosaic film.gif -n 7 --shape triangles -o film.svg",
    )
    one.until("document.querySelector('#tab-mosaic').ariaSelected === 'true'")
    assert "-n 7 --shape triangles" in one.command()


def test_all_images_are_seen_small_and_get_the_settings_of_the_tab_in_one_archive(
    one: Visit, page: Any, folder: Path
) -> None:
    page.set_input_files("#open", [folder / "scan_0.png", folder / "scan_1.png"])
    one.settled()
    page.click("#showall")
    small = "one => one.naturalWidth && one.naturalHeight <= 96"
    one.until(f"[...document.querySelectorAll('#thumbnails img')].filter({small}).length === 3")
    with page.expect_download() as download:
        page.click("#applyall")
    with zipfile.ZipFile(download.value.path()) as archive:
        names = {"photo-quantized.png", "scan_0-quantized.png", "scan_1-quantized.png"}
        assert set(archive.namelist()) == names
    assert page.inner_text("#allstate") == "3 of 3 made"


def test_a_link_in_a_tab_of_its_own_is_let_in_by_an_open_page(one: Visit) -> None:
    with one.page.context.expect_page() as opened:
        one.page.evaluate("open(location.origin)")
    new = opened.value
    new.wait_for_selector("body[data-ready=true]", timeout=PATIENCE * 1000)
    assert new.locator("#tabs button").count() == len(TABS)


def test_the_number_of_colors_the_divider_and_the_palette_answer_to_keys(one: Visit, page: Any) -> None:
    page.focus("#c-k")
    for _ in range(3):
        page.keyboard.press("ArrowLeft")
    assert "-k 13" in one.command()
    page.focus("#divider")
    for key in ("ArrowRight", "ArrowRight", "PageUp"):
        page.keyboard.press(key)
    assert page.get_attribute("#divider", "aria-valuenow") == "64"
    page.locator("#swatches button").first.focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    second = page.locator("#swatches button").nth(1)
    assert second.get_attribute("aria-pressed") == "true"
    color = page.inner_text("#shadename").partition(",")[0]
    second.focus()
    page.keyboard.press("c")
    one.until(f"navigator.clipboard.readText().then(text => text === '{color}')")
    page.keyboard.press("l")
    assert f"--lock '{color}'" in one.command()
    page.keyboard.press("Control+z")
    assert "--lock" not in one.command()
    assert "-k 13" in page.inner_text("#command")
    page.keyboard.press("Control+z")
    assert "-k 16" in one.command()
    page.keyboard.press("Control+Shift+Z")
    assert "-k 13" in one.command()


def test_the_energy_curve_answers_to_keys_and_to_the_mouse(one: Visit, page: Any) -> None:
    one.until("document.querySelector('#curve .marker')")
    page.focus("#curve .marker")
    page.keyboard.press("ArrowRight")
    assert "-k 17" in one.command()
    page.focus("#curve .marker")
    page.keyboard.press("Enter")
    one.settled()
    elbow = page.text_content("#curve .elbowname").split()[1]
    assert f"-k {elbow} " in page.inner_text("#command")
    page.locator("#curve").scroll_into_view_if_needed()
    box = page.locator("#curve").bounding_box()
    one.drag((box["x"] + box["width"] * 0.5, box["y"] + 40), (box["x"] + box["width"] * 0.955, box["y"] + 40))
    assert "-k 64" in one.command()


def test_a_color_is_locked_in_the_picture_by_click_and_by_keys(one: Visit, page: Any, folder: Path) -> None:
    page.click("#pick")
    page.keyboard.press("Enter")  # the middle of the picture
    one.settled()
    with Image.open(folder / "photo.png") as image:
        middle = {image.getpixel((x, y)) for x in (79, 80) for y in (59, 60)}
    locked = page.inner_text("#command").partition("--lock '")[2][:7]
    assert tuple(bytes.fromhex(locked[1:])) in middle
    page.mouse.click(*one.place(0.25, 0.5))
    assert one.command().count("--lock") == 2


@pytest.mark.parametrize("tab", TABS)
def test_every_control_can_be_reached(tab: str, one: Visit) -> None:
    one.choose(tab)
    one.settled()
    ids = one.page.evaluate("[...document.querySelectorAll('[id]')].map(item => item.id)")
    assert len(set(ids)) == len(ids)
    one.page.focus("#open")
    visited: set[str] = set()
    for _ in range(120):
        one.page.keyboard.press("Tab")
        name = "document.activeElement.id || document.activeElement.ariaLabel || document.activeElement.textContent"
        visited.add(one.page.evaluate(name).strip())
    names = one.page.evaluate(
        "[...document.querySelectorAll('#controls [id^=c-]')].filter(i => !i.disabled).map(i => i.id)"
    )
    always = {"stage", "download", *([] if TABS[tab].sheet else ["divider"])}
    assert {*(name for name in names if not name.endswith("-note")), *always} <= visited


needs_axe = pytest.mark.skipif(find_spec("axe_playwright_python") is None, reason="axe-core is not installed")


def check_access(one: Visit, state: str) -> None:
    """Check what axe-core finds, and that nothing is cut off."""
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(one.page)
    assert found.violations_count == 0, (state, found.generate_report())
    assert one.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), state


@needs_axe
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1920, 1366, 400])
def test_all_tabs_are_accessible_also_while_and_after_they_fail(
    scheme: str, width: int, visit: Go, folder: Path
) -> None:
    one = visit(width=width, scheme=scheme)
    one.page.set_input_files("#open", str(folder / "hostile.png"))
    for tab in TABS:
        one.choose(tab)
        one.settled()
        check_access(one, tab)
    one.choose("colors", aim="palette")
    one.until("document.getElementById('problem').textContent")
    check_access(one, "no palette")
    one.page.set_input_files("#open", str(folder / "large.png"))  # so that it has not ended while it is looked at
    one.until("document.getElementById('pictures').options.length === 2")
    one.choose("restore", way="detail", effort="best")
    one.until("!document.getElementById('share').hidden")
    check_access(one, "working")
    one.page.click("#cancel")
    check_access(one, "canceled")
    one.page.evaluate("document.getElementById('keys').showModal()")
    check_access(one, "keys")
    one.said.clear()  # of the file


@needs_axe
def test_a_page_without_images_and_one_without_a_server_are_accessible(chromium: Any, tmp_path: Path) -> None:
    with served(tmp_path) as (address, server):
        one = Visit(chromium.new_page()).at(address)
        check_access(one, "empty")
        server.kill()
        one.until("document.getElementById('problem').textContent.includes('ended')")
        check_access(one, "lost")
        one.page.close()


def test_a_reload_finds_images_settings_and_steps_back(one: Visit, folder: Path) -> None:
    one.page.set_input_files("#open", str(folder / "scan_0.png"))
    one.until("document.getElementById('pictures').options.length === 2")
    one.page.select_option("#c-dither", "blue-noise")
    one.settled()
    one.page.reload()
    one.until("document.body.dataset.ready === 'true'")
    one.settled()
    assert one.page.evaluate("document.getElementById('pictures').selectedOptions[0].textContent") == "scan_0.png"
    assert "--dither blue-noise" in one.page.inner_text("#command")
    one.page.click("#undo")
    assert "blue-noise" not in one.command()


def test_a_page_without_a_server_says_so_and_counts_no_seconds(chromium: Any, folder: Path) -> None:
    with served(folder, "photo.png") as (address, program):
        one = Visit(chromium.new_page()).at(address)
        one.settled()
        program.terminate()
    one.until("document.getElementById('problem').textContent.includes('ended')")
    one.page.select_option("#c-dither", "blue-noise")
    one.page.click("#tab-segments")
    time.sleep(0.8)
    assert "working" not in one.page.inner_text("#facts")
    assert "ended" in one.page.inner_text("#problem")
    one.page.close()


def test_where_nothing_is_open_a_sample_can_be_tried(chromium: Any, tmp_path: Path) -> None:
    with served(tmp_path) as (address, _):
        one = Visit(chromium.new_page()).at(address)
        one.page.click("#sample")
        one.settled()
        assert one.page.inner_text("#facts").startswith("512 ")
        one.page.close()


def test_pictures_and_palettes_are_dropped_and_pasted(one: Visit, folder: Path) -> None:
    transfer = """([kind, target, name, bytes]) => {
        const data = new DataTransfer();
        data.items.add(new File([new Uint8Array(bytes)], name, {type: name.endsWith("png") ? "image/png" : ""}));
        const more = {bubbles: true, cancelable: true};
        const event = kind === "paste"
            ? new ClipboardEvent(kind, {...more, clipboardData: data})
            : new DragEvent(kind, {...more, dataTransfer: data});
        document.querySelector(target).dispatchEvent(event);
    }"""
    scan = list((folder / "scan_0.png").read_bytes())
    one.page.evaluate(transfer, ["drop", "#stage", "dropped.png", scan])
    one.until("document.getElementById('pictures').selectedOptions[0].text === 'dropped.png'")
    one.page.evaluate(transfer, ["paste", "body", "pasted.png", scan])
    one.until("document.getElementById('pictures').selectedOptions[0].text === 'pasted.png'")
    one.settled()
    one.page.evaluate(transfer, ["drop", "#panel", "two.hex", list((folder / "two.hex").read_bytes())])
    one.until("document.getElementById('command').textContent.includes('--palette two.hex')")
    one.settled()
    assert one.page.locator("#swatches button").count() == 2


def test_settings_come_back_from_a_link(one: Visit) -> None:
    one.page.select_option("#c-dither", "bayer")
    one.settled()
    one.page.click("#copylink")
    link = one.page.evaluate("navigator.clipboard.readText()")
    command = one.page.inner_text("#command")
    one.choose("stipple")
    one.page.goto(link)
    assert one.command() == command
    assert "#" not in one.page.url
    one.page.click("#undo")
    one.until("document.getElementById('tab-stipple').ariaSelected === 'true'")
    one.page.evaluate(
        'location.hash = \'settings=\' + encodeURIComponent(\'{"tab": "colors", "settings": {"dither": 7}}\')'
    )
    one.until("document.getElementById('troubles').textContent.includes('setting dither is not known')")


def test_several_versions_are_restored_together(one: Visit, folder: Path) -> None:
    one.page.set_input_files("#open", [str(folder / f"scan_{number}.png") for number in range(3)])
    one.until("document.getElementById('pictures').options.length === 4")
    one.choose("restore")
    command = one.command()
    assert all(f"scan_{number}.png" in command for number in range(3))
    one.page.uncheck("#controls .control:first-child input >> nth=0")
    assert "photo.png" not in one.command().partition(" -o ")[0]
    one.page.set_input_files("#open", str(folder / "large.png"))  # of another subject
    one.settled()
    one.until("document.getElementById('command').textContent.startsWith('cvtimg restore large.png')")


def test_a_and_b_are_compared_and_swapped(one: Visit, page: Any) -> None:
    page.click("#keep")
    page.fill("#c-k ~ input[type=number]", "4")
    page.keyboard.press("Tab")
    one.settled()
    assert page.input_value("#against") == "A"
    assert "16" in page.inner_text("#leftname")
    page.click("#swap")
    assert "-k 16 " in one.command()
    assert "4" in page.inner_text("#leftname")


def test_segments_are_outlined_and_listed(one: Visit) -> None:
    one.choose("segments", way="segments", pieces="components")
    one.settled()
    filled = one.page.screenshot()
    one.page.select_option("#fill", "lines")
    assert one.page.screenshot() != filled
    rows = one.page.locator("#rows tr").count() - 1
    assert rows == min(int(one.page.inner_text("#shadestitle").split()[1]), 200)
    one.page.locator("#rows button").first.click()
    assert "Segment" in one.page.inner_text("#shadename")


def test_views_zoom_and_pan_by_keys(one: Visit, page: Any) -> None:
    page.focus("#stage")
    page.keyboard.press("1")
    assert page.inner_text("#zoom") == "100 %"
    page.keyboard.press("+")
    assert page.inner_text("#zoom") == "200 %"
    place = "document.querySelector('#right .world').style.transform"
    before = page.evaluate(place)
    page.keyboard.press("ArrowLeft")
    assert page.evaluate(place) != before
    for mode in ("beside", "result", "divider"):
        page.keyboard.press("v")
        assert page.input_value("#mode") == mode
    page.keyboard.press("?")
    assert page.is_visible("#keys")
    page.keyboard.press("Escape")
    assert not page.is_visible("#keys")


def test_a_click_on_the_globe_makes_cells_finer_there_and_a_drag_moves_them(one: Visit) -> None:
    one.choose("sphere")
    one.settled()
    middle = one.place(0.5, 0.5)
    one.page.mouse.click(*middle)
    assert "--refine 10,35,20,4 " in one.command()  # where the globe begins
    one.drag(middle, (middle[0] + 60, middle[1] + 80))
    lon, lat, radius, ratio = map(float, one.command().split("--refine ")[1].split()[0].split(","))
    assert (radius, ratio) == (20, 4)
    assert 15 < lon < 30
    assert 10 < lat < 30
    one.page.mouse.click(middle[0] - 200, middle[1] - 100)
    assert one.command().count("--refine") == 2
    one.page.focus("#stage")
    for key in ("ArrowRight", "ArrowRight", "ArrowUp", "Enter"):
        one.page.keyboard.press(key)
    assert "--refine 20,40,20,4 " in one.command()
    one.page.click("#undo")
    assert one.command().count("--refine") == 2


def test_colors_of_a_palette_are_dragged_edited_locked_and_found_again(one: Visit, page: Any) -> None:
    one.choose("palette")
    one.settled()
    swatches = page.locator("#swatches button")
    listed = "[...document.querySelectorAll('#swatches button')].map(one => one.title.slice(0, 7))"
    before = page.evaluate(listed)
    first, fourth = swatches.nth(0).bounding_box(), swatches.nth(3).bounding_box()
    one.drag((first["x"] + 9, first["y"] + 9), (fourth["x"] + 9, fourth["y"] + 9))
    one.settled()
    moved = [*before[1:4], before[0], *before[4:]]
    assert page.evaluate(listed) == moved
    assert f"--palette '{','.join(moved)}'" in page.inner_text("#command")
    swatches.nth(1).click()
    page.fill("#editone", "#ff2080")
    one.settled()
    assert page.evaluate(listed) == [moved[0], "#ff2080", *moved[2:]]
    page.click("#lockone")
    page.click("#again")
    assert "cvtimg palette photo.png -k 8 --lock '#ff2080'" in one.command()
    assert "#ff2080" in page.evaluate(listed)
    page.click("#undo")
    page.click("#undo")
    page.click("#undo")
    one.settled()
    assert page.evaluate(listed) == moved
    swatches.nth(0).focus()
    page.keyboard.press("Alt+ArrowRight")
    one.settled()
    assert page.evaluate(listed) == [moved[1], moved[0], *moved[2:]]
    page.keyboard.press("Delete")
    one.settled()
    assert page.evaluate(listed) == [moved[1], *moved[2:]]


def test_segments_are_merged_split_and_painted_by_hand(one: Visit, page: Any) -> None:
    one.choose("segments")
    one.page.fill("#c-regions ~ input[type=number]", "6")
    one.page.keyboard.press("Enter")
    one.settled()
    count = "Number(document.getElementById('shadestitle').textContent.split(' ')[1])"
    assert page.evaluate(count) == 6
    page.click("text=Merge")
    one.drag(one.place(0.2, 0.2), one.place(0.8, 0.8))
    one.until(f"{count} < 6")
    merged = page.evaluate(count)
    page.click("text=Split")
    page.mouse.click(*one.place(0.2, 0.2))
    one.until(f"{count} === {merged + 1}")
    page.click("text=New")
    page.keyboard.press("ArrowDown")  # by keys: a dab in the middle
    page.keyboard.press("Enter")
    one.until(f"{count} === {merged + 2}")
    command = one.command()
    assert [word.split()[0] for word in command.split("--edit '")[1:]] == ["merge", "split", "add"]
    page.keyboard.press("Control+z")
    one.until(f"{count} === {merged + 1}")
    page.keyboard.press("Escape")
    assert page.input_value("#mode") == "divider"
    page.click("text=Clear")
    one.until(f"{count} === 6")


def test_masks_and_weights_are_drawn_by_brush(one: Visit, page: Any) -> None:
    page.check("#c-brushes")
    page.click("text=Leave out")
    one.drag(one.place(0.3, 0.4), one.place(0.6, 0.4))
    assert "--mask photo-mask.png" in one.command()
    page.click("#c-weights")
    one.drag(one.place(0.3, 0.7), one.place(0.6, 0.7))
    assert "--mask photo-mask.png --weight-map photo-weights.png" in one.command()
    page.uncheck("#c-brushes")
    assert "--mask" not in one.command()


def test_frames_are_scrubbed(one: Visit, page: Any, folder: Path) -> None:
    with Image.open(folder / "photo.png") as photo:
        frames = [photo.rotate(30 * turn) for turn in range(4)]
    frames[0].save(folder / "spin.png", save_all=True, append_images=frames[1:], duration=80)
    assert page.is_hidden("#film")
    page.set_input_files("#open", folder / "spin.png")
    one.until("document.getElementById('framename').textContent === '1 / 4'")
    one.settled()
    quality = "document.getElementById('facts').textContent.match(/[0-9.]+ dB/)?.[0]"
    first = page.evaluate(quality)
    page.focus("#frame")
    page.keyboard.press("End")
    one.until(f"{quality} && {quality} !== '{first}'")
    one.settled()
    assert page.inner_text("#filmname") == "Frame"
    assert page.inner_text("#framename") == "4 / 4"
    assert page.inner_text("#command") == "cvtimg quantize spin.png -k 16 -o spin-quantized.png"
    page.check("#c-per_frame")
    assert "--palette-per-frame" in one.command()
    one.choose("segments")
    assert "cvtimg segment spin.png --page 4" in one.command()
    page.select_option("#pictures", label="photo.png")
    one.settled()
    assert page.is_hidden("#film")


def test_channels_are_chosen_presets_come_back_and_sizes_stand_beside_each_other(one: Visit, tmp_path: Path) -> None:
    one.until("/PNG.*WEBP.*GIF.*JPG.*WEBP lossy/.test(document.getElementById('sizes').textContent)")
    one.page.click("#resize")
    one.until("document.getElementById('facts').textContent.startsWith('80 ')")
    assert "PIL.Image" in one.command()
    one.page.select_option("#pictures", label="photo.png")
    one.settled()
    one.page.select_option("#c-dither", "bayer")
    one.page.fill("#presetname", "dotted")
    one.page.click("#savepreset")
    one.until("[...document.getElementById('preset').options].some(option => option.value === 'dotted')")
    one.page.select_option("#c-dither", "none")
    one.settled()
    one.page.select_option("#preset", "dotted")
    assert "--dither bayer" in one.command()
    one.page.click("#droppreset")
    one.until("document.getElementById('preset').options.length === 1")
    values = np.random.default_rng(0).integers(0, 255, (3, 40, 60), dtype=np.uint8)
    tifffile.imwrite(
        tmp_path / "c.ome.tif", values, metadata={"axes": "CYX", "Channel": {"Name": ["DAPI", "GFP", "T"]}}
    )
    one.page.set_input_files("#open", tmp_path / "c.ome.tif")
    one.until("!document.getElementById('channels').hidden")
    one.page.select_option("#channel", label="GFP")
    assert "--channel 2" in one.command()
