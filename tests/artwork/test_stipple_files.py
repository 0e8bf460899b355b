import csv
import io
import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from reference import shoelace

from cvtimg import read_image, stipple
from cvtimg.artwork.stipples import MARKS, PAPERS

RAMP = np.tile(np.linspace(0, 255, 80).astype(np.uint8), (40, 1))
STIPPLES = stipple(RAMP, 150, dots="sized")
SVG = "{http://www.w3.org/2000/svg}"


def places_in(path: Path) -> np.ndarray:
    root = ElementTree.parse(path).getroot()
    circles = [(float(node.get("cx", "")), float(node.get("cy", ""))) for node in root.iter(f"{SVG}circle")]
    # Lines and loops begin at their left end.
    half = 0.05 * float(root[0].get("stroke-width", "0"))
    if len(lines := [node.get("d", "")[1:].split() for node in root.iter(f"{SVG}path")]) == 1:
        return np.array(lines[0], float).reshape(-1, 2)
    starts = [re.split("[hl]", node.get("d", "")[1:])[0].split() for node in root.iter(f"{SVG}path")]
    return np.array(circles or [(float(x) + half, float(y)) for x, y in starts])


@pytest.mark.parametrize("marks", MARKS)
def test_a_drawing_has_each_dot_in_millimeters_in_the_order_of_the_tour(tmp_path: Path, marks: str) -> None:
    path = tmp_path / "a.svg"
    STIPPLES.save(path, width=160, marks=marks)
    root = ElementTree.parse(path).getroot()
    assert (root.get("width"), root.get("height"), root.get("viewBox")) == ("160mm", "80mm", "0 0 160 80")
    assert np.allclose(places_in(path), 2 * STIPPLES.points[STIPPLES.order], atol=6e-4)


@pytest.mark.parametrize(
    ("fitted", "size", "corner", "scale"),
    [
        ({"paper": "a4"}, (210, 297), (10, 101), 190 / 80),
        ({"paper": "A4", "landscape": True, "margin": 5}, (297, 210), (5, 33.25), 287 / 80),
        ({"paper": (300, 100), "height": 60, "margin": 0}, (300, 100), (90, 20), 1.5),
        ({"height": 20}, (40, 20), (0, 0), 0.5),
        ({"width": 80, "margin": 3}, (86, 46), (3, 3), 1),
        ({}, (200, 100), (0, 0), 2.5),
    ],
)
def test_a_drawing_lies_in_the_middle_of_its_sheet(
    tmp_path: Path, fitted: dict[str, Any], size: tuple[float, float], corner: tuple[float, float], scale: float
) -> None:
    path = tmp_path / "a.svg"
    STIPPLES.save(path, **fitted)
    root = ElementTree.parse(path).getroot()
    assert (root.get("width"), root.get("height")) == (f"{size[0]}mm", f"{size[1]}mm")
    assert np.allclose(places_in(path), scale * STIPPLES.points[STIPPLES.order] + corner, atol=6e-4)
    STIPPLES.save(tmp_path / "a.png", scale=3, **fitted)
    with Image.open(tmp_path / "a.png") as image:
        assert image.width / image.height == pytest.approx(size[0] / size[1], rel=0.02)
        assert image.width / image.info["dpi"][0] * 25.4 == pytest.approx(size[0], rel=0.02)


