"""Segments and Mesh: the picture divided into segments, regions or superpixels, and these into triangles."""

import shlex
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cvtimg._shared.budgets import ENOUGH_SAMPLES
from cvtimg._shared.choices import Json, Options
from cvtimg._shared.svg import drawing
from cvtimg.explore import controls as kinds
from cvtimg.explore.controls import Control, Settings, UnfitRequestError, controls_of, number, words_of
from cvtimg.explore.layers import Drawing, Indexed, Layer
from cvtimg.explore.outcomes import Code, Line, Outcome, Output, Recipe, call, evaluated, literal, run, safe_name
from cvtimg.explore.tabs.base import BRUSH, IMAGE, MASK, WRITE_IMAGE, Request, Tab, visible
from cvtimg.halfedges import edges_around, unique_edges
from cvtimg.labels import read_labels, region_means
from cvtimg.meshes import Mesh, measure_triangles
from cvtimg.segmentation import Objects

_FILE = Code("file")
_SEGMENTS = {"way": ["segments"]}
_WAYS = {
    "hierarchy": "connected regions",
    "segments": "segments by color",
    "objects": "objects, which are counted",
    "superpixels": "superpixels",
}
_PIECES = {"together": "together", "components": "each a segment", "objects": "objects, background"}
_TOUCHING = "Whether pieces of one color that do not touch are one segment."
_CHANGES = {"merge": "Merge", "split": "Split", "paint": "Paint", "add": "New", "erase": "Erase"}
_BY_HAND = "Merge: click two segments, or draw over several. Split: where the tree of regions does so first."
_MESHES = {".vtu": "VTK (.vtu)", ".msh": "Gmsh (.msh)", ".obj": "Wavefront (.obj)", ".stl": "STL (.stl)"}
#: What is said by the command that comes before.
_BEFORE: Json = {"when": {"of": ["segments"]}, "flag": ""}
#: Options of segments that counting does without.
_BY_COLOR = ("shading", "averaging", "smallest_detail", "edge_weight", "edge_radius")
_REGIONS: Json = {"label": "Regions", "when": {"way": ["hierarchy"]}}
_CELLS: Json = {"label": "Superpixels", "when": {"way": ["superpixels"]}}


