"""Each widget makes a layer that lies where its image lies, plane by plane."""

from __future__ import annotations

import importlib
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
pytest.importorskip("napari", reason="napari is not installed")
pytest.importorskip("qtpy", reason="napari has no Qt")

from cvtimg_napari import colors, objects, restoration, segments
from napari.components import ViewerModel
from napari.layers import Labels, Layer
from napari.qt import get_qapp

import cvtimg

PLACE = {"scale": (3.0, 2.0, 0.5, 0.5), "translate": (1.0, 2.0, 3.0, 4.0)}


@pytest.fixture
def viewer() -> Any:
    """The layers of a viewer, without the window, which would need OpenGL."""
    get_qapp()
    return ViewerModel()


@pytest.fixture
def film() -> np.ndarray[Any, Any]:
    """Two times, three z, 40 x 50 pixels: a bright square that moves over noise."""
    rng = np.random.default_rng(0)
    data = rng.normal(60, 8, (2, 3, 40, 50))
    for t, z in np.ndindex(2, 3):
        data[t, z, 5 + 4 * t : 25 + 4 * t, 8 + 5 * z : 28 + 5 * z] += 120
    return data.clip(0, 255).astype(np.uint8)


def wait_for(ready: Callable[[], Any], seconds: float = 30) -> None:
    from qtpy.QtWidgets import QApplication

    end = time.monotonic() + seconds
    while not ready():
        assert time.monotonic() < end, "nothing came"
        QApplication.processEvents()
        time.sleep(0.005)


def made_by(widget: Any, **values: Any) -> Any:
    """Press the button of a widget with some values, and return the layer that comes of it."""
    layers: list[Any] = []
    worker = widget(**values)
    worker.returned.connect(lambda found: layers.append(Layer.create(*found)))
    wait_for(lambda: layers)
    return layers[0]


def choose(widget: Any, image: Any) -> None:
    widget.image.choices = [image]
    widget.image.value = image


def test_the_manifest_names_what_is_there() -> None:
    from npe2 import PluginManifest

    manifest = PluginManifest.from_file(Path(segments.__file__).parent / "napari.yaml")
    commands = {command.id: command.python_name for command in manifest.contributions.commands}
    assert {widget.command for widget in manifest.contributions.widgets} == set(commands)
    for name in commands.values():
        module, _, attribute = str(name).partition(":")
        assert hasattr(importlib.import_module(module), attribute)


def test_quantized_planes_share_their_colors_and_their_place(viewer: Any, film: Any) -> None:
    image = viewer.add_image(film, name="film", metadata={"origin": "drawn"}, colormap="green", **PLACE)
    layer = made_by(colors.quantize(), image=image, n_colors=4)
    assert layer.data.shape == film.shape
    assert len(np.unique(layer.data)) == 4
    assert np.array_equal(layer.scale, image.scale)
    assert np.array_equal(layer.translate, image.translate)
    assert layer.colormap.name == "green"
    assert layer.metadata["origin"] == "drawn"
    assert set(layer.metadata["cvtimg"]["palette"].ravel()) == set(np.unique(layer.data))


def test_a_color_image_stays_one_of_colors(viewer: Any) -> None:
    rgb = np.random.default_rng(0).integers(0, 255, (3, 30, 40, 3), np.uint8)
    layer = made_by(colors.quantize(), image=viewer.add_image(rgb, rgb=True), n_colors=5, together=False)
    assert layer.rgb
    assert [len(np.unique(plane.reshape(-1, 3), axis=0)) for plane in layer.data] == [5, 5, 5]


def test_segments_are_those_of_each_plane(viewer: Any, film: Any) -> None:
    image = viewer.add_image(film, name="film", **PLACE)
    layer = made_by(segments.segment(), image=image, n_segments=2)
    assert isinstance(layer, Labels)
    assert np.array_equal(layer.scale, image.scale)
    for t, z in np.ndindex(2, 3):
        assert np.array_equal(layer.data[t, z], cvtimg.segment(film[t, z], 2).labels)
        assert (layer.data[t, z] == 2).sum() == pytest.approx(400, abs=8)


def test_segments_can_be_the_same_in_all_planes(viewer: Any, film: Any) -> None:
    brighter = film.copy()
    brighter[1] = 255 - (255 - brighter[1]) // 3  # by itself, each time has a dark and a bright segment
    image = viewer.add_image(brighter)
    layer = made_by(segments.segment(), image=image, n_segments=2, together=True)
    pooled = cvtimg.segment(brighter.reshape(-1, 50), 2, edge_weight=0).labels
    assert np.array_equal(layer.data.reshape(-1, 50), pooled)


def test_a_mask_leaves_pixels_out(viewer: Any, film: Any) -> None:
    image = viewer.add_image(film)
    mask = viewer.add_labels(np.pad(np.ones((20, 30), int), 10))
    layer = made_by(segments.segment(), image=image, n_segments=2, mask=mask)
    assert np.array_equal(layer.data[0, 0] > 0, mask.data > 0)


