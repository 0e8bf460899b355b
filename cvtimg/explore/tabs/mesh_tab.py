"""Mesh: triangles for the segments of the picture, or for a mask."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from cvtimg._shared.choices import Json, Options
from cvtimg._shared.svg import drawing
from cvtimg.explore.calls import Code, Line, call
from cvtimg.explore.controls import Choice, Control, UnfitRequestError, controls_of, number, words_of
from cvtimg.explore.layers import Drawing, Layer
from cvtimg.explore.outcomes import Output, Recipe, safe_name
from cvtimg.explore.tabs.base import IMAGE, Request, Tab, visible
from cvtimg.halfedges import edges_around, unique_edges
from cvtimg.labels import read_labels
from cvtimg.meshes import Mesh, measure_triangles

_FILES = {".vtu": "VTK (.vtu)", ".msh": "Gmsh (.msh)", ".obj": "Wavefront (.obj)", ".stl": "STL (.stl)"}
#: What is said by the command that comes before.
_SEGMENTS: Json = {"when": {"of": ["segments"]}, "flag": ""}


class MeshTab(Tab):
    name = "mesh"
    about = "Divide the segments of the image, or a mask, into triangles for computations."
    verb = "mesh"
    pace = 3.2
    most_drafted = 1 << 17
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "mesh",
        Choice(
            name="of",
            label="Mesh",
            default="segments",
            choices={"segments": "its segments", "picture": "mask or labels"},
        ),
        *controls_of(
            "segment",
            ("number", {**_SEGMENTS, "name": "k", "default": 3, "auto": False, "high": 255}),
            ("min_size", {**_SEGMENTS, "name": "least", "default": 500, "keyword": ""}),
        ),
        Choice(name="by", label="Sizes by", default="n", choices={"n": "vertices", "edge": "edge length"}),
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
        return [Output(label, "-o", f"{{}}-mesh{suffix}") for suffix, label in _FILES.items()]

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
