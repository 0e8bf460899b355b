"""Segments drawn over their image, and as polygons. Functions take arrays and return them; nothing is written."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from cvtimg._shared.checks import check_count, check_labeled_image, check_labels
from cvtimg._shared.types import Bytes, ImageLike
from cvtimg.labels.contours import Contours, find_edges
from cvtimg.labels.figures import region_means
from cvtimg.labels.formats import Drawing
from cvtimg.pictures.showing import limits_to_show, shown

#: Gray levels of a checkerboard, seen through what is transparent, and the side of its fields in pixels.
CHECKERS, _SIDE = (200, 232), 8
#: Width of edges in pixels, so that a slip of the pen does not fill the memory.
_WIDEST = 1 << 15


def draw_edges(
    image: ImageLike,
    labels: ArrayLike,
    *,
    color: Sequence[int] = (255, 255, 0),
    thickness: int = 1,
    ignore: int | None = None,
) -> Bytes:
    """Draw the edges of segments over the segmented image.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Of any integer or floating point type. One or two channels show the first as gray, three are RGB, four are
        RGB and alpha, of more the first three are shown. Pixels of label 0 may be NaN.
    labels : (H, W) integer array
        Segment of each pixel.
    color : sequence of three int
        RGB color of the edges, in 0..255.
    thickness : int
        Width of the edges in pixels. An odd one is centered on inner edges, an even one on the border.
    ignore : int, optional
        Label whose borders are not edges, as in `find_edges`.

    Returns
    -------
    (H, W, 3) uint8 array
        An image that is not 8-bit is stretched from black to white over the range of all but 0.1% of its values outside
        `ignore`.

    Examples
    --------
    >>> drawn = draw_edges(np.zeros((1, 4), np.uint8), np.array([[1, 1, 2, 2]]), color=(255, 0, 0))
    >>> drawn[0, :, 0].tolist()
    [0, 0, 255, 0]
    """
    from skimage.morphology import isotropic_dilation

    segments = check_labels("labels", labels)
    thickness = check_count("thickness", thickness, _WIDEST, "the longest side")
    values = check_labeled_image("image", image, segments)
    picture = Image.fromarray(shown(values, limits_to_show([values[segments != ignore]])))
    if picture.mode == "RGBA":
        row, column = np.ogrid[: picture.height, : picture.width]
        board = Image.fromarray(np.array(CHECKERS, np.uint8)[(row // _SIDE + column // _SIDE) % 2]).convert("RGBA")
        picture = Image.alpha_composite(board, picture).convert("RGB")
    drawn = np.array(picture)
    edges = find_edges(segments, mode="inner" if thickness % 2 else "thick", ignore=ignore)
    radius = (thickness - 1) // 2
    if radius and edges.any():
        edges = isotropic_dilation(edges, radius)  # type: ignore[no-untyped-call]
    drawn[edges] = color
    return drawn


def contour_drawing(contours: Contours, labels: ArrayLike, image: ImageLike) -> Drawing:
    """Draw the contours of segments, each filled with its mean color.

    Parameters
    ----------
    contours : Contours
        From `cvtimg.find_contours`.
    labels, image
        The segments, 0 left out, and the segmented image, as in `draw_edges`.

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
    rows = np.rint(means[:, :3]).astype(np.uint8) if bands.dtype == np.uint8 else means[:, :3]
    return Drawing(
        polygons=contours.polygons,
        size=(segments.shape[0], segments.shape[1]),
        colors=shown(rows, limits_to_show([seen[segments != 0]]))[:, :3],
        properties={label: {"area": areas[label], "mean": mean} for label, mean in enumerate(means.tolist())},
    )
