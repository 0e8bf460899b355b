"""Evidence that a border between leaves is one that people draw.

A tree tells how much regions differ, with one value for all of the border between two of them; people draw the part
that they see. Evidence is a product of powers of three views of a border, a sum of log odds: its altitudes near and
from afar, and its strength. It is less amid many other borders, which are texture, and at the margin of the image,
which is a frame.

C. Grigorescu, N. Petkov, M. Westenberg, IEEE Trans. Image Processing 12 (2003) 729-739, doi 10.1109/TIP.2003.814250:
a contour counts less for what surrounds it.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.types import Bools, Floats, Floats32, Ints
from cvtimg.labels.components import Borders
from cvtimg.segmentation.hierarchy.settings import SETTINGS


def evidence_of(borders: Borders, views: Sequence[Floats], inside: Bools) -> Floats:
    """(B,) evidence of borders; views, (B,) each, are the altitude, the strength, and the altitude from afar."""
    if not len(borders.pairs):
        return np.zeros(0)
    powers = zip(views, SETTINGS.view_powers, strict=True)
    seen = np.prod([np.maximum(view, SETTINGS.least_view) ** power for view, power in powers], axis=0)
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    box = inside[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]  # an image is what its mask leaves of it
    places = borders.places - np.array([rows[0], columns[0]])
    accuracy = SETTINGS.drawing_accuracy * np.hypot(*box.shape)
    inward = _mean(_inward(box, places, accuracy), borders)
    around = np.maximum(_mean(_around(places, views[1], borders, box.shape), borders), SETTINGS.least_surround)
    return seen * np.minimum(inward / accuracy, 1) / (around / SETTINGS.usual_surround) ** SETTINGS.inhibition


def chances_of(evidence: NDArray[np.floating]) -> Floats32:
    """Chances that people draw borders, by their evidence."""
    odds = (np.asarray(evidence, np.float64) / SETTINGS.half_drawn) ** SETTINGS.drawn_power
    return (odds / (1 + odds)).astype(np.float32)


def _inward(inside: Bools, places: Ints, accuracy: float) -> Floats:
    """(P,) distance of pixels from the margin; gaps in it that are smaller than people draw have none."""
    from scipy.ndimage import distance_transform_edt, label

    if not inside.all():
        gaps, _ = label(~inside)
        inside = inside | (np.bincount(gaps.ravel()) < np.pi * accuracy**2)[gaps]
    if inside.all():
        return np.asarray(np.minimum(places, np.array(inside.shape) - 1 - places).min(axis=1) + 0.5)
    distances: Floats = distance_transform_edt(np.pad(inside, 1))
    return distances[tuple(places.T + 1)] - 0.5


def _around(places: NDArray[np.integer], strengths: Floats, borders: Borders, shape: tuple[int, ...]) -> Floats:
    """(P,) mean strength of the borders around each crack."""
    from scipy.ndimage import gaussian_filter

    width = SETTINGS.surround * np.sqrt(shape[0] * shape[1])
    side = max(1, int(width / 6))  # of cells in which strengths are added up first, in pixels
    cells = places // side
    grid = cells.max(axis=0) + 1
    flat, size = np.ravel_multi_index(tuple(cells.T), grid), int(np.prod(grid))
    sums = [np.bincount(flat, np.repeat(strengths, borders.lengths), size), np.bincount(flat, np.ones(len(flat)), size)]
    total, length = (gaussian_filter(each.reshape(grid), width / side, mode="constant").ravel()[flat] for each in sums)
    return total / length


def _mean(values: Floats, borders: Borders) -> Floats:
    """(B,) means of what cracks, (P,), have."""
    return np.add.reduceat(values, borders.starts[:-1]) / borders.lengths
