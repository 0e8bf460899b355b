"""Mesh: triangles for the segments of the picture, or for a mask."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.progress import part
from cvtimg._shared.svg import drawing, numbers
from cvtimg.explore.calls import Call
from cvtimg.explore.controls import Choice, Control, Number, Settings, UnfitRequestError, controls_of, words_of
from cvtimg.explore.layers import Drawing
from cvtimg.explore.opened import Picture
from cvtimg.explore.outcomes import Outcome, Output, Recipe, quoted, safe_name
from cvtimg.explore.tabs.base import SAVED, Request, Tab, reading, saved
from cvtimg.halfedges import edges_around, unique_edges
from cvtimg.labels import read_labels
from cvtimg.meshes import Mesh, measure_triangles

#: Part of the time until the image is divided into segments.
_SEGMENTED = 0.15
_FILES = {".vtu": "VTK (.vtu)", ".msh": "Gmsh (.msh)", ".obj": "Wavefront (.obj)", ".stl": "STL (.stl)"}


class MeshTab(Tab):
    """Meshes."""

    name = "mesh"
    title = "Mesh"
    about = "Divide the segments of the image, or a mask, into triangles for computations."
    verb = "mesh"
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "mesh",
        Choice(
            name="of",
            label="Mesh",
            default="segments",
            choices={"segments": "its segments", "picture": "mask or labels"},
        ),
        Number(name="k", label="Segments", default=3, low=1, high=255, slider=(2, 16), when={"of": ["segments"]}),
        Number(
            name="least",
            label="Least size",
            default=500,
            low=0,
            high=2**31 - 1,
            slider=(0, 5000),
            unit="px",
            when={"of": ["segments"]},
        ),
        Choice(name="by", label="Sizes by", default="n", choices={"n": "vertices", "edge": "edge length"}),
        ("n", {"when": {"by": ["n"]}, "always": False, "keyword": ""}),
        ("edge_length", {"when": {"by": ["edge"]}}),
        "grade",
        "min_size",
        "effort",
    )

    def outputs(self, request: Request) -> Sequence[Output]:
        """Return the formats of meshes."""
        return [Output(label, "-o", f"{{}}-mesh{suffix}", saved, SAVED) for suffix, label in _FILES.items()]

    def recipe(self, request: Request) -> Recipe:
        """Return the command and the lines of Python."""
        call = self._call(request)
        if request.settings["of"] == "picture":
            lines = f"import cvtimg\n\nlabels = cvtimg.labels.read_labels({quoted(request.picture.name)})"
            image = "labels > 0" if _is_mask(request) else "labels"
            return Recipe(self.words(request), f"{lines}\nresult = {call.text(image)}")
        name, settings = f"{request.picture.stem}-labels.png", request.settings
        least = ["--min-size", str(settings["least"])] if settings["least"] else []
        divide = ["cvtimg", "segment", *request.picture.words, "-k", str(settings["k"]), *least]
        words = ["cvtimg", self.verb, safe_name(name), *words_of(self.controls, settings)]
        lines = f"{reading(request.picture)}\nlabels = {_segments(settings).text()}.labels"
        return Recipe(
            words, f"{lines}\nresult = {call.text('labels')}", shlex.join([*divide, "-o", safe_name(name)]), False
        )

    def _call(self, request: Request) -> Call:
        keywords = self.keywords(request.settings)
        for name in {"n", "edge_length"} & self.in_effect(request.settings):
            if request.settings[name] != "auto":
                keywords[name] = request.settings[name]
        return Call("mesh_region" if _is_mask(request) else "mesh_labels", (), keywords)

    def exact(self, request: Request) -> Outcome:
        """Mesh the segments or the mask."""
        with part(0, _SEGMENTED):
            labels = self._labels(request)
        with part(_SEGMENTED, 1):
            result: Mesh = self._call(request).run(labels)
        each = measure_triangles(result.points, result.triangles)
        least, mean = float(each.least_angles.min()), float(each.qualities.mean())
        facts: dict[str, Any] = {"k": len(result.points), "noun": "vertices"}
        facts["about"] = f"{len(result.triangles)} triangles, least angle {least:.1f}°, mean quality {mean:.3f}"
        drawing = Drawing(_drawn(result, request.picture.size), over=True)
        return Outcome(result, drawing, facts, self.outputs(request), request.picture.stem)

    def _labels(self, request: Request) -> NDArray[Any]:
        if request.settings["of"] == "segments":
            return _segments(request.settings).run(request.picture.array).labels
        labels = _stored_labels(request.picture)
        return labels > 0 if _is_mask(request) else labels


def _stored_labels(picture: Picture) -> NDArray[np.int32]:
    if picture.page:
        raise UnfitRequestError("all pages of a mask are meshed together, as a volume, by the command line")
    return picture.kept("labels", lambda: read_labels(picture.path))


def _is_mask(request: Request) -> bool:
    """Whether the picture is a mask, black and one more value, as the command sees it."""
    if request.settings["of"] == "segments":
        return False
    values = np.unique(_stored_labels(request.picture))
    return len(values) <= 2 and bool(values[0] == 0)


def _segments(settings: Settings) -> Call:
    keywords = {"min_size": settings["least"]} if settings["least"] else {}
    return Call("segment", (settings["k"],), keywords)


def _drawn(mesh: Mesh, size: tuple[int, int]) -> bytes:
    """Draw the edges of all triangles, and those of borders bold."""
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
    ends = mesh.points[edges].reshape(-1, 4)
    rows = zip(*(numbers(ends[:, column], 2) for column in range(4)), strict=True)
    return "".join(f"M{a} {b}L{c} {d}" for a, b, c, d in rows)
