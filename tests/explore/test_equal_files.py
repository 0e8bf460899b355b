"""The file of the page, the command that it shows, and the lines of Python: the same bytes, for each option."""

import shlex
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from numpy.typing import NDArray
from PIL import Image
from visits import without_history

from cvtimg.cli.app import main
from cvtimg.explore import TABS
from cvtimg.explore.channel import _recipes
from cvtimg.explore.controls import (
    Brushed,
    Choice,
    Colors,
    Control,
    Edits,
    Files,
    Number,
    Swatches,
    Switch,
    Table,
    parse_settings,
)
from cvtimg.explore.layers import Window
from cvtimg.explore.opened import Picture
from cvtimg.explore.pasted import settings_of
from cvtimg.explore.store import Store
from cvtimg.explore.tabs.base import Request

#: What makes the results of a tab quick, and small.
BASE: dict[str, dict[str, Any]] = {
    "colors": {},
    "segments": {},
    "palette": {"k": 5, "colors": ["#102030", "#f0e0d0", "#a05030"]},
    "stipple": {"n_dots": 300, "pen": 6.0},
    "mosaic": {"n_cells": 60},
    "restore": {},
    "mesh": {"n": 60, "k": 2, "least": 40},
    "design": {"n": 12},
    "sphere": {"n": 42, "cell_width": 3000},
}
#: The tabs that the quick suite tries, and those that take long for pictures of all kinds.
QUICK, SLOW = {"colors", "palette"}, ("segments", "restore")
#: Values to try of numbers, where twice the default does not do.
VALUES: dict[tuple[str, str], Any] = {
    ("colors", "psnr"): 27.5,
    ("colors", "max_bytes"): 3,
    ("colors", "strength"): 0.35,
    ("stipple", "pen"): 9.0,
    ("segments", "k"): "auto",
    ("segments", "regions"): 5,
    ("segments", "cells"): 30,
    ("segments", "threshold"): 0.3,
    ("segments", "edge_weight"): "auto",
    ("segments", "min_size"): 25,
    ("stipple", "n_dots"): 450,
    ("stipple", "max_ink"): 0.6,
    ("stipple", "white_cutoff"): 0.2,
    ("stipple", "pen_width"): 0.4,
    ("mosaic", "n_cells"): 90,
    ("mosaic", "outline"): 0.5,
    ("restore", "k"): 5,
    ("restore", "nodata"): 255.0,
    ("restore", "edge_weight"): 3.5,
    ("mesh", "least"): 80,
    ("mesh", "n"): 80,
    ("mesh", "min_size"): 2.0,
    ("sphere", "cell_width"): 2000,
    ("sphere", "n"): 60,
    ("sphere", "circles"): [[-20.5, 29, 30, 3], [100, -60, 20, 2]],
    ("sphere", "circles_km"): [[-20.5, 29, 2500, 900]],
    ("design", "axes"): [["heat", "20, 90"], ["rounds", "1, 4, integer"]],
}


def variants(control: Control, tab: str) -> list[Any]:
    """Return values of a control that are not its default."""
    if isinstance(control, Choice):
        return [value for value in control.choices if value != control.default]
    if isinstance(control, Switch):
        return [not control.default]
    if isinstance(control, Number):
        other = control.default if control.default == "auto" else 2 * control.default
        return [VALUES.get((tab, control.name), other if other == "auto" or other <= control.high else control.low)]
    if isinstance(control, Brushed):
        return [["erase 12 20,20 50,30", "add 5 30,25"]]
    if isinstance(control, Edits):
        return [["merge 3,3 40,30 60,40", "split 20,50", "paint 4.5 10,10 30,30", "add 6 50,8 70,20", "erase 5 5,5"]]
    if isinstance(control, Colors):
        return [["#00ff7f", "#102030"]]
    if isinstance(control, Swatches):
        return [["#00ff7f", "#102030", "#00ff7f"]]
    if isinstance(control, Table):
        return [VALUES[tab, control.name]]
    return []


