import io
import re

import numpy as np
import pytest
from PIL import Image

from cvtimg import sphere_grid, surface_points
from cvtimg._shared.types import Bytes
from cvtimg.meshes import measure_triangles
from cvtimg.plotting import draw_globe, draw_map, draw_surface
from cvtimg.sphere import SphereGrid, cell_polygons
from cvtimg.surfaces import torus


@pytest.fixture(scope="module")
def grid() -> SphereGrid:
    return sphere_grid(162)


def pixels(content: bytes) -> Bytes:
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))


def n_outlines(content: bytes) -> int:
    """Count the outlines of the first collection of polygons in an SVG file."""
    text = content.decode()
    drawn = text[text.index('id="PolyCollection_1"') :]
    return drawn[: drawn.index("</g>")].count("<path ")


@pytest.mark.slow
@pytest.mark.parametrize("center", [(120, -40), (10, 90)])
def test_a_globe_shows_the_cells_that_face_the_viewer(grid: SphereGrid, center: tuple[float, float]) -> None:
    lon, lat = np.radians(center)
    viewer = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    cells = list(grid.cells())
    seen = sum((cell @ viewer > 0).all() for cell in cells)
    assert n_outlines(draw_globe(cells, grid.areas, ".svg", center=center)) == seen


@pytest.mark.slow
def test_a_map_shows_every_cell(grid: SphereGrid) -> None:
    cells = grid.cells()
    rings = list(cell_polygons(cells.vertices, cells.corners, cells.offsets))
    content = draw_map(rings, grid.areas, ".svg", label="area")
    assert n_outlines(content) == sum(map(len, rings)) > len(rings)
    assert b"area" in content
    coast = [np.array([[-90.0, -45.0], [90.0, 45.0]])]
    assert (pixels(draw_map(rings, grid.areas, ".png", lines=coast)) < 20).sum() > 500


@pytest.mark.slow
def test_surfaces_are_drawn_in_the_colors_of_their_qualities() -> None:
    found = surface_points(torus(), 300)
    qualities = measure_triangles(found.points, found.triangles).qualities
    content = draw_surface(found.points, found.triangles, qualities, ".svg", center=(0, 90))
    fills = re.findall(r"fill: #([0-9a-f]{6})", content.decode())
    assert len(fills) >= 600
    assert len(set(fills)) > 20
    assert pixels(draw_surface(found.points, found.triangles, qualities, ".png")).std() > 20
