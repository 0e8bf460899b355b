"""The examples run, and come to what they say."""

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

pytestmark = pytest.mark.slow
EXAMPLES = Path(__file__).parent.parent / "examples"


@pytest.fixture
def example(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Return a function that imports an example by its name."""
    monkeypatch.syspath_prepend(str(EXAMPLES))

    def load(name: str) -> Any:
        spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, spec.name, module)  # where dataclasses look
        spec.loader.exec_module(module)
        return module

    yield load
    for shared in ("drawing", "finite_elements"):
        sys.modules.pop(shared, None)
    figures = [*tmp_path.rglob("*.png")]
    assert figures
    for figure in figures:
        Image.open(figure).verify()


def test_people_walk_less_to_mailboxes_by_where_they_live(example: Any, tmp_path: Path) -> None:
    ways = example("mailboxes").main(tmp_path / "m.png")
    assert ways["By where people live"] < 0.9 * ways["Evenly spread"]


def test_cells_double_at_each_division(example: Any, tmp_path: Path) -> None:
    assert example("cell_division").main(tmp_path / "c.png") == [1, 2, 4, 8, 16, 32]


def test_territories_are_more_regular_where_fish_settle_together(example: Any, tmp_path: Path) -> None:
    alone, _, together = example("territories").main(tmp_path / "t.png").values()
    assert together.area_ratio < 0.7 * alone.area_ratio


def test_residuals_lead_to_meshes_that_are_as_good_as_they_can_be(example: Any, tmp_path: Path) -> None:
    pytest.importorskip("skfem")
    for name, found in example("adaptive").main(["interfaces", "gear"], 1000, tmp_path).items():
        adaptive, uniform = (np.array(found[kind]) for kind in ("adaptive", "uniform"))
        assert adaptive[-1, 0] == uniform[-1, 0] == 1000
        assert (adaptive[-1, 1:] < 0.7 * uniform[-1, 1:]).all(), name
        slopes = [np.polyfit(*np.log(adaptive[2:, [0, column]].T), 1)[0] for column in (1, 2)]
        assert slopes[0] < -0.9, name
        assert slopes[1] < -0.45, name


def test_seas_are_meshed_from_a_picture(example: Any, tmp_path: Path) -> None:
    ocean = example("ocean")
    sea, brightness = ocean.sea_of(np.asarray(Image.open(ocean.EUROPE))[150:, 250:450])
    (mesh,) = ocean.main(sea, ocean.sizes_of(sea, brightness, ocean.BY_BRIGHTNESS), (3000,), tmp_path)
    assert len(mesh.points) == 3000
    assert mesh.area == pytest.approx(sea.sum(), rel=1e-5)
    assert mesh.qualities.mean() > 0.95


def test_anisotropic_meshes_resolve_a_boundary_layer(example: Any, tmp_path: Path) -> None:
    pytest.importorskip("skfem")
    tables = example("boundary_layer").main(tmp_path / "b.png", (25, 63, 170, 515))
    (n, l2, h1), (_, plain_l2, plain_h1), (bisected_n, _, bisected_h1) = (table[-1] for table in tables.values())
    assert (np.diff(tables["anisotropic"], axis=0)[:, 1:] < 0).all()
    assert n == 515
    assert l2 < 0.1 * plain_l2
    assert h1 < 0.2 * plain_h1
    assert 400 < bisected_n <= 515
    assert h1 < 0.6 * bisected_h1 < plain_h1


def test_errors_in_an_l_shape_fall_as_fast_as_they_can(example: Any, tmp_path: Path) -> None:
    pytest.importorskip("skfem")
    tables = example("l_shape").main(tmp_path / "l.png", (100, 200, 400, 800))
    rows = np.log(tables["adaptive"])
    assert all(
        tables["adaptive"][-1][column] < table[-1][column] for table in list(tables.values())[1:] for column in (1, 2)
    )
    assert np.polyfit(rows[:, 0], rows[:, 1], 1)[0] < -0.9
    assert np.polyfit(rows[:, 0], rows[:, 2], 1)[0] < -0.45


def test_points_on_surfaces_keep_their_shape(example: Any, tmp_path: Path) -> None:
    tube, sheet, body = example("surfaces").main(tmp_path / "s.png", n_body=600).values()
    assert (tube.euler_characteristic, sheet.euler_characteristic, body.euler_characteristic) == (0, 1, 2)
    assert min(tube.least_angle, body.least_angle) > 30
    assert sheet.least_angle > 25
    assert sheet.largest_angle < 120.5


def test_grids_of_the_globe_have_no_obtuse_triangles(example: Any, tmp_path: Path) -> None:
    grids = example("globe").main(tmp_path / "globe", n=2562)
    energies = [grids[name].energy for name in ("even", "equator", "pole")]
    assert energies == pytest.approx([0.0989, 0.0259, 0.0135], rel=0.05)
    assert [grids[name].measures().n_obtuse for name in ("regional", "nested", "lights")] == [0, 0, 0]
    assert len(grids["regional"].points) == pytest.approx(len(grids["nested"].points), rel=0.01)
    for name in ("regional", "nested"):
        near = np.hypot(grids[name].lat - 38, grids[name].lon + 96) < 10
        far = grids[name].lat < -40
        assert np.sqrt(grids[name].areas[far].mean() / grids[name].areas[near].mean()) == pytest.approx(3, rel=0.05)
    europe = (np.abs(grids["lights"].lat - 48) < 14) & (np.abs(grids["lights"].lon - 15) < 27)
    assert europe.mean() > 0.2  # of 4 % of the globe
    assert len(list((tmp_path / "globe").glob("*.nc"))) == len(grids)
