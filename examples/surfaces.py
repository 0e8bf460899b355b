"""Points on surfaces by density: 256 on a torus and on a rolled sheet, and evenly spaced ones on a body.

The densities are those of M. Gunzburger's lecture "Centroidal Voronoi Tessellations": exp(-5 |y|) on the torus and
exp(-20 x^2) on the sheet, a surface that can be unrolled. The body is where a sum of Gaussians is constant.

    python examples/surfaces.py [OUT.png]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from drawing import INK, panels, save
from matplotlib.collections import PolyCollection
from numpy.typing import NDArray

from cvtimg import surface_points
from cvtimg.surfaces import ImplicitSurface, SurfaceMeasures, SurfacePoints, torus

Points = NDArray[np.float64]
N = 256
#: Centers and widths of the Gaussians: trunk, head, ears, tail and feet.
BODY = np.array([
    [0, 0, 0, 0.55], [0.75, 0, 0.55, 0.36], [0.78, 0.22, 1.15, 0.17], [0.78, -0.22, 1.15, 0.17],
    [-0.85, 0, -0.05, 0.25], [0.45, 0.4, -0.5, 0.22], [0.45, -0.4, -0.5, 0.22], [-0.45, 0.42, -0.5, 0.24],
    [-0.45, -0.42, -0.5, 0.24], [0.76, 0.2, 0.9, 0.15], [0.76, -0.2, 0.9, 0.15],
])  # fmt: skip


def body(places: Points) -> Points:
    """Return a function that is negative inside of the body."""
    squares = ((places[:, None] - BODY[:, :3]) ** 2).sum(axis=2)
    return np.asarray(0.5 - np.exp(-squares / BODY[:, 3] ** 2).sum(axis=1))


def seen_from(longitude: float, latitude: float) -> Points:
    """Return rows to the right, up and to the viewer."""
    x, y = np.radians([longitude, latitude])
    right = np.array([-np.sin(x), np.cos(x), 0])
    viewer = np.array([np.cos(y) * np.cos(x), np.cos(y) * np.sin(x), np.sin(y)])
    return np.stack([right, np.cross(viewer, right), viewer])


def main(path: Path, n_body: int = 2000) -> dict[str, SurfaceMeasures]:
    """Place the points, draw their triangles, and return how good these are."""
    sheet = ImplicitSurface(lambda p: p[:, 2] - 0.35 * np.sin(3 * p[:, 0]), [-1, -1, -0.5], [1, 1, 0.5])
    animal = ImplicitSurface(body, [-1.4, -1, -1.1], [1.4, 1, 1.5])
    found: dict[str, tuple[SurfacePoints, Points]] = {
        "Torus, exp(-5 |y|)": (
            surface_points(torus(), N, density=lambda p: np.exp(-5 * np.abs(p[:, 1]))),
            seen_from(-65, 50),
        ),
        "Sheet, exp(-20 x²)": (
            surface_points(sheet, N, density=lambda p: np.exp(-20 * p[:, 0] ** 2)),
            seen_from(-100, 28),
        ),
        f"Body, {n_body} points": (surface_points(animal, n_body), seen_from(-55, 20)),
    }
    figure, axes = panels(list(found))
    for each, (points, view) in zip(axes, found.values(), strict=True):
        places = (points.points @ view.T)[points.triangles]
        normals = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        light = 0.55 + 0.45 * np.abs(normals @ [-0.35, 0.45, 0.82])
        order = np.argsort(places[:, :, 2].mean(axis=1))
        colors = light[order, None] * np.array([0.98, 0.86, 0.62])
        each.add_collection(
            PolyCollection(list(places[order][:, :, :2]), facecolors=colors, edgecolors=INK, linewidths=0.4)
        )
        each.autoscale_view()
    save(figure, path)
    return {name: points.measures() for name, (points, _) in found.items()}


if __name__ == "__main__":
    for name, measures in main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/surfaces.png")).items():
        print(f"{name}: least angle {measures.least_angle:.1f}, Euler characteristic {measures.euler_characteristic}")