class SegmentsTab(Tab):
    about = (
        "Divide the image into connected regions, segments of similar color, or superpixels, and change them by hand."
    )
    verb = "segment"
    arguments: ClassVar[Mapping[str, str]] = {"n_superpixels": "cells", "n_segments": "k"}
    pace = 0.6
    most_drafted = ENOUGH_SAMPLES
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "segment",
        kinds.Switches(name="way", label="Divide into", none="segments", choices=_WAYS),
        ("number", {"name": "k", "when": _SEGMENTS}),
        ("number", {**_REGIONS, "name": "regions", "default": "auto", "slider": (2, 200), "always": False}),
        ("number", {**_CELLS, "name": "cells", "default": 400, "room": 16, "slider": (16, 4000), "auto": False}),
        ("threshold", {"when": {"regions": ["auto"]}}),
        ("compactness", {"always": False}),
        *((name, {"when": _SEGMENTS}) for name in _BY_COLOR),
        ("background", {"name": "ground", "keyword": "background"}),
        *((name, {"keyword": name}) for name in ("diameter", "min_contrast", "exclude_edges")),
        "no_split",
        ("neck_depth", {"name": "necks", "default": "auto", "auto": True, "when": {"no_split": [False]}}),
        kinds.Switches(
            name="pieces", label="Pieces", none="together", choices=_PIECES, about=_TOUCHING, when=_SEGMENTS
        ),
        *((name, {"when": _SEGMENTS}) for name in ("background", "neck_depth")),
        "min_size",
        ("space", {"when": {"way": ["segments", "superpixels"]}}),
        ("space", {"name": "tree_space", "default": "lab", "when": _REGIONS["when"]}),
        ("effort", {"when": _SEGMENTS}),
        kinds.Edits(name="edits", label="By hand", flag="--edit", about=_BY_HAND, modes=_CHANGES),
        BRUSH,
        MASK,
    )

    def outputs(self, request: Request) -> Sequence[Output]:
        has_ground = not {"ground", "background"}.isdisjoint(self.in_effect(request.settings))
        labels, ignored = Code("labels"), {"ignore": None if has_ground else 0}  # its borders are not drawn
        overlay = call("cvtimg.plotting.draw_edges", IMAGE, labels, **ignored)
        edges = call("cvtimg.find_edges", labels, **ignored)
        means = call("cvtimg.labels.mean_picture", labels, IMAGE)
        contours = call("cvtimg.plotting.contour_drawing", call("cvtimg.find_contours", labels), labels, IMAGE)
        picture = request.picture
        channels = {"channels": [*picture.header.channels]} if picture.chosen else {}
        measured = {**channels, "objects": True} if has_ground else channels
        table = call("cvtimg.segmentation.file_table", _FILE, labels, IMAGE, **measured)
        scale, of_labels = ({"metadata": call("cvtimg.pictures.read_scale", _FILE, **of)} for of in ({}, {"nodata": 0}))
        of_means = {"alpha": False, **scale}
        end = ".png" if picture.array.dtype in (np.uint8, np.uint16) else ".tif"
        name = {"image": Path(picture.name).name}
        drawn = ("-o", "{}-labels.png", "cvtimg.labels.write_labels", (labels,), of_labels)
        return [
            Output("Labels, PNG", *drawn),
            Output("Outlines over the image, PNG", "--overlay", "{}-overlay.png", WRITE_IMAGE, (overlay,), scale),
            Output(f"Mean colors, {end[1:].upper()}", "--mean", f"{{}}-mean{end}", WRITE_IMAGE, (means,), of_means),
            Output("Edges, PNG", "--edges", "{}-edges.png", WRITE_IMAGE, (edges,), scale),
            Output("Contours, SVG", "--contours", "{}-contours.svg", "cvtimg.labels.write_contours", (contours,)),
            Output("Table of segments, CSV", "--table", "{}-table.csv", "cvtimg.labels.write_table", (table,), name),
            *self.map_files(request),
        ]

    def lines(self, request: Request) -> list[Line]:
        settings = request.settings
        lines, inside = visible(request, self.maps(request))
        lines = [Line(_FILE, Code(literal(request.picture.name)), request.picture.path), *lines]
        tree = Line("tree", call("cvtimg.segment_hierarchy", IMAGE, **inside))
        divided = self._call(settings, inside)
        if settings["way"] == "hierarchy":
            tree = Line("tree", divided)
            lines += [tree, Line("labels", _cut(settings, is_small=request.step > 1))]
        else:
            lines += [Line("segments", divided), Line("labels", Code("segments.labels"))]
        if edits := list(settings["edits"]):
            splits = any(edit.startswith("split") for edit in edits)
            lines += [tree] if splits and tree not in lines else []
            by = {"hierarchy": Code("tree")} if splits else {}
            lines += [Line("labels", call("cvtimg.segmentation.edit_labels", Code("labels"), edits, **by))]
        return lines

    def _call(self, settings: Settings, inside: Json) -> Code:
        keywords = inside | self.keywords(settings)
        if settings["way"] == "hierarchy":
            return call("cvtimg.segment_hierarchy", IMAGE, **keywords)
        if settings["way"] == "superpixels":
            return call("cvtimg.superpixels", IMAGE, settings["cells"], **keywords)
        if settings["way"] == "objects":
            if settings["no_split"] or settings["necks"] != "auto":
                keywords["neck_depth"] = Code("float('inf')") if settings["no_split"] else settings["necks"]
            return call("cvtimg.segmentation.count_objects", IMAGE, **keywords)
        if settings["pieces"] == "components":
            keywords["components"] = True
        elif settings["pieces"] == "objects":
            keywords["objects"] = Objects(settings["background"], settings["neck_depth"])
        return call("cvtimg.segment", IMAGE, settings["k"], **keywords)

    def draft(self, request: Request) -> Outcome | None:
        """Divide the picture in a small size; what is changed by hand is seen in full."""
        return None if request.settings["edits"] else Tab.draft(self, request)

    def run(self, request: Request) -> Json:
        """Run the lines; what takes long is kept, for the next cut or change by hand."""
        values: Json = {}
        for line in self.lines(request):
            if line.name in ("tree", "segments"):
                key = line.code, request.settings["mask"], request.step
                values[line.name] = request.picture.kept(key, partial(evaluated, line.code, values))
            else:
                values = run([line], values)
        return values

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        labels, image = values["labels"], values["image"]
        means = np.nan_to_num(region_means(labels, image))
        rounded = (np.rint(means) if image.dtype.kind in "iu" else means).astype(image.dtype)
        colors = request.picture.colors_seen(rounded, alpha=False)
        colors[0] = 0  # what is left out is seen through
        counts = np.bincount(labels.ravel(), minlength=len(colors))
        facts: Json = {"k": int(np.count_nonzero(counts[1:])), "counts": counts.tolist(), "labels": True}
        return Indexed(labels, colors), facts


