"""Charts of meshes: triangles colored by their quality, over an image."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.plotting.charts import add_polygons, chart, figure_file, figure_height, show_box

#: The quality from which the color map begins; few triangles are worse.
POOR = 0.6


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
    image : (H, W) or (H, W, 3) uint8 array, optional
        Shown below the mesh, which then is transparent; coordinates are in its pixels.
    y_down : bool
        Whether y points down, as in images.
    """
    from matplotlib.collections import LineCollection

    low, high = points.min(axis=0), points.max(axis=0)
    with figure_file(9.0, figure_height(low, high, 7.6), suffix) as (figure, content):
        axes = figure.subplots()
        if image is not None:
            axes.imshow(image, extent=(0, image.shape[1], image.shape[0], 0), cmap="gray", vmin=0, vmax=255)
        alpha = 0.45 if image is not None else 1.0
        look: Any = {"array": qualities, "cmap": "viridis", "clim": (POOR, 1.0), "edgecolors": "0.15", "alpha": alpha}
        drawn = add_polygons(figure, axes, list(points[triangles]), **look)
        axes.add_collection(LineCollection(list(points[edges]), colors="black", linewidths=1.2))
        show_box(axes, low, high, y_down=y_down)
        figure.colorbar(drawn, ax=axes, label="quality 2 r / R", shrink=0.6)
    return content.getvalue()
