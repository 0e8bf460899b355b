"""Commands go a short way to the engine, and `cvtimg quantize in.png` reads, checks and counts its input once."""

import importlib
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

from cvtimg import write_image
from cvtimg.cli.app import main


def counted(monkeypatch: pytest.MonkeyPatch, counts: Counter[str], module: str, name: str) -> None:
    """Count the calls of a function under all names by which modules of the package have imported it."""
    function: Callable[..., Any] = getattr(importlib.import_module(module), name)

    def call(*given: Any, **options: Any) -> Any:
        counts[name] += 1
        return function(*given, **options)

    for path, loaded in list(sys.modules.items()):
        if path.startswith("cvtimg.") and vars(loaded).get(name) is function:
            monkeypatch.setattr(loaded, name, call)


def test_quantize_does_each_step_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_image(tmp_path / "in.png", np.random.default_rng(0).integers(0, 256, (40, 50, 3), np.uint8))
    arguments = ["quantize", str(tmp_path / "in.png"), "-k", "8", "--quiet", "-o"]
    assert main([*arguments, str(tmp_path / "first.png")]) == 0  # imports what it needs
    counts: Counter[str] = Counter()
    counted(monkeypatch, counts, "cvtimg.pictures.formats.opening", "open_picture")
    counted(monkeypatch, counts, "cvtimg.pictures.formats.decoding", "decode")
    counted(monkeypatch, counts, "cvtimg._shared.checks", "check_pixels")
    counted(monkeypatch, counts, "cvtimg.colors.samples", "color_samples")
    counted(monkeypatch, counts, "cvtimg.engine.points", "pack")
    assert main([*arguments, str(tmp_path / "second.png")]) == 0
    once = {"decode": 1, "check_pixels": 1, "color_samples": 1}
    # The header is read before the pixels, to plan. Colors are packed for the search and, in their own order, to map.
    assert counts == {**once, "open_picture": 2, "pack": 2}


@pytest.mark.parametrize("verb", ["quantize", "segment"])
def test_the_engine_is_eight_stations_from_the_command_line(tmp_path: Path, verb: str) -> None:
    write_image(tmp_path / "in.png", np.random.default_rng(0).integers(0, 256, (20, 30, 3), np.uint8))
    stations: list[str] = []

    def look(frame: FrameType | None, event: str, _: object) -> None:
        if event == "call" and frame and frame.f_code.co_name == "tessellate" and not stations:
            while frame:
                name = frame.f_globals.get("__name__", "")
                stations.extend([f"{name}.{frame.f_code.co_name}"] if name.startswith("cvtimg.") else [])
                frame = frame.f_back

    sys.setprofile(look)
    try:
        assert main([verb, str(tmp_path / "in.png"), "-k", "4", "--quiet", "-o", str(tmp_path / "out.png")]) == 0
    finally:
        sys.setprofile(None)
    assert stations[0] == "cvtimg.engine.tessellation.tessellate"
    assert len(stations) <= 8, stations[::-1]
