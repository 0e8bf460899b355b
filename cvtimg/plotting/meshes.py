"""Charts of meshes: triangles colored by their quality, over an image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.plotting.charts import chart, figure_file

#: Width of the figure in inches, the part of it beside the mesh, and its least and greatest height.
_WIDTH, _BESIDE, _LEAST, _GREATEST = 9.0, 1.4, 3.0, 12.0
#: Qualities from the ends of the color map; few triangles are worse.
_POOR, _BEST = 0.6, 1.0
#: Thickness of edges in points, by the number of triangles.
_EDGE = 40.0


@chart
def draw_mesh(
    points: NDArray[np.float64],
    triangles: NDArray[np.int32],
    qualities: NDArray[np.float64],
    edges: NDArray[np.int32],
    suffix: str,
    *,
    image: NDArray[np.uint8] | None = None,
    y_down: bool = False,
) -> bytes:
    """Draw a mesh, its triangles colored by quality and its borders bold.

    Parameters
    ----------
    points, triangles, edges
        As in `cvtimg.meshes.Mesh`.
    qualities : (T,) array
        Of the triangles, from 0 to 1.
    suffix : {".png", ".svg"}
        Format of the file.
    image : (H, W) or (H, W, 3) uint8 array, optional
        Shown below the mesh, which then is transparent; coordinates are in its pixels.
    y_down : bool
        Whether y points down, as in images.
    """
    from matplotlib.collections import LineCollection, PolyCollection

    low, high = points.min(axis=0), points.max(axis=0)
    width, height = high - low
    inside = _WIDTH - _BESIDE
    with figure_file(_WIDTH, float(np.clip(inside * height / width, _LEAST, _GREATEST)), suffix) as (figure, content):
        axes = figure.subplots()
        thickness = min(_EDGE / len(triangles) ** 0.5, 0.6)
        if image is not None:
            axes.imshow(image, extent=(0, image.shape[1], image.shape[0], 0), cmap="gray", vmin=0, vmax=255)
        drawn = PolyCollection(
            list(points[triangles]),
            array=qualities,
            cmap="viridis",
            clim=(_POOR, _BEST),
            edgecolors="0.15",
            linewidths=thickness,
            alpha=0.45 if image is not None else 1.0,
            rasterized=len(triangles) > 20_000,
        )
        axes.add_collection(drawn)
        axes.add_collection(LineCollection(list(points[edges]), colors="black", linewidths=max(3 * thickness, 0.6)))
        axes.set_aspect("equal")
        margin = 0.01 * max(width, height)
        axes.set_xlim(low[0] - margin, high[0] + margin)
        ends = (low[1] - margin, high[1] + margin)
        axes.set_ylim(*(ends[::-1] if y_down else ends))
        figure.colorbar(drawn, ax=axes, label="quality 2 r / R", shrink=0.6)
    return content.getvalue()
