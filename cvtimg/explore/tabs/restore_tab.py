"""Restore: one picture from several noisy or incomplete versions of it."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from cvtimg._shared.choices import Json, Options
from cvtimg.explore.controls import Choice, Control, Files, Settings, Switch, UnfitRequestError, controls_of, words_of
from cvtimg.explore.layers import Layer, Pixels, Window
from cvtimg.explore.opened import Picture
from cvtimg.explore.outcomes import Code, Line, Outcome, Output, Recipe, call, evaluated, literal, safe_name
from cvtimg.explore.tabs.base import WRITE_IMAGE, Request, Tab
from cvtimg.pictures.files import image_suffixes
from cvtimg.restoration import Denoised, Restoration
from cvtimg.restoration.detail import passes_of

_FLAT = {"when": {"way": ["flat"]}}
_SIZES = "All of one size, unless they are aligned. Transparent pixels are missing."
_WAYS = {"auto": "what the image shows", "detail": "a photograph, with its detail", "flat": "flat colors"}
_DETAIL = "Photographs get their detail back; drawings in few colors stay flat."
_IMAGE = Code("result.with_alpha()")
_LABELS = Code('result.labels.astype("uint8" if len(result.colors) < 256 else "uint16")')


class RestoreTab(Tab):
    about = "Restore one image from several noisy or incomplete versions of it. Open or drop all versions."
    compared = Code("result.image")
    pace = 2.2
    most_drafted = 128  # height and width
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "restore",
        Files(name="versions", label="Versions", of="pictures", most=32, about=_SIZES),
        Choice(name="way", label="Restore", choices=_WAYS, about=_DETAIL),
        ("number", {"name": "k", "keyword": "", "default": 6, "auto": False, "always": True, **_FLAT}),
        ("align", {"keyword": ""}),
        ("motion", {"when": {"align": [True]}}),
        ("channels", _FLAT),
        "noise",
        *((name, {"when": {"way": ["auto", "detail"]}}) for name in ("noise_like", "luma", "chroma")),
        "hidden",
        ("renormalize", _FLAT),
        Switch(name="has_nodata", label="Missing value"),
        ("nodata", {"when": {"has_nodata": [True]}, "keyword": ""}),
        ("edge_weight", _FLAT),
        ("space", _FLAT),
        "effort",
    )

    def pasted(self, flag: str, text: str) -> Json:
        return {"way": "detail"} if flag == "--detail" else {}

    def outputs(self, request: Request) -> Sequence[Output]:
        scale = {"metadata": call("cvtimg.pictures.read_scale", Code("paths[0]"))}
        # Formats that hold the samples; AVIF loses a little.
        kinds = {np.uint8: (".png", ".webp", ".avif"), np.uint16: (".png",)}
        files = [
            Output(f"Restored image, {end[1:].upper()}", "-o", f"{{}}-restored{end}", WRITE_IMAGE, (_IMAGE,), scale)
            for end in kinds.get(request.picture.array.dtype.type, (".tif",))
            if end in image_suffixes()
        ]
        if request.settings["way"] != "flat":
            return files
        return [*files, Output("Segments, PNG", "--labels", "{}-labels.png", WRITE_IMAGE, (_LABELS,), scale)]

    def recipe(self, request: Request) -> Recipe:
        versions = _versions(request)
        files = dict.fromkeys(safe_name(picture.name) for picture in versions)
        which = (versions[0] if len(versions) == 1 else versions[0].whole_file or versions[0]).words[1:]
        words = ["cvtimg", self.verb, *files, *which, *["--detail"] * (request.settings["way"] == "detail")]
        words += words_of(self.controls, request.settings)
        return Recipe(words, self.lines(request), for_many=False, always=self.outputs(request)[0].pattern)

    def lines(self, request: Request) -> list[Line]:
        versions = _versions(request)
        files = Code(f"[{', '.join(literal(picture.name) for picture in versions)}]")
        read = f"[{', '.join(picture.python for picture in versions)}]"
        return [
            Line("paths", files, [picture.path for picture in versions]),
            Line("images", Code(read), [picture.array for picture in versions]),
            Line("result", self._call(request.settings, Code("paths"))),
        ]

    def _call(self, settings: Settings, *paths: Code) -> Code:
        """Return what restores segments or detail; where the picture decides, either."""
        keywords = self.keywords(settings)
        if settings["align"]:
            keywords["align"] = settings["motion"]
        if "nodata" in self.in_effect(settings):
            keywords["nodata"] = settings["nodata"]
        if settings["way"] != "auto":
            keywords["flat"] = settings["way"] == "flat"
        number = {"n_generators": settings["k"]} if settings["way"] == "flat" else {}
        return call("cvtimg.restoration.restore_versions", Code("images"), *paths, **number, **keywords)

    def draft(self, request: Request) -> Outcome | None:
        """Restore the middle of what is in sight with little effort: all of it takes long."""
        (left, top, right, bottom, _), settings = request.window, request.settings
        if min(right - left, bottom - top) <= (side := self.most_drafted):
            return None
        x, y = (left + right - side) // 2, (top + bottom - side) // 2
        part = Window(x, y, x + side, y + side, 1)
        versions = [part.of_array(version.array) for version in _versions(request)]
        if any(version.shape[:2] != versions[0].shape[:2] for version in versions):
            return None
        result: Denoised = evaluated(self._call({**settings, "effort": "fast"}), {"images": versions})
        return Outcome(_layer(request, result), _kinds(result), {"result": result}, drawn=part)

    def work(self, request: Request, outcome: Outcome | None) -> float:
        """Return megapixels of all versions, and of all passes; segments take about as long as one."""
        result: Any = outcome.values["result"] if outcome else None
        n_passes = 1
        if not isinstance(result, Restoration):
            # The part of a draft may be clean and others not.
            is_clean = outcome is not None and outcome.drawn is None and not result.noisy
            n_passes = 0 if is_clean else len(passes_of(request.settings["effort"], math.prod(request.size)))
        return Tab.work(self, request, outcome) * (len(_versions(request)) + n_passes)

    def exact(self, request: Request) -> Outcome:
        """Restore the picture; files have the name of the first version."""
        return replace(Tab.exact(self, request), stem=_versions(request)[0].stem)

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        result: Denoised = values["result"]
        return _layer(request, result), {**_kinds(result), "about": _told(result)}


def _versions(request: Request) -> list[Picture]:
    shown = request.picture  # of an animation the frame, and of several channels what is chosen
    chosen = [request.store.picture(key).choosing(shown.chosen) for key in request.settings["versions"]]
    if request.settings["align"]:
        chosen.sort(key=lambda version: version.key != (shown.whole_file or shown).key)  # the others are moved onto it
    versions = [part for version in chosen or [shown] for part in _of_file(version, shown)]
    if len(versions) > 1 and any(version.page and not (version.whole_file or version).is_stack for version in versions):
        raise UnfitRequestError("pages along a named axis are restored one by one: choose no other version")
    if any(version.chosen != shown.chosen for version in versions):
        raise UnfitRequestError("Versions must have the same channels")
    sizes = {picture.size for picture in versions}
    if len(sizes) > 1 and not (request.settings["align"] and versions[0].size == shown.size):
        listed = ", ".join(f"{picture.name} {picture.size[1]} x {picture.size[0]}" for picture in versions)
        raise UnfitRequestError(f"Versions must be of one size, or be aligned with the image that is shown: {listed}")
    return versions


def _kinds(result: Denoised) -> Json:
    if isinstance(result, Restoration):
        return {"k": len(result.colors), "noun": "segments"}
    n_versions = len(result.weights)
    return {"k": n_versions, "noun": "version" if n_versions == 1 else "versions"}


def _told(result: Denoised) -> str:
    noise = ", ".join(f"{value:.3g}" for value in result.noise)
    near = result.noise_neighbors
    kind = f", shared by neighbors (correlation {near:.2f})" if result.noise_shared is not None else ", white"
    kind += ", changing with the level" if result.noise_lines is not None else ""
    said = [f"Noise of {noise} levels{'' if isinstance(result, Restoration) else kind}"]
    if len(result.weights) > 1:
        said += ["weights " + ", ".join(f"{value:.2f}" for value in result.weights)]
    pixels = np.hypot(*result.shifts.T).tolist()
    moved = [f"{model} {by:.1f} px" for model, by in zip(result.models, pixels, strict=True)]
    said += ["moved by " + ", ".join(moved[1:])] if result.shifts.any() else []
    unknown = (result.coverage == 0).mean()
    return "; ".join([*said, *([f"{unknown:.1%} known in no version"] if unknown else [])]) + "."


def _of_file(picture: Picture, shown: Picture) -> list[Picture]:
    """Return the versions that a file has: the frame that is shown, or all pages where nothing says what they are."""
    whole = picture.whole_file or picture
    if whole.is_stack:
        return [whole.frame(number) for number in range(whole.header.frames)]
    return [shown if shown.whole_file and shown.whole_file.key == whole.key else picture.frame(0)]


def _layer(request: Request, result: Denoised) -> Pixels:
    rows = result.image.reshape(result.coverage.size, -1)
    seen = request.picture.colors_seen(rows, alpha=rows.shape[1] in (2, 4) and request.picture.header.has_alpha)
    return Pixels(seen.reshape(*result.coverage.shape, 4))
