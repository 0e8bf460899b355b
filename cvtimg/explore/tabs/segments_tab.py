"""Segments: the picture divided into segments, regions or superpixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg import find_contours, find_edges, write_image
from cvtimg.explore.calls import Call, Named
from cvtimg.explore.controls import Choice, Control, Number, Settings
from cvtimg.explore.layers import Indexed, Window
from cvtimg.explore.opened import Picture
from cvtimg.explore.outcomes import Outcome, Output, Recipe
from cvtimg.explore.tabs.base import SPACES, Ask, Tab, effort, reading, space
from cvtimg.labels import mean_picture, region_means, region_table, write_contours, write_labels, write_table
from cvtimg.plotting import contour_drawing, draw_edges
from cvtimg.segmentation import Averaging, Objects

#: Pixels of a draft.
_DRAFT = 1 << 17
_SEGMENTS, _REGIONS, _CELLS = ({"way": [way]} for way in ("segments", "regions", "superpixels"))


class Divided(NamedTuple):
    """A divided picture: its labels and the bands that count."""

    labels: NDArray[np.int32]
    image: NDArray[Any]


class SegmentsTab(Tab):
    """Segmentation, trees of regions and superpixels."""

    name = "segments"
    title = "Segments"
    about = "Divide the picture into segments of similar color, connected regions, or superpixels."
    verb = "segment"
    controls: ClassVar[tuple[Control, ...]] = (
        Choice(
            name="way",
            label="Divide into",
            default="segments",
            choices={
                "segments": "segments by color",
                "regions": "connected regions",
                "superpixels": "superpixels",
            },
        ),
        Number(
            name="k",
            label="Segments",
            default=4,
            low=1,
            high=65536,
            slider=(2, 64),
            log=True,
            auto=True,
            flag="-k",
            always=True,
            when=_SEGMENTS,
        ),
        Number(
            name="regions",
            label="Regions",
            default="auto",
            low=1,
            high=65536,
            slider=(2, 200),
            log=True,
            auto=True,
            flag="-k",
            when=_REGIONS,
        ),
        Number(
            name="cells",
            label="Superpixels",
            default=400,
            low=1,
            high=65536,
            slider=(16, 4000),
            log=True,
            flag="-k",
            always=True,
            when=_CELLS,
        ),
        Number(
            name="threshold",
            label="Threshold",
            default="auto",
            low=0,
            high=1000,
            slider=(0.05, 2),
            step=0.05,
            auto=True,
            flag="--threshold",
            when={**_REGIONS, "regions": ["auto"]},
        ),
        Number(
            name="compactness",
            label="Compactness",
            default=10.0,
            low=0,
            high=10**6,
            slider=(0, 100),
            step=0.5,
            flag="--compactness",
            keyword="compactness",
            when=_CELLS,
        ),
        Choice(
            name="averaging",
            label="Averaging",
            default="none",
            choices={"none": "none", "before": "of the picture, before", "after": "of the segments, after"},
            flag="--averaging",
            when=_SEGMENTS,
            about="Against noise.",
        ),
        Choice(
            name="kernel",
            label="Kernel",
            default="gaussian",
            choices={"gaussian": "Gaussian", "box": "box"},
            flag="--kernel",
            when={"averaging": ["before", "after"]},
        ),
        Number(
            name="radius",
            label="Radius",
            default=2,
            low=1,
            high=1000,
            slider=(1, 20),
            unit="px",
            flag="--radius",
            when={"averaging": ["before", "after"]},
        ),
        Number(
            name="edge_weight",
            label="Edge weight",
            default=0.0,
            low=0,
            high=10**6,
            slider=(0, 100),
            step=0.5,
            auto=True,
            flag="--edge-weight",
            keyword="edge_weight",
            when=_SEGMENTS,
            about="Penalty per pixel of border: larger values give smoother segments. Auto follows the noise.",
        ),
        Number(
            name="edge_radius",
            label="Edge radius",
            default=3,
            low=1,
            high=30,
            slider=(1, 10),
            unit="px",
            flag="--edge-radius",
            keyword="edge_radius",
            when=_SEGMENTS,
        ),
        Choice(
            name="pieces",
            label="Pieces",
            default="together",
            choices={
                "together": "together",
                "components": "each a segment",
                "objects": "objects, background",
            },
            about="Whether pieces of one color that do not touch are one segment.",
            when=_SEGMENTS,
        ),
        Number(
            name="border_price",
            label="Border price",
            default=0.0,
            low=0,
            high=10**7,
            slider=(0, 5000),
            step=10.0,
            flag="--border-price",
            keyword="border_price",
            when={"pieces": ["components"]},
            about="Merge neighbors where that costs less per pixel of border.",
        ),
        Choice(
            name="background",
            label="Background",
            default="largest",
            choices={"largest": "largest segment", "darkest": "darkest segment", "brightest": "brightest segment"},
            flag="--background",
            when={"pieces": ["objects"]},
        ),
        Number(
            name="neck_depth",
            label="Depth of necks",
            default=0.5,
            low=0,
            high=1000,
            slider=(0, 10),
            step=0.1,
            unit="px",
            flag="--neck-depth",
            when={"pieces": ["objects"]},
        ),
        Number(
            name="min_size",
            label="Least size",
            default=0,
            low=0,
            high=2**31 - 1,
            slider=(0, 2000),
            unit="px",
            flag="--min-size",
            keyword="min_size",
            when=_SEGMENTS,
            about="Merge smaller pieces into a neighbor.",
        ),
        space(when={"way": ["segments", "superpixels"]}),
        Choice(
            name="tree_space",
            label="Color space",
            default="lab",
            choices={name: label for name, label in SPACES.items() if name != "rgb"},
            flag="--space",
            when=_REGIONS,
        ),
        effort(when=_SEGMENTS),
    )

    def outputs(self, ask: Ask) -> Sequence[Output]:
        """Return the labels, drawings of them, and a table."""
        return _outputs(None if _has_objects(ask.settings) else 0)

    def recipe(self, ask: Ask) -> Recipe:
        """Return the command and the lines of Python."""
        settings, picture = ask.settings, ask.picture
        flags = {"regions": ["--hierarchy"], "superpixels": ["--superpixels"]}.get(settings["way"], [])
        if settings["way"] == "segments":
            flags = {"components": ["--components"], "objects": ["--objects"]}.get(settings["pieces"], [])
        lines = [reading(picture)]
        if picture.has_alpha:
            lines += ["known = image[..., 3] > 0", "image = image[..., :3]"]
        elif picture.header.nodata is not None and picture.known is not None:
            lines += [f"known = (image.reshape(*image.shape[:2], -1) != {picture.header.nodata}).any(axis=2)"]
        call = self._call(settings, _known(picture))
        if settings["way"] == "regions":
            lines += [f"labels = {call.text()}.{_cut_text(settings)}"]
        else:
            lines += [f"labels = {call.text()}.labels"]
        return Recipe(self.words(ask, *flags), "\n".join(lines))

    def _call(self, settings: Settings, known: NDArray[np.bool_] | None) -> Call:
        keywords: dict[str, Any] = {} if known is None else {"mask": Named("known", known)}
        keywords |= self.keywords(settings)
        if settings["way"] == "regions":
            if settings["tree_space"] != "lab":
                keywords["space"] = settings["tree_space"]
            return Call("segment_hierarchy", (), keywords)
        if settings["space"] != "rgb":
            keywords["space"] = settings["space"]
        if settings["way"] == "superpixels":
            return Call("superpixels", (settings["cells"],), keywords)
        if settings["averaging"] != "none":
            keywords["averaging"] = Averaging(settings["averaging"], settings["kernel"], settings["radius"])
        if settings["pieces"] == "components":
            keywords["components"] = True
        elif settings["pieces"] == "objects":
            keywords["objects"] = Objects(settings["background"], settings["neck_depth"])
        return Call("segment", (settings["k"],), keywords)

    def draft(self, ask: Ask) -> Outcome | None:
        """Divide the picture in a small size."""
        picture = ask.picture
        window = picture.whole(_DRAFT)
        if window.step == 1:
            return self._outcome(ask, self._divided(ask, ask.settings, window))
        return self._outcome(ask, self._divided(ask, _scaled(ask.settings, window.step), window), window)

    def exact(self, ask: Ask) -> Outcome:
        """Divide the picture."""
        whole = ask.picture.whole(1 << 62)
        return self._outcome(ask, self._divided(ask, ask.settings, whole), outputs=self.outputs(ask))

    def _divided(self, ask: Ask, settings: Settings, window: Window) -> Divided:
        picture = ask.picture
        image = window.of_array(picture.plain[..., :3] if picture.has_alpha else picture.plain)
        known = _known(picture)
        call = self._call(settings, None if known is None else window.of_array(known))
        if settings["way"] != "regions":
            return Divided(call.run(image).labels, image)
        tree = picture.kept(("tree", settings["tree_space"], window), lambda: call.run(image))
        regions, threshold = settings["regions"], settings["threshold"]
        if regions != "auto":
            return Divided(tree.cut(min(max(regions, tree.n_parts), tree.n_leaves)), image)
        return Divided(tree.cut(threshold=None if threshold == "auto" else threshold), image)

    def _outcome(
        self, ask: Ask, divided: Divided, drawn: Window | None = None, outputs: Sequence[Output] = ()
    ) -> Outcome:
        labels, image = divided
        means = np.nan_to_num(region_means(labels, image))
        rounded = (np.rint(means) if image.dtype.kind in "iu" else means).astype(image.dtype)
        colors = ask.picture.colors_seen(rounded, alpha=False)
        colors[0] = 0  # what is left out is seen through
        counts = np.bincount(labels.ravel(), minlength=len(colors))
        facts: dict[str, Any] = {"k": int(np.count_nonzero(counts[1:])), "counts": counts.tolist(), "labels": True}
        return Outcome(divided, Indexed(labels, colors), facts, outputs, ask.picture.stem, drawn=drawn)


def _known(picture: Picture) -> NDArray[np.bool_] | None:
    """(H, W) pixels to segment; None for all."""
    if not picture.has_alpha:
        return picture.known
    seen: NDArray[np.bool_] = picture.plain[..., 3] > 0
    return seen if picture.known is None else seen & picture.known


def _has_objects(settings: Settings) -> bool:
    return bool(settings["way"] == "segments" and settings["pieces"] == "objects")


def _cut_text(settings: Settings) -> str:
    if settings["regions"] != "auto":
        return f"cut({settings['regions']})"
    return "cut()" if settings["threshold"] == "auto" else f"cut(threshold={settings['threshold']})"


def _scaled(settings: Settings, step: int) -> Mapping[str, Any]:
    """Return settings for every step-th pixel: lengths and areas shrink with the picture."""
    lengths = {"radius": max(round(settings["radius"] / step), 1), "neck_depth": settings["neck_depth"] / step}
    return {**settings, **lengths, "min_size": settings["min_size"] // step**2}


def _write_labels(divided: Divided, path: Path) -> None:
    write_labels(path, divided.labels)


def _write_mean(divided: Divided, path: Path) -> None:
    write_image(path, mean_picture(divided.labels, divided.image), alpha=False)


def _write_overlay(divided: Divided, path: Path, ignore: int | None) -> None:
    write_image(path, draw_edges(divided.image, divided.labels, ignore=ignore))


def _write_edges(divided: Divided, path: Path, ignore: int | None) -> None:
    write_image(path, find_edges(divided.labels, ignore=ignore))


def _write_contours(divided: Divided, path: Path) -> None:
    write_contours(path, contour_drawing(find_contours(divided.labels), divided.labels, divided.image))


def _write_table(divided: Divided, path: Path) -> None:
    write_table(path, region_table(divided.labels, divided.image))


def _outputs(ignore: int | None) -> tuple[Output, ...]:
    """Return the files; borders of the label to ignore are not drawn."""
    return (
        Output("Labels, PNG", "-o", "{}-labels.png", _write_labels, "cvtimg.labels.write_labels({}, labels)"),
        Output(
            "Outlines over the picture, PNG",
            "--overlay",
            "{}-overlay.png",
            partial(_write_overlay, ignore=ignore),
            f"cvtimg.write_image({{}}, cvtimg.plotting.draw_edges(image, labels, ignore={ignore}))",
        ),
        Output(
            "Mean colors, PNG",
            "--mean",
            "{}-mean.png",
            _write_mean,
            "cvtimg.write_image({}, cvtimg.labels.mean_picture(labels, image), alpha=False)",
        ),
        Output(
            "Edges, PNG",
            "--edges",
            "{}-edges.png",
            partial(_write_edges, ignore=ignore),
            f"cvtimg.write_image({{}}, cvtimg.find_edges(labels, ignore={ignore}))",
        ),
        Output(
            "Contours, SVG",
            "--contours",
            "{}-contours.svg",
            _write_contours,
            "drawing = cvtimg.plotting.contour_drawing(cvtimg.find_contours(labels), labels, image)\n"
            "cvtimg.labels.write_contours({}, drawing)",
        ),
        Output(
            "Table of segments, CSV",
            "--table",
            "{}-table.csv",
            _write_table,
            "cvtimg.labels.write_table({}, cvtimg.labels.region_table(labels, image))",
        ),
    )
