"""Outlines of segments, filled with their mean colors, as drawings for files."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg.labels.contours import Contours
from cvtimg.labels.figures import region_means
from cvtimg.labels.formats import Drawing
from cvtimg.plotting.sheets import shown_colors


def contour_drawing(contours: Contours, labels: ArrayLike, image: Any) -> Drawing:
    """Draw the contours of segments, each filled with its mean color.

    Parameters
    ----------
    contours : Contours
        From `cvtimg.find_contours`.
    labels : (H, W) integer array
        The segments; 0 is left out.
    image : (H, W) or (H, W, C) array
        The segmented image.

    Returns
    -------
    Drawing
        For `cvtimg.labels.write_contours`; each polygon with the area and the mean of its segment.

    Examples
    --------
    >>> from cvtimg import find_contours
    >>> from cvtimg.plotting import contour_drawing
    >>> labels = np.array([[1, 1, 2]])
    >>> drawing = contour_drawing(find_contours(labels), labels, np.array([[10, 20, 200]], np.uint8))
    >>> len(drawing.polygons), drawing.properties[1]["area"]
    (2, 2)
    """
    segments = np.asarray(labels)
    means = np.nan_to_num(region_means(segments, image))
    areas = np.bincount(segments.ravel()).tolist()
    bands = np.asarray(image)
    seen = bands[..., :3] if bands.shape[2:] == (4,) else bands
    return Drawing(
        polygons=contours.polygons,
        size=(segments.shape[0], segments.shape[1]),
        colors=shown_colors(means[:, :3], seen, segments, ignore=0),
        properties={
            label: {"area": area, "mean": mean}
            for label, (area, mean) in enumerate(zip(areas, means.tolist(), strict=True))
        },
    )
