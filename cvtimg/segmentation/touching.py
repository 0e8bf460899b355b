"""Objects before a background: touching ones are split at their necks.

Where objects overlap in a segmentation, their union is one connected piece with a neck. The distance to the background
has a maximum in the middle of each object and a saddle at the neck; a watershed of the distance cuts there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_labels, check_non_negative

BACKGROUNDS = ("largest", "darkest", "brightest")
#: Blur of the distance, in pixels, that keeps ragged borders from making maxima of their own.
_BLUR = 1.0


@dataclass(frozen=True, slots=True)
class Objects:
    """How to find objects in a segmentation.

    Attributes
    ----------
    background : {"largest", "darkest", "brightest"}
        The segment that is the background; all others are objects.
    neck_depth : float
        Split a piece at a neck if the largest circles inside the parts on both sides exceed that in the neck by more
        than this in radius, in pixels. With infinity, pieces are not split.
    """

    background: str = "largest"
    neck_depth: float = 0.5

    def __post_init__(self) -> None:
        check_choice("background", self.background, BACKGROUNDS)
        if self.neck_depth != np.inf:
            check_non_negative("neck_depth", self.neck_depth)

    def found(self, labels: NDArray[np.int32], values: NDArray[np.float32]) -> NDArray[np.int32]:
        """Return labels of the objects from 1 in segments of (H, W, D) values, and 0 for the background."""
        own = labels[labels > 0]
        masses = np.bincount(own)
        present = np.flatnonzero(masses)
        if self.background == "largest":
            background = masses.argmax()
        else:
            brightness = np.bincount(own, values[labels > 0].sum(axis=1, dtype=np.float64))[present] / masses[present]
            background = present[brightness.argmin() if self.background == "darkest" else brightness.argmax()]
        return split_touching((labels > 0) & (labels != background), self.neck_depth)


def split_touching(mask: ArrayLike, neck_depth: float = 0.5) -> NDArray[np.int32]:
    """Label the objects of a mask, splitting those that touch at their necks.

    Parameters
    ----------
    mask : (H, W) array
        Objects where it is not 0.
    neck_depth : float
        As in `Objects`: larger values split less.

    Returns
    -------
    (H, W) int32 array
        Labels of the objects from 1, and 0 for the background.

    References
    ----------
    S. Beucher, C. Lantuejoul, Use of watersheds in contour detection, International Workshop on Image Processing,
    Rennes, 1979.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.segmentation import split_touching
    >>> down, right = np.mgrid[:30, :50]
    >>> discs = (np.hypot(down - 15, right - 15) < 10) | (np.hypot(down - 15, right - 32) < 10)
    >>> int(split_touching(discs).max()), int(split_touching(discs, np.inf).max())
    (2, 1)
    """
    from scipy.ndimage import distance_transform_edt, gaussian_filter
    from skimage.measure import label
    from skimage.morphology import local_maxima, reconstruction
    from skimage.segmentation import watershed

    inside = check_labels("mask", np.asarray(mask) != 0) > 0
    pieces = np.asarray(label(inside, connectivity=1), np.int32)  # type: ignore[no-untyped-call]
    if not inside.any() or neck_depth == np.inf:
        return pieces
    # Beyond the image lies no background: objects that the image cuts off are no thinner for it.
    distance = gaussian_filter(np.asarray(distance_transform_edt(inside)), _BLUR, mode="nearest")
    # Maxima that rise by less than the depth above the saddle to a higher one are flooded. (scikit-image's own
    # `h_maxima` finds more of them in floating point.)
    flooded = reconstruction(distance - max(neck_depth, 1e-6), distance)  # type: ignore[no-untyped-call]
    peaks = local_maxima(flooded, connectivity=2)  # type: ignore[no-untyped-call]
    centers = label(peaks & inside, connectivity=2)  # type: ignore[no-untyped-call]
    # A piece so small that it has no peak is an object all the same.
    lost = (np.bincount(pieces[centers > 0], minlength=int(pieces.max()) + 1) == 0)[pieces] & inside
    centers = np.where(lost, centers.max() + pieces, centers)
    split = watershed(-distance, centers, mask=inside)  # type: ignore[no-untyped-call]
    _, numbers = np.unique(split[inside], return_inverse=True)
    objects = np.zeros(inside.shape, np.int32)
    objects[inside] = numbers + 1
    return objects
