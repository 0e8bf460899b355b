"""Segments: the picture divided into segments, regions or superpixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg import find_contours, find_edges, write_image
from cvtimg.explore.calls import Call, Named, literal
from cvtimg.explore.controls import Control, Edits, Settings, Switches, UnfitRequestError, controls_of
from cvtimg.explore.layers import Indexed, Window
from cvtimg.explore.opened import Picture
from cvtimg.explore.outcomes import Outcome, Output, Recipe, quoted
from cvtimg.explore.tabs.base import MASK, Request, Tab, brushes, reading
from cvtimg.labels import mean_picture, region_means, region_table, write_contours, write_labels, write_table
from cvtimg.plotting import contour_drawing, draw_edges
from cvtimg.segmentation import Averaging, Edit, Objects, RegionHierarchy, edit_labels

#: Pixels of a draft.
_DRAFT = 1 << 17
_SEGMENTS = {"way": ["segments"]}
_REGIONS: dict[str, Any] = {"label": "Regions", "when": {"way": ["hierarchy"]}}
_CELLS: dict[str, Any] = {"label": "Superpixels", "when": {"way": ["superpixels"]}}


class Divided(NamedTuple):
    """A divided picture: its labels and the bands that count."""

    labels: NDArray[np.int32]
    image: NDArray[Any]


class SegmentsTab(Tab):
    """Segmentation, trees of regions and superpixels."""

    name = "segments"
    title = "Segments"
    about = (
        "Divide the image into connected regions, segments of similar color, or superpixels, and change them by hand."
    )
    verb = "segment"
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "segment",
        Switches(
            name="way",
            label="Divide into",
            default="hierarchy",
            none="segments",
            choices={"hierarchy": "connected regions", "segments": "segments by color", "superpixels": "superpixels"},
        ),
        ("number", {"name": "k", "when": _SEGMENTS}),
        ("number", {**_REGIONS, "name": "regions", "default": "auto", "slider": (2, 200), "always": False}),
        ("number", {**_CELLS, "name": "cells", "default": 400, "slider": (16, 4000), "auto": False}),
        ("threshold", {"when": {"regions": ["auto"]}}),
        ("compactness", {"always": False}),
        "shading",
        "averaging",
        "kernel",
        ("radius", {"default": 2, "low": 1}),
        "smallest_detail",
        "edge_weight",
        "edge_radius",
        Switches(
            name="pieces",
            label="Pieces",
            default="together",
            none="together",
            choices={"together": "together", "components": "each a segment", "objects": "objects, background"},
            about="Whether pieces of one color that do not touch are one segment.",
            when=_SEGMENTS,
        ),
        "border_price",
        "background",
        "neck_depth",
        "min_size",
        ("space", {"when": {"way": ["segments", "superpixels"]}}),
        ("space", {"name": "tree_space", "default": "lab", "when": _REGIONS["when"]}),
        ("effort", {"when": _SEGMENTS}),
        Edits(
            name="edits",
            label="By hand",
            flag="--edit",
            about="Merge: click two segments, or draw over several. Split: where the tree of regions does so first.",
            modes={"merge": "Merge", "split": "Split", "paint": "Paint", "add": "New", "erase": "Erase"},
            check=Edit.parse,
        ),
        brushes("Mask"),
        MASK,
    )

    def outputs(self, request: Request) -> Sequence[Output]:
        """Return the labels, drawings of them, and a table."""
        ignore, name = None if _has_objects(request.settings) else 0, Path(request.picture.name).name
        return [*_outputs(ignore, name), *self.map_outputs(request)]

    def recipe(self, request: Request) -> Recipe:
        """Return the command and the lines of Python."""
        settings, picture = request.settings, request.picture
        lines = [reading(picture)]
        if picture.has_alpha:
            lines += ["known = image[..., 3] > 0"]
        elif picture.header.nodata is not None and picture.known is not None:
            lines += [f"known = (image.reshape(*image.shape[:2], -1) != {picture.header.nodata}).any(axis=2)"]
        if picture.header.has_alpha and picture.array.shape[2:] == (4,):
            lines += ["image = image[..., :3]"]
        known, mask = _known(picture), self.maps(request).get("mask")
        if mask is not None:
            lines += [self.map_lines(request).strip(), "known = mask > 0" if known is None else "known &= mask > 0"]
            known = mask > 0
        call = self._call(settings, known)
        if settings["way"] == "hierarchy":
            lines += [f"tree = {call.text()}", f"labels = tree.{_cut_text(settings)}"]
        else:
            lines += [f"labels = {call.text()}.labels"]
        if edits := settings["edits"]:
            if settings["way"] != "hierarchy" and _splits(edits):
                lines += [f"tree = {self._tree_call(settings, known).text()}"]
            tree = ", hierarchy=tree" if _splits(edits) else ""
            lines += [f"labels = cvtimg.segmentation.edit_labels(labels, {literal(list(edits))}{tree})"]
        return Recipe(self.words(request), "\n".join(lines))

    def _call(self, settings: Settings, known: NDArray[np.bool_] | None) -> Call:
        keywords: dict[str, Any] = {} if known is None else {"mask": Named("known", known)}
        keywords |= self.keywords(settings)
        if settings["way"] == "hierarchy":
            return Call("segment_hierarchy", (), keywords)
        if settings["way"] == "superpixels":
            return Call("superpixels", (settings["cells"],), keywords)
        if settings["averaging"] != "none":
            keywords["averaging"] = Averaging(settings["averaging"], settings["kernel"], settings["radius"])
        if settings["pieces"] == "components":
            keywords["components"] = True
        elif settings["pieces"] == "objects":
            keywords["objects"] = Objects(settings["background"], settings["neck_depth"])
        return Call("segment", (settings["k"],), keywords)

    def _tree_call(self, settings: Settings, known: NDArray[np.bool_] | None) -> Call:
        """Return the call that makes the tree by which segments are split."""
        if settings["way"] == "hierarchy":
            return self._call(settings, known)
        return Call("segment_hierarchy", (), {} if known is None else {"mask": Named("known", known)})

    def draft(self, request: Request) -> Outcome | None:
        """Divide the picture in a small size; what is changed by hand is seen in full."""
        picture = request.picture
        if request.settings["edits"]:
            return None
        window = picture.whole(_DRAFT)
        if window.step == 1:
            return self._outcome(request, self._divided(request, request.settings, window))
        return self._outcome(request, self._divided(request, _scaled(request.settings, window.step), window), window)

    def exact(self, request: Request) -> Outcome:
        """Divide the picture."""
        whole = request.picture.whole(1 << 62)
        return self._outcome(request, self._divided(request, request.settings, whole), outputs=self.outputs(request))

    def _divided(self, request: Request, settings: Settings, window: Window) -> Divided:
        picture = request.picture
        image = window.of_array(picture.plain[..., :3] if picture.has_alpha else picture.plain)
        known = _known(picture)
        if (mask := self.maps(request).get("mask")) is not None:
            known = mask > 0 if known is None else known & (mask > 0)
            if not known.any():
                raise UnfitRequestError("the mask leaves nothing")
        inside = None if known is None else window.of_array(known)

        def tree() -> RegionHierarchy:
            call = self._tree_call(settings, inside)
            found: RegionHierarchy = picture.kept((call.text(), settings["mask"], window), lambda: call.run(image))
            return found

        def labels() -> NDArray[np.int32]:
            if settings["way"] != "hierarchy":
                found: NDArray[np.int32] = self._call(settings, inside).run(image).labels
                return found
            regions, threshold = settings["regions"], settings["threshold"]
            if regions != "auto":
                return tree().cut(min(max(regions, tree().n_parts), tree().n_leaves))
            return tree().cut(threshold=None if threshold == "auto" else threshold)

        if not settings["edits"]:
            return Divided(labels(), image)
        before = picture.kept(("before edits", *sorted({**settings, "edits": ()}.items())), labels)
        return Divided(edit_labels(before, settings["edits"], hierarchy=tree), image)

    def _outcome(
        self, request: Request, divided: Divided, drawn: Window | None = None, outputs: Sequence[Output] = ()
    ) -> Outcome:
        labels, image = divided
        means = np.nan_to_num(region_means(labels, image))
        rounded = (np.rint(means) if image.dtype.kind in "iu" else means).astype(image.dtype)
        colors = request.picture.colors_seen(rounded, alpha=False)
        colors[0] = 0  # what is left out is seen through
        counts = np.bincount(labels.ravel(), minlength=len(colors))
        facts: dict[str, Any] = {"k": int(np.count_nonzero(counts[1:])), "counts": counts.tolist(), "labels": True}
        return Outcome(divided, Indexed(labels, colors), facts, outputs, request.picture.stem, drawn=drawn)


def _known(picture: Picture) -> NDArray[np.bool_] | None:
    """(H, W) pixels to segment; None for all."""
    if not picture.has_alpha:
        return picture.known
    seen: NDArray[np.bool_] = picture.plain[..., 3] > 0
    return seen if picture.known is None else seen & picture.known


def _splits(edits: Sequence[str]) -> bool:
    return any(edit.startswith("split") for edit in edits)


def _has_objects(settings: Settings) -> bool:
    return bool(settings["way"] == "segments" and settings["pieces"] == "objects")


def _cut_text(settings: Settings) -> str:
    if settings["regions"] != "auto":
        return f"cut({settings['regions']})"
    return "cut()" if settings["threshold"] == "auto" else f"cut(threshold={settings['threshold']})"


def _scaled(settings: Settings, step: int) -> Mapping[str, Any]:
    """Return settings for every step-th pixel: lengths and areas shrink with the picture."""
    lengths = {"radius": max(round(settings["radius"] / step), 1)}
    lengths |= {name: settings[name] / step for name in ("neck_depth", "smallest_detail")}
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


def _write_table(divided: Divided, path: Path, image: str) -> None:
    write_table(path, region_table(divided.labels, divided.image), image=image)


def _outputs(ignore: int | None, name: str) -> tuple[Output, ...]:
    """Return the files, of an image of this name; borders of the label to ignore are not drawn."""
    edges = f"labels, ignore={ignore}"
    overlay = f"cvtimg.write_image({{}}, cvtimg.plotting.draw_edges(image, {edges}))"
    mean = "cvtimg.write_image({}, cvtimg.labels.mean_picture(labels, image), alpha=False)"
    contours = "drawing = cvtimg.plotting.contour_drawing(cvtimg.find_contours(labels), labels, image)\n"
    contours += "cvtimg.labels.write_contours({}, drawing)"
    called = quoted(name).replace("{", "{{").replace("}", "}}")
    table = f"cvtimg.labels.write_table({{}}, cvtimg.labels.region_table(labels, image), image={called})"
    over, lines = partial(_write_overlay, ignore=ignore), partial(_write_edges, ignore=ignore)
    return (
        Output("Labels, PNG", "-o", "{}-labels.png", _write_labels, "cvtimg.labels.write_labels({}, labels)"),
        Output("Outlines over the image, PNG", "--overlay", "{}-overlay.png", over, overlay),
        Output("Mean colors, PNG", "--mean", "{}-mean.png", _write_mean, mean),
        Output("Edges, PNG", "--edges", "{}-edges.png", lines, f"cvtimg.write_image({{}}, cvtimg.find_edges({edges}))"),
        Output("Contours, SVG", "--contours", "{}-contours.svg", _write_contours, contours),
        Output("Table of segments, CSV", "--table", "{}-table.csv", partial(_write_table, image=name), table),
    )