def test_sheets_are_halves_of_the_next_larger_or_of_half_inches() -> None:
    halves = [PAPERS[f"a{n}"] for n in range(2, 7)]
    assert halves == [(420, 594), *((height // 2, width) for width, height in halves[:-1])]
    inches = np.array([PAPERS[name] for name in ("letter", "legal", "tabloid")]) / 25.4
    np.testing.assert_allclose(inches, [[8.5, 11], [8.5, 14], [11, 17]])


def test_spirals_fill_disks_by_the_line_of_the_pen_and_stay_in_them(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    STIPPLES.save(path, width=800, fill="spiral", pen_width=0.5)
    points, radii = 10 * STIPPLES.points[STIPPLES.order], 10 * STIPPLES.radii[STIPPLES.order]
    gaps = np.hypot(*np.diff(points, axis=0, append=points[-1:]).T)
    for node, point, radius, gap, after in zip(
        ElementTree.parse(path).getroot()[0], points, radii, gaps, [*points[1:], points[-1]], strict=True
    ):
        turns = np.array(node.get("d", "")[1:].split(), float).reshape(-1, 2) - point
        reach = np.hypot(*turns.T)
        assert reach.max() == pytest.approx(radius - 0.25, abs=2e-3)
        assert np.hypot(*np.diff(turns, axis=0).T).sum() * 0.5 == pytest.approx(np.pi * radius**2, rel=0.25)
        off = np.square(turns[-1] - turns[-2]).sum() / (8 * reach[-1])  # a straight step, from its arc
        assert 0.013 < off < 0.021
        to_next = np.hypot(*(point + turns[-1] - after))  # it ends on the side of the next
        assert to_next == pytest.approx(abs(gap - reach[-1]), abs=5e-3)


def test_lines_are_three_tenths_of_a_millimeter_wide_and_those_of_cells_one(tmp_path: Path) -> None:
    STIPPLES.save(tmp_path / "a.svg", marks="circles")
    STIPPLES.save_cells(tmp_path / "b.svg")
    layers = [ElementTree.parse(tmp_path / name).getroot()[0] for name in ("a.svg", "b.svg")]
    assert [layer.get("stroke-width") for layer in layers] == ["0.3", "0.1"]


def test_the_frame_cuts_dots_that_may_bleed_only() -> None:
    bleeding = stipple(RAMP, 150, dots="sized", bleed=True)
    for result, is_cut in ((STIPPLES, False), (bleeding, True)):
        beyond = result.radii[:, None] - np.minimum(result.points, result.size[::-1] - result.points)
        assert (beyond > 1e-6).any() == is_cut
    edges = np.r_[bleeding.points[:, 1].min(), bleeding.size[0] - bleeding.points[:, 1].max()]
    assert (edges > 0).all()


def test_disks_have_the_radii_of_dots_and_points_the_width_of_the_pen(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    STIPPLES.save(path, width=80)
    radii = [float(node.get("r", "")) for node in ElementTree.parse(path).getroot().iter(f"{SVG}circle")]
    assert np.allclose(radii, STIPPLES.radii[STIPPLES.order], atol=1e-4)
    STIPPLES.save(path, marks="points", pen_width=0.5, overwrite=True)
    group = ElementTree.parse(path).getroot()[0]
    assert group.get("stroke-width") == "0.5"
    assert {node.get("d", "").split("l")[1] for node in group} == {"0.025-0.025 0.025 0.025-0.025 0.025z"}


def test_points_that_a_pen_dots_cover_as_much_as_disks_without_holes(tmp_path: Path) -> None:
    resvg = pytest.importorskip("resvg_py")
    dots = stipple(RAMP, 150)  # of one size

    def ink(kind: str) -> np.ndarray:
        dots.save(tmp_path / f"{kind}.svg", marks=kind, width=80)
        path = str(tmp_path / f"{kind}.svg")
        found = resvg.svg_to_bytes(svg_path=path, width=1600, dpi=96, background="#ffffff")
        with Image.open(io.BytesIO(bytes(found))) as image:
            return np.asarray(image.convert("L")) < 128

    disks, marked = ink("disks"), ink("points")
    assert marked.mean() == pytest.approx(disks.mean(), rel=0.03)
    x, y = (dots.points * 20).astype(int).T
    assert marked[y, x].all()


def test_tables_hold_the_dots(tmp_path: Path) -> None:
    order = STIPPLES.order
    STIPPLES.save(tmp_path / "a.csv")
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert np.array_equal([[float(row["x"]), float(row["y"])] for row in rows], STIPPLES.points[order])
    assert np.array_equal([float(row["mass"]) for row in rows], STIPPLES.masses[order])


def test_pixels_and_cells(tmp_path: Path) -> None:
    STIPPLES.save(tmp_path / "a.png", scale=3)
    assert np.array_equal(read_image(tmp_path / "a.png"), STIPPLES.draw(scale=3))
    assert STIPPLES.default_scale() * np.sqrt(RAMP.size / 150) == pytest.approx(8)  # pixels between dots
    STIPPLES.save_cells(tmp_path / "a.geojson")
    features = json.loads((tmp_path / "a.geojson").read_text())["features"]
    assert len(features) == 150
    assert sum(shoelace(cell) for cell in STIPPLES.cells()) == pytest.approx(RAMP.size)
    STIPPLES.save_cells(tmp_path / "a.svg")
    assert len(list(ElementTree.parse(tmp_path / "a.svg").getroot().iter(f"{SVG}path"))) == 150


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"marks": "stars"}, "marks='stars' must be one of disks"),
        ({"width": 0}, "width=0 must be a finite number > 0"),
        ({"pen_width": -1}, "pen_width=-1 must be"),
        ({"paper": "a9"}, "paper='a9' must be one of"),
        ({"paper": "a6", "margin": 60}, "margin=60 must leave room on 105 x 148 mm"),
        ({"landscape": True}, "landscape must have a paper"),
    ],
)
def test_wrong_options_write_nothing(tmp_path: Path, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        STIPPLES.save(tmp_path / "a.svg", **options)
    assert not list(tmp_path.iterdir())
