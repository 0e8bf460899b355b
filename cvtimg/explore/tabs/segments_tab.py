"""Segments: the picture divided into segments, regions or superpixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cvtimg.explore.calls import Call, Formula, Line, Name, literal, run
from cvtimg.explore.controls import Control, Edits, Settings, Switches, controls_of
from cvtimg.explore.layers import Indexed, Layer
from cvtimg.explore.outcomes import Outcome, Output
from cvtimg.explore.tabs.base import IMAGE, MASK, Request, Tab, brushes, visible
from cvtimg.labels import region_means
from cvtimg.segmentation import Averaging, Edit, Objects, RegionHierarchy

_SEGMENTS = {"way": ["segments"]}
_REGIONS: dict[str, Any] = {"label": "Regions", "when": {"way": ["hierarchy"]}}
_CELLS: dict[str, Any] = {"label": "Superpixels", "when": {"way": ["superpixels"]}}


class SegmentsTab(Tab):
    """Segmentation, trees of regions and superpixels."""

    name = "segments"
    title = "Segments"
    about = (
        "Divide the image into connected regions, segments of similar color, or superpixels, and change them by hand."
    )
    verb = "segment"
    arguments: ClassVar[Mapping[str, str]] = {"n_superpixels": "cells", "n_segments": "k"}
    most_drafted = 1 << 17
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
        ("number", {**_CELLS, "name": "cells", "default": 400, "room": 16, "slider": (16, 4000), "auto": False}),
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
        counts = request.settings["way"] == "segments" and request.settings["pieces"] == "objects"
        labels, ignored = Name("labels"), {"ignore": None if counts else 0}  # its borders are not drawn
        overlay = Call("plotting.draw_edges", (IMAGE, labels), ignored)
        edges = Call("find_edges", (labels,), ignored)
        means = Call("labels.mean_picture", (labels, IMAGE))
        contours = Call("plotting.contour_drawing", (Call("find_contours", (labels,)), labels, IMAGE))
        name = {"image": Path(request.picture.name).name}
        table = Call("labels.write_table", (Call("labels.region_table", (labels, IMAGE)),), name)
        return [
            Output("Labels, PNG", "-o", "{}-labels.png", Call("labels.write_labels", (labels,))),
            Output("Outlines over the image, PNG", "--overlay", "{}-overlay.png", Call("write_image", (overlay,))),
            Output("Mean colors, PNG", "--mean", "{}-mean.png", Call("write_image", (means,), {"alpha": False})),
            Output("Edges, PNG", "--edges", "{}-edges.png", Call("write_image", (edges,))),
            Output("Contours, SVG", "--contours", "{}-contours.svg", Call("labels.write_contours", (contours,))),
            Output("Table of segments, CSV", "--table", "{}-table.csv", table),
            *self.map_outputs(request),
        ]

    def lines(self, request: Request) -> list[Line]:
        settings = request.settings
        lines, inside = visible(request, self.maps(request).get("mask"), self.map_lines(request))
        tree = Line("tree", Call("segment_hierarchy", (IMAGE,), inside))
        call = self._call(settings, inside)
        if settings["way"] == "hierarchy":
            tree = Line("tree", call)
            lines += [tree, Line("labels", Formula(_cut_text(settings), partial(_cut, settings)))]
        else:
            lines += [Line("segments", call), Line("labels", Name("segments.labels"))]
        if edits := list(settings["edits"]):
            splits = any(edit.startswith("split") for edit in edits)
            lines += [tree] if splits and tree not in lines else []
            by = {"hierarchy": Name("tree")} if splits else {}
            lines += [Line("labels", Call("segmentation.edit_labels", (Name("labels"), edits), by))]
        return lines

    def _call(self, settings: Settings, inside: dict[str, Any]) -> Call:
        keywords = inside | self.keywords(settings)
        if settings["way"] == "hierarchy":
            return Call("segment_hierarchy", (IMAGE,), keywords)
        if settings["way"] == "superpixels":
            return Call("superpixels", (IMAGE, settings["cells"]), keywords)
        if settings["averaging"] != "none":
            keywords["averaging"] = Averaging(settings["averaging"], settings["kernel"], settings["radius"])
        if settings["pieces"] == "components":
            keywords["components"] = True
        elif settings["pieces"] == "objects":
            keywords["objects"] = Objects(settings["background"], settings["neck_depth"])
        return Call("segment", (IMAGE, settings["k"]), keywords)

    def draft(self, request: Request) -> Outcome | None:
        """Divide the picture in a small size; what is changed by hand is seen in full."""
        return None if request.settings["edits"] else Tab.draft(self, request)

    def run(self, request: Request) -> dict[str, Any]:
        """Run the lines; what takes long is kept, for the next cut or change by hand."""
        values: dict[str, Any] = {}
        for line in self.lines(request):
            if line.name in ("tree", "segments"):
                key = literal(line.value), request.settings["mask"], request.step
                values[line.name] = request.picture.kept(key, partial(line.value.run, values))
            else:
                values = run([line], values)
        return values

    def seen(self, request: Request, values: Mapping[str, Any]) -> tuple[Layer, dict[str, Any]]:
        labels, image = values["labels"], values["image"]
        means = np.nan_to_num(region_means(labels, image))
        rounded = (np.rint(means) if image.dtype.kind in "iu" else means).astype(image.dtype)
        colors = request.picture.colors_seen(rounded, alpha=False)
        colors[0] = 0  # what is left out is seen through
        counts = np.bincount(labels.ravel(), minlength=len(colors))
        facts: dict[str, Any] = {"k": int(np.count_nonzero(counts[1:])), "counts": counts.tolist(), "labels": True}
        return Indexed(labels, colors), facts


def _cut_text(settings: Settings) -> str:
    if settings["regions"] != "auto":
        return f"tree.cut({settings['regions']})"
    return "tree.cut()" if settings["threshold"] == "auto" else f"tree.cut(threshold={settings['threshold']})"


def _cut(settings: Settings, values: Mapping[str, Any]) -> NDArray[np.int32]:
    tree: RegionHierarchy = values["tree"]
    regions, threshold = settings["regions"], settings["threshold"]
    if regions != "auto":  # a draft may have fewer
        return tree.cut(min(max(regions, tree.n_parts), tree.n_leaves))
    return tree.cut(threshold=None if threshold == "auto" else threshold)
