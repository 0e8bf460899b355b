"""The layout is the architecture: a module imports only modules to its left."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import cvtimg

PACKAGE = Path(cvtimg.__file__).parent

#: From left to right; modules of one group do not import each other.
LAYERS: list[set[str]] = [
    {"_kernels", "_cracks", "_dither", "_label_kernels", "_checks", "_threads", "files", "profiles"},
    # samples of colors
    {"samples", "points", "columns", "color"},
    {"places"},
    # files and pictures
    {"images"},
    {"images.opening"},
    {"images.arrays"},
    {"images.png", "images.tiff"},
    {"images.metadata"},
    {"images.decoding", "images.encoding"},
    {"images.header", "images.animated"},
    {"io", "frames", "palettes"},
    {"palettes.swatches"},
    {f"palettes.{name}" for name in ("act", "ase", "css", "gpl", "hexlist", "jsonlist", "picture")},
    {"palette"},
    # the engine
    {"tables"},
    {"seeding"},
    {"methods._iteration"},
    {"methods.lloyd", "methods.breathing", "methods.transfer", "methods.probabilistic", "methods.optimal1d"},
    {"methods.macqueen"},
    {"methods"},
    {"search", "elbow_rules"},
    {"chain"},
    {"cvt"},
    {"elbow"},
    {"estimator", "elbow_plot"},
    # few colors
    {"targets", "dithering"},
    {"counting", "tiles", "remapping"},
    {"palette_search"},
    {"quantization"},
    {"animation", "sharing", "tiled_quantization"},
    {"blocks"},
    # segments
    {"edge_weight", "noise", "levels", "components", "averaging"},
    {"values", "disk_rows"},
    {"disk_values"},
    {"segment_energies"},
    {"segmentation"},
    {"grid_cells", "tiled_segmentation"},
    {"edges", "regions", "cracks", "simplification"},
    {"contours"},
    {"segment_files"},
    # several versions
    {"versions"},
    {"alignment"},
    {"masked", "patches", "renormalization"},
    {"restoration"},
    {"plot"},
    # the command line
    {"batch.tasks"},
    {"batch.report", "batch.workers"},
    {"batch.progress", "batch.on_dask"},
    {"batch.runner"},
    {"batch"},
    {"commands"},
    {"commands._options", "commands._animations", "commands._segment_files"},
    {"commands._batch_options", "commands._sharing", "commands._tiled"},
    {f"commands.{name}" for name in ("cluster", "elbow", "info", "palette", "quantize", "restore", "segment")},
    {"cli"},
]
RANK = {name: rank for rank, layer in enumerate(LAYERS) for name in layer}
MODULES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__"): path
    for path in PACKAGE.rglob("*.py")
    if path != PACKAGE / "__init__.py"
}


def imported(path: Path) -> set[str]:
    """Return the modules of cvtimg that a file imports, at its top or in a function."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module == "cvtimg":
            found |= {alias.name for alias in node.names if alias.name in RANK}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("cvtimg."):
            module = (node.module or "").removeprefix("cvtimg.")
            found |= {f"{module}.{name.name}" if f"{module}.{name.name}" in RANK else module for name in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name.removeprefix("cvtimg.") for alias in node.names if alias.name.startswith("cvtimg.")}
    return found


@pytest.mark.parametrize("name", sorted(MODULES))
def test_a_module_imports_only_to_its_left(name: str) -> None:
    for other in imported(MODULES[name]):
        assert RANK[other] < RANK[name], f"{name} imports {other}"


@pytest.mark.parametrize("name", sorted(MODULES))
def test_no_module_is_too_long(name: str) -> None:
    assert len(MODULES[name].read_text().splitlines()) <= 440