def test_superpixels_of_different_planes_have_different_labels(viewer: Any, film: Any) -> None:
    layer = made_by(segments.superpixels(), image=viewer.add_image(film), n_superpixels=20)
    seen = [set(np.unique(plane)) for plane in layer.data.reshape(6, 40, 50)]
    assert all(a.isdisjoint(b) for at, a in enumerate(seen) for b in seen[:at])


def test_an_image_of_several_resolutions_is_taken_at_the_full_one(viewer: Any, film: Any) -> None:
    plane = film[0, 0]
    image = viewer.add_image([plane, plane[::2, ::2]], multiscale=True)
    layer = made_by(segments.segment(), image=image, n_segments=2)
    assert layer.data.shape == plane.shape


@pytest.mark.parametrize("in_volume", [False, True])
def test_objects_are_counted_and_measured_in_the_units_of_the_layer(viewer: Any, in_volume: bool) -> None:
    z, y, x = np.mgrid[:9, :40, :60]
    balls = [np.hypot(np.hypot(3 * (z - 4), y - 20), x - at) < 9 for at in (15, 30, 48)]
    frame = np.uint8(30 + 150 * np.any(balls, axis=0))
    units = ("pixel", "micrometer", "micrometer", "micrometer")
    image = viewer.add_image(np.stack([frame, frame]), name="film", scale=(1, 1.5, 0.5, 0.5), units=units)
    widget = objects.CountObjects(viewer)
    choose(widget, image)
    widget.in_volume.value = in_volume
    widget.count()
    wait_for(lambda: len(viewer.layers) == 2)
    labels = viewer.layers[1]
    assert np.array_equal(labels.scale, image.scale)
    assert labels.units == image.units
    rows = {name: np.array(widget.table[name]) for name in widget.table.column_headers}
    assert rows["label"].tolist() == np.unique(labels.data)[1:].tolist()
    assert labels.features["index"].tolist() == rows["label"].tolist()
    if in_volume:
        assert len(rows["label"]) == 6
        assert rows["axis_0"].tolist() == [0, 0, 0, 1, 1, 1]
        assert rows["volume_um3"].max() == pytest.approx(4 / 3 * np.pi * 4.5**3, rel=0.15)
    else:
        middle = (rows["axis_0"] == 0) & (rows["axis_1"] == 4)
        assert sorted(rows["x_um"][middle]) == pytest.approx([7.5, 15, 24], abs=0.8)


def test_the_slider_cuts_the_hierarchy(viewer: Any, film: Any) -> None:
    image = viewer.add_image(film[0], name="stack", scale=(2, 1, 1))
    widget = segments.Hierarchy(viewer)
    choose(widget, image)
    widget.find()
    wait_for(lambda: len(viewer.layers) == 3)
    assert np.array_equal(viewer.layers[1].data[1], cvtimg.segment_hierarchy(film[0, 1]).find_edges(strength=True))
    widget.n_regions.value = 2
    labels = viewer.layers[-1]
    assert [len(np.unique(plane)) for plane in labels.data] == [2, 2, 2]
    assert np.array_equal(labels.scale, image.scale)
    widget.n_regions.value = 7
    assert [len(np.unique(plane)) for plane in labels.data] == [7, 7, 7]


def test_layers_are_versions_of_one_image(viewer: Any, film: Any) -> None:
    rng = np.random.default_rng(1)
    true = film[0].astype(float)
    layers = [viewer.add_image((true + rng.normal(0, 20, true.shape)).clip(0, 255).astype(np.uint8)) for _ in range(4)]
    layer = made_by(restoration.restore(), versions=layers)
    assert layer.data.shape == true.shape
    assert np.abs(layer.data - true).mean() < 0.7 * np.abs(layers[0].data - true).mean()


def test_the_first_axis_of_a_layer_holds_versions(viewer: Any, film: Any) -> None:
    noisy = np.repeat(film[:1, 0], 3, axis=0)
    image = viewer.add_image(noisy, scale=(5, 0.5, 0.5), name="shots")
    layer = made_by(restoration.restore(), versions=[image])
    assert layer.data.shape == film.shape[2:]
    assert layer.scale.tolist() == [0.5, 0.5]
    assert layer.name == "shots restored"


def test_the_elbow_is_that_of_the_plane_that_is_shown(viewer: Any) -> None:
    levels = np.repeat([10, 90, 170, 250], 300)
    flat = np.full(1200, 40)
    noise = np.random.default_rng(0).normal(0, 2, (2, 1200))
    stack = (np.stack([flat, levels]) + noise).clip(0, 255).astype(np.uint8).reshape(2, 30, 40)
    image = viewer.add_image(stack, name="steps")
    widget = colors.Elbow(viewer)
    choose(widget, image)
    viewer.dims.set_current_step(0, 1)
    widget.find()
    wait_for(lambda: widget.answer.value)
    assert widget.answer.value.startswith("steps: 4 ")
    pytest.importorskip("matplotlib", reason="the curve is drawn by matplotlib")
    assert widget.curve.value.shape[2] == 3
