"""Print a hash of one result of each verb, as JSON; the keys are the rows of the table in docs/reproducibility.md.

Run it elsewhere, for example by ``.ci/arm64 run FOLDER tests/reproducible.py``, and compare.
"""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import cvtimg

PICTURE = cvtimg.read_image(Path(__file__).parents[1] / "sample_images/astronaut.png")
SMALL = np.ascontiguousarray(PICTURE[:90, 180:280])
GRAY = np.ascontiguousarray(PICTURE[::3, ::3, 1])
LABELS = cvtimg.segment(GRAY, 3).labels
ROWS = np.concatenate([np.random.default_rng(0).normal(5 * c, 1, (8000, 4)) for c in range(5)])
SQUARE = [[0, 0], [3, 0], [3, 2], [0, 2]]
POINTS = np.random.default_rng(1).random((30, 2))

RESULTS: dict[str, Callable[[], Any]] = {
    "quantize": lambda: cvtimg.quantize(PICTURE, 32).image,
    'quantize(dither="floyd-steinberg")': lambda: cvtimg.quantize(SMALL, 16, dither="floyd-steinberg").image,
    'quantize(space="oklab")': lambda: cvtimg.quantize(SMALL, 16, space="oklab").image,
    'quantize(goal="eyes")': lambda: cvtimg.quantize(SMALL, 32, goal="eyes").image,
    "find_palette": lambda: cvtimg.find_palette(PICTURE.reshape(-1, 3), 16).colors,
    "tessellate, CVT": lambda: cvtimg.tessellate(ROWS, 9).generators,
    "energy_curve": lambda: cvtimg.energy_curve(SMALL, 12).energies,
    "segment": lambda: cvtimg.segment(PICTURE, 8).labels,
    'segment(edge_weight="auto")': lambda: cvtimg.segment(SMALL, 8, edge_weight="auto").labels,
    "superpixels": lambda: cvtimg.superpixels(PICTURE, 200).labels,
    "segment_hierarchy": lambda: cvtimg.segment_hierarchy(SMALL, n_leaves=200).cut(20),
    "find_edges, find_contours": lambda: [cvtimg.find_edges(LABELS), str(cvtimg.find_contours(LABELS, GRAY)).encode()],
    "restore": lambda: cvtimg.restore([SMALL], 8, effort="fast").image,
    "stipple": lambda: cvtimg.stipple(GRAY, 500).points,
    "mosaic": lambda: cvtimg.mosaic(SMALL, 100).image,
    "place_generators": lambda: cvtimg.place_generators(SQUARE, 40).points,
    "design": lambda: cvtimg.design(20, 3).points,
    "latinize": lambda: cvtimg.latinize(POINTS),
    "support_radii": lambda: cvtimg.support_radii(POINTS, SQUARE).radii,
    "mesh_region": lambda: cvtimg.mesh_region(SQUARE, n=60).points,
    "sphere_grid": lambda: cvtimg.sphere_grid(162).points,
    "reduced_basis": lambda: cvtimg.reduced_basis(ROWS[:3000].reshape(30, -1), 4).modes,
}


def hashed(result: Any) -> str:
    """Return the hash of an array, of bytes, or of several of them."""
    digest = hashlib.sha256()
    for part in result if isinstance(result, list) else [result]:
        digest.update(part if isinstance(part, bytes) else np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()


if __name__ == "__main__":
    print(json.dumps({name: hashed(result()) for name, result in RESULTS.items()}, indent=1))