class MeshTab(Tab):
    about = "Divide the segments of the image, or a mask, into triangles for computations."
    pace = 3.2
    most_drafted = ENOUGH_SAMPLES
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "mesh",
        kinds.Choice(name="of", label="Mesh", choices={"segments": "its segments", "picture": "mask or labels"}),
        *controls_of(
            "segment",
            ("number", {**_BEFORE, "name": "k", "default": 3, "auto": False, "high": 255}),
            ("min_size", {**_BEFORE, "name": "least", "default": 500, "keyword": ""}),
        ),
        kinds.Choice(name="by", label="Sizes by", choices={"n": "vertices", "edge": "edge length"}),
        ("n", {"when": {"by": ["n"]}, "always": False, "room": 4}),
        ("edge_length", {"when": {"by": ["edge"]}}),
        "grade",
        "min_size",
        "effort",
    )

    def pasted(self, flag: str, text: str) -> Json:
        name = {"segment -k": "k", "segment --min-size": "least"}.get(flag)
        return {"of": "segments", name: number(text)} if name else {}

    def outputs(self, request: Request) -> Sequence[Output]:
        return [Output(label, "-o", f"{{}}-mesh{suffix}") for suffix, label in _MESHES.items()]

    def recipe(self, request: Request) -> Recipe:
        lines, settings = self.lines(request), request.settings
        if settings["of"] == "picture":
            return Recipe(self.words(request), lines)
        name = safe_name(f"{request.picture.stem}-labels.png")
        least = ["--min-size", str(settings["least"])] if settings["least"] else []
        divide = ["cvtimg", "segment", *request.picture.words, "-k", str(settings["k"]), *least, "-o", name]
        words = ["cvtimg", self.verb, name, *words_of(self.controls, settings)]
        return Recipe(words, lines, shlex.join(divide), for_many=False)

    def lines(self, request: Request) -> list[Line]:
        settings, picture, keywords = request.settings, request.picture, self.keywords(request.settings)
        if settings["of"] == "picture":
            if picture.page:
                raise UnfitRequestError("all pages of a mask are meshed together, as a volume, by the command line")
            labels = request.every(picture.kept("labels", lambda: read_labels(picture.path)))
            values = np.unique(labels)
            is_mask = len(values) <= 2 and bool(values[0] == 0)  # black and one more value, as the command sees it
            read = Line("labels", call("cvtimg.labels.read_labels", picture.name), labels)
            mesh = ("cvtimg.mesh_region", Code("labels > 0")) if is_mask else ("cvtimg.mesh_labels", Code("labels"))
            return [read, Line("result", call(*mesh, **keywords))]
        least = {"min_size": settings["least"]} if settings["least"] else {}
        lines, inside = visible(request)
        segments = call("cvtimg.segment", IMAGE, settings["k"], **inside, **least)
        result = call("cvtimg.mesh_labels", Code("segments.labels"), **keywords)
        return [*lines, Line("segments", segments), Line("result", result)]

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        result: Mesh = values["result"]
        each = measure_triangles(result.points, result.triangles)
        least, mean = float(each.least_angles.min()), float(each.qualities.mean())
        about = f"{len(result.triangles)} triangles, least angle {least:.1f}°, mean quality {mean:.3f}"
        facts = {"k": len(result.points), "noun": "vertices", "about": about}
        return Drawing(_drawn(result, request.size), over=True), facts


def _cut(settings: Settings, *, is_small: bool) -> Code:
    """Return what cuts the tree of regions; that of a small picture may have fewer leaves than are asked for."""
    number, threshold = settings["regions"], settings["threshold"]
    if number != "auto":
        return Code(f"tree.cut(min({number}, tree.n_leaves))" if is_small else f"tree.cut({number})")
    return call("tree.cut", **({} if threshold == "auto" else {"threshold": threshold}))


def _drawn(mesh: Mesh, size: tuple[int, int]) -> bytes:
    thickness = max(float(np.sqrt(size[0] * size[1] / max(len(mesh.points), 1))) / 30, 0.1)
    height, width = size
    fine, bold = (_lines(mesh, edges) for edges in (unique_edges(edges_around(mesh.triangles))[0], mesh.edges))
    look = 'fill="none" stroke-linecap="round"'
    body = (
        f'<g {look}><path d="{fine}" stroke="#fff" stroke-opacity=".75" stroke-width="{2.4 * thickness:.3f}"/>'
        f'<path d="{fine}" stroke="#124" stroke-width="{thickness:.3f}"/>'
        f'<path d="{bold}" stroke="#d61" stroke-width="{3 * thickness:.3f}"/></g>'
    )
    return "".join(drawing(width, height, [body])).encode()


def _lines(mesh: Mesh, edges: Any) -> str:
    ends = mesh.points[edges].reshape(-1, 4).tolist()
    return "".join(f"M{a:.2f} {b:.2f}L{c:.2f} {d:.2f}" for a, b, c, d in ends)