def needed(control: Control, controls: dict[str, Control]) -> dict[str, Any]:
    """Return settings under which a control is in effect."""
    found: dict[str, Any] = {}
    for name, values in control.when.items():
        found |= {**needed(controls[name], controls), name: values[0]}
    return found


def go_together(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Whether settings do not contradict."""
    return all(one.get(name, value) == value for name, value in other.items())


def cases() -> Iterator[Any]:
    """Yield settings that together hold each value of each option of a tab, as few as may be."""
    for tab in TABS.values():
        controls = {control.name: control for control in tab.controls}
        packed: list[dict[str, Any]] = []
        for control in tab.controls:
            for value in variants(control, tab.name):
                if value in ("palette", "picture"):  # have tests of their own
                    continue
                settings = {**needed(control, controls), control.name: value}
                pack = next((pack for pack in packed if go_together(pack, settings)), None)
                if pack is None:
                    packed.append(settings)
                else:
                    pack |= settings
        for number, pack in enumerate(packed):
            marks = [pytest.mark.slow] if number or tab.name not in QUICK else []
            yield pytest.param(tab.name, pack, id=f"{tab.name}-{number}", marks=marks)


@pytest.fixture(scope="session")
def scene() -> NDArray[np.uint8]:
    """Return a small picture with shapes, shades and some noise."""
    y, x = np.mgrid[:72, :96]
    disk = (x - 40) ** 2 + (y - 34) ** 2 < 500
    bands = np.stack([70 + x, 190 - 2 * y + 40 * disk, 60 + 120 * disk], axis=2)
    noise = np.random.default_rng(3).normal(0, 5, bands.shape)
    return np.clip(bands + noise, 0, 255).astype(np.uint8)


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Store]:
    monkeypatch.chdir(tmp_path)
    made = Store()
    yield made
    made.close()


def opened(store: Store, pixels: NDArray[Any], name: str = "my scene.png", **options: Any) -> Picture:
    Image.fromarray(pixels).save(name, **options)
    return store.picture(store.key_of(Path(name)))


def request_for(store: Store, tab: str, picture: Picture, settings: dict[str, Any]) -> Request:
    checked = parse_settings(TABS[tab].controls, {**BASE[tab], **settings})
    window = Window.of(None, picture.size, 1 << 20)
    return Request(None if TABS[tab].sheet else picture, checked, store, window)


def check_equal(
    store: Store, tab: str, picture: Picture, settings: dict[str, Any], n_outputs: int | None = None
) -> None:
    """Compare the files of the page with those of the commands and of the lines of Python."""
    request = request_for(store, tab, picture, settings)
    stem = request.stem
    recipe, outcome = TABS[tab].recipe(request), TABS[tab].exact(request)
    for output in outcome.outputs:
        if output.read:  # the page gives what the command reads
            name, content = outcome.file(output.key) or ("", b"")
            Path(name).write_bytes(content)
    for output in [one for one in outcome.outputs if not one.read][:n_outputs]:
        shown, named = recipe.shown(output, stem), outcome.file(output.key)
        assert named is not None
        name, content = named
        assert shown["file"] == name
        assert content
        for line in shown["command"].splitlines():
            words = shlex.split(line)
            assert main([*words[1:], "--overwrite", "--quiet"]) == 0, line
        assert without_history(Path(name).read_bytes()) == without_history(content), shown["command"]
        Path(name).unlink()
        exec(shown["python"], {})
        assert without_history(Path(name).read_bytes()) == without_history(content), shown["python"]
        for left in {name, f"{picture.stem}-labels.png"}:
            Path(left).unlink(missing_ok=True)


@pytest.mark.filterwarnings("ignore:align=")  # of one version
@pytest.mark.parametrize(("tab", "settings"), [*cases()])
def test_each_option_gives_the_same_file(tab: str, settings: dict[str, Any], store: Store, scene: NDArray[Any]) -> None:
    check_equal(store, tab, opened(store, scene), settings, 1)


@pytest.mark.parametrize(("tab", "settings"), [pytest.param(*case.values, id=case.id) for case in cases()])
def test_a_command_that_is_shown_and_pasted_is_shown_again(tab: str, settings: Any, store: Store, scene: Any) -> None:
    drawn = {control.name for control in TABS[tab].controls if isinstance(control, Brushed)}
    settings = {name: value for name, value in settings.items() if name not in drawn}
    request = request_for(store, tab, opened(store, scene), settings)
    shown = TABS[tab].recipe(request)
    pasted = settings_of(f"{shown.before}\n$ {shlex.join(shown.words)}".replace("--space ", "--space="))
    again = TABS[pasted["tab"]]
    request = replace(request, settings=parse_settings(again.controls, pasted["settings"]))
    assert (again.recipe(request).words, pasted["left"]) == (shown.words, [])


@pytest.mark.parametrize("tab", [pytest.param(tab, marks=[] if tab in QUICK else [pytest.mark.slow]) for tab in TABS])
def test_each_kind_of_file_is_the_same(tab: str, store: Store, scene: NDArray[Any]) -> None:
    check_equal(store, tab, opened(store, scene), {})


@pytest.mark.slow
def test_drawings_of_objects_are_the_same(store: Store, scene: NDArray[Any]) -> None:
    check_equal(store, "segments", opened(store, scene), {"k": 2, "pieces": "objects"})


@pytest.mark.parametrize("dither", ["none", "floyd-steinberg"])
def test_a_given_palette_gives_the_same_file(dither: str, store: Store, scene: NDArray[Any]) -> None:
    content = b"102030\nff0080\n40c0a0\nf0f0e0\n"
    Path("my colors.hex").write_bytes(content)
    palette = store.open_palette("my colors.hex", content)["id"]
    check_equal(store, "colors", opened(store, scene), {"aim": "palette", "palette": [palette], "dither": dither}, 2)


ANIMATED: list[tuple[str, dict[str, Any]]] = [
    ("colors", {"k": 8}),
    ("colors", {"k": 8, "per_frame": True, "dither": "bayer", "locked": ["#00ff7f"]}),
    ("colors", {"aim": "psnr", "psnr": 25.0}),
    ("colors", {"aim": "palette", "palette": ["nes"]}),
    ("segments", {"regions": 4}),
    ("restore", {}),
]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:images")  # that show something else
@pytest.mark.parametrize("axes", ["", "QYXS", "ZYXS"])
@pytest.mark.parametrize(("tab", "settings"), ANIMATED)
def test_frames_and_pages_give_the_same_file(
    axes: str, tab: str, settings: dict[str, Any], store: Store, scene: NDArray[Any]
) -> None:
    images = [np.roll(scene, 9 * shift, axis=1) for shift in range(3)]
    if axes:
        kind = {"imagej": True, "metadata": {"axes": axes}} if axes == "ZYXS" else {"photometric": "rgb"}
        tifffile.imwrite("walk.tif", np.stack(images), **kind)
    else:
        frames = list(map(Image.fromarray, images))
        frames[0].save("walk.png", save_all=True, append_images=frames[1:], duration=80)
    frame = store.picture(store.key_of(Path("walk.tif" if axes else "walk.png"))).frame(1)
    assert (frame.array == np.roll(scene, 9, axis=1)).all()
    request = replace(request_for(store, tab, frame, settings), is_whole=TABS[tab].for_frames)
    shown, outcome = _recipes(TABS[tab], request), TABS[tab].exact(request)
    for one in (shown[0], shown[-1]):
        _, content = outcome.file(one["key"]) or ("", b"")
        for line in one["command"].splitlines():
            assert main([*shlex.split(line)[1:], "--overwrite", "--quiet"]) == 0, line
        assert Path(one["file"]).read_bytes() == content
        Path(one["file"]).unlink()
        exec(one["python"], {})
        assert Path(one["file"]).read_bytes() == content


@pytest.mark.slow
def test_a_mask_gives_the_same_mesh(store: Store) -> None:
    y, x = np.mgrid[:60, :80]
    mask = np.uint8(255) * ((x - 40) ** 2 + (y - 30) ** 2 < 600).astype(np.uint8)
    check_equal(store, "mesh", opened(store, mask, "mask.png"), {"of": "picture"}, 1)
    labels = (1 + (x > 40)).astype(np.uint8)
    check_equal(store, "mesh", opened(store, labels, "labels.png"), {"of": "picture"}, 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [{"align": True, "motion": "euclidean", "hidden": "background"}, {"way": "flat"}, {"way": "detail"}],
    ids=str,
)
def test_several_versions_give_the_same_file(settings: dict[str, Any], store: Store, scene: NDArray[Any]) -> None:
    rng = np.random.default_rng(0)
    versions = []
    for number in range(3):
        noisy = np.clip(scene + rng.normal(0, 9, scene.shape), 0, 255).astype(np.uint8)
        versions.append(opened(store, noisy, f"scan {number}.png").key)
    picture = store.picture(versions[0])
    check_equal(store, "restore", picture, {"versions": versions, **settings})


@pytest.mark.parametrize("kind", ["gray", "rgba", "transparent", "indexed", "16-bit", "-dash", "jpeg", "um"])
@pytest.mark.parametrize("tab", ["colors", *(pytest.param(tab, marks=pytest.mark.slow) for tab in SLOW)])
def test_pictures_of_all_kinds_give_the_same_file(kind: str, tab: str, store: Store, scene: NDArray[Any]) -> None:
    name = {"-dash": "-a.png", "jpeg": "a.jpg", "um": "a.tif"}.get(kind, "a.png")
    if kind == "um":
        tifffile.imwrite(name, scene[..., 0], imagej=True, resolution=(4, 4), metadata={"unit": "um"})
    elif kind == "indexed":
        Image.fromarray(scene).quantize(12, dither=Image.Dither.NONE).save(name)
    else:
        alpha = np.full((*scene.shape[:2], 1), 255, np.uint8)
        alpha[5:30, 5:30] = 0 if kind == "transparent" else 255
        plain = {"gray": scene[..., 1], "16-bit": scene[..., 0].astype(np.uint16) * 257 + 3}
        pixels = {**plain, "-dash": scene, "jpeg": scene}.get(kind, np.dstack([scene, alpha]))
        Image.fromarray(pixels).save(name)
    picture = store.picture(store.key_of(Path(name)))
    check_equal(store, tab, picture, {}, None if kind == "um" else 1)
    if tab == "colors":
        check_equal(store, tab, picture, {"k": 5, "locked": ["#ff0000"]}, 1)


def test_samples_that_png_cannot_hold_are_saved_as_numpy_arrays(store: Store, scene: NDArray[Any]) -> None:
    np.save("field.npy", scene.astype(np.float32) / 255)
    check_equal(store, "colors", store.picture(store.key_of(Path("field.npy"))), {"k": 5}, 1)


def test_a_value_that_means_missing_is_left_out(store: Store, scene: NDArray[Any]) -> None:
    pixels = scene[..., 0].copy()
    pixels[:20, :30] = 0
    tifffile.imwrite("map.tif", pixels, extratags=[(42113, "s", 0, "0", True)])
    picture = store.picture(store.key_of(Path("map.tif")))
    assert picture.known is not None
    for tab in ("colors", "segments"):
        check_equal(store, tab, picture, {}, 1)


def test_every_control_has_an_effect_on_the_command_or_shows_another() -> None:
    for tab in TABS.values():
        names = {name for control in tab.controls for name in control.when}
        for control in tab.controls:
            silent = not (control.flag or control.keyword) and control.name not in names
            assert not silent or isinstance(control, Files) or control.name in SAID_BY_TABS[tab.name].split()


#: Controls whose value a tab says in its own words.
SAID_BY_TABS = {"colors": "k strength", "stipple": "least greatest pen_width", "mesh": "k least"} | {
    "palette": "colors",
    "mosaic": "palette",
}
