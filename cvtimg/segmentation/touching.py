"""Objects before a background: touching ones are split at their necks, and each may get a border of its own.

Where objects overlap in a segmentation, their union is one connected piece with a neck. The distance to the background
has a maximum in the middle of each object and a saddle at the neck; a watershed of the distance cuts there. Weighting
the distance by the contrast with the background raises a bright object above the dim one that it touches.

One border between two segments of a whole image runs inside dim objects and in the halo of bright ones. The border of
an object's own runs where values are halfway between the mean of this object and that of the background: the two are
the generators of a tessellation, and the object is its cell.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from cvtimg._shared.checks import check_choice, check_non_negative
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg._shared.types import Array, Bools, Floats, Floats32, Ints
from cvtimg.segmentation.noise import averaged

BACKGROUNDS = ("largest", "darkest", "brightest")
#: Pixels of blur of the distance: keeps ragged borders from making maxima of their own; more joins small objects.
_BLUR = 1.0
#: Pixels of blur of averages in which contrast is measured: more is less noisy, and mixes small objects.
FOR_CONTRAST = 2.0
#: Rounds of what settles, at most: means and borders of most objects do in five, shares of necks in twenty.
ROUNDS = 20


@dataclass(frozen=True, slots=True)
class Objects:
    """How to find objects in a segmentation.

    Attributes
    ----------
    background : {"largest", "darkest", "brightest"}
        The segment that is the background; all others are objects.
    neck_depth : float
        Split a piece at a neck if the largest circles inside the parts on both sides exceed that in the neck by more
        than this in radius, in pixels, for objects of the usual contrast with the background. With infinity, pieces
        are not split.
    """

    background: str = "largest"
    neck_depth: float = 0.5

    def __post_init__(self) -> None:
        check_choice("background", self.background, BACKGROUNDS)
        if self.neck_depth != np.inf:
            check_non_negative("neck_depth", self.neck_depth)

    def found(self, labels: Ints, values: Floats32) -> Ints:
        """Return labels of the objects from 1 in segments of (H, W, D) values, and 0 for the background."""
        own = labels[labels > 0]
        masses = np.bincount(own)
        present = np.flatnonzero(masses)
        if self.background == "largest":
            background = masses.argmax()
        else:
            brightness = np.bincount(own, values[labels > 0].sum(axis=1, dtype=np.float64))[present] / masses[present]
            background = present[brightness.argmin() if self.background == "darkest" else brightness.argmax()]
        inside = (labels > 0) & (labels != background)
        if not inside.any() or not (labels == background).any():
            return split_touching(inside, self.neck_depth)
        ground = values[labels == background].mean(axis=0, dtype=np.float64).astype(np.float32)
        contrast = np.sqrt(_apart(averaged(values, FOR_CONTRAST, labels > 0), ground))
        return split_touching(inside, self.neck_depth, contrast)


def split_touching(inside: Bools, neck_depth: float = 0.5, contrast: NDArray[np.floating] | None = None) -> Ints:
    """Label the objects of a mask, (H, W), splitting those that touch: at necks, and where their contrast differs."""
    # S. Beucher, C. Lantuejoul, Use of watersheds in contour detection, International Workshop on Image Processing,
    # Rennes, 1979.
    from skimage.measure import label

    if not inside.any() or neck_depth == np.inf:
        return np.asarray(label(inside, connectivity=1), np.int32)  # type: ignore[no-untyped-call]
    # Beyond the image lies no background: objects that the image cuts off are no thinner for it.
    distance = ndimage.gaussian_filter(np.asarray(ndimage.distance_transform_edt(inside)), _BLUR, mode="nearest")
    if contrast is not None and (usual := np.median(contrast[inside])) > 0:
        distance *= np.sqrt(np.maximum(contrast, 0) / usual)
    return split_at_saddles(distance, inside, neck_depth)


def split_at_saddles(height: NDArray[np.floating], inside: Bools, depth: float) -> Ints:
    """Label the parts of pixels, of two or three axes, that rise by more than the depth above their saddles."""
    from skimage.measure import label
    from skimage.morphology import local_maxima
    from skimage.segmentation import watershed

    n_axes = inside.ndim
    # What is outside lies lower than all, and so does a rim: in an image of one height, all of it is the peak.
    shown = np.pad(np.where(inside, height, -np.inf), 1, constant_values=-np.inf)
    peaks = local_maxima(shown, connectivity=n_axes)[(slice(1, -1),) * n_axes] & inside  # type: ignore[no-untyped-call]
    centers = np.asarray(label(peaks, connectivity=n_axes), np.int32)  # type: ignore[no-untyped-call]
    parts = np.asarray(watershed(-height, centers, n_axes, mask=inside), np.int32)  # type: ignore[no-untyped-call]
    # The highest saddle between each two parts that meet, the highest of all first.
    meetings = []
    for step in (step for step in product((-1, 0, 1), repeat=n_axes) if step > (0,) * n_axes):
        here = tuple(slice(max(-far, 0), length - max(far, 0)) for far, length in zip(step, parts.shape, strict=True))
        there = tuple(slice(max(far, 0), length + min(far, 0)) for far, length in zip(step, parts.shape, strict=True))
        meet = (parts[here] != parts[there]) & (parts[here] > 0) & (parts[there] > 0)
        ends = np.sort([parts[here][meet], parts[there][meet]], axis=0)
        meetings.append([*ends, np.minimum(height[here][meet], height[there][meet])])
    first, second, saddles = (np.concatenate(column) for column in zip(*meetings, strict=True))
    order = np.argsort(-saddles, kind="stable")
    order = order[np.sort(np.unique(np.stack([first, second])[:, order], axis=1, return_index=True)[1])]
    tops = largest_by_label(height - height.min(), parts) + height.min()
    whole = np.arange(len(tops), dtype=np.int32)  # the part of which each is one
    for *pair, saddle in zip(first[order], second[order], saddles[order], strict=True):
        lower, higher = sorted(whole[pair], key=tops.__getitem__)
        if lower != higher and tops[lower] - saddle <= depth:
            whole[whole == lower] = higher
    return numbered(whole[parts])


def with_own_borders(objects: Ints, values: Floats32, ground: Floats32) -> Ints:
    """Take from each object what is nearer to the mean of the background than to the object's own."""
    from skimage.measure import label

    inside = objects > 0
    colors, near = values[inside], objects[inside]
    from_ground = _apart(colors, ground)
    for _ in range(ROUNDS):
        means = per_mass(sum_by_label(near, colors), np.bincount(near)).astype(np.float32)
        far = (_apart(colors, means[near]) >= from_ground) & (near > 0)
        if not far.any():
            break
        near[far] = 0
    kept = np.zeros_like(objects)
    kept[inside] = near
    # What an object encloses is part of it, and what it has lost touch with is not.
    kept = np.where(ndimage.binary_fill_holes(kept > 0), objects, 0)
    pieces = np.asarray(label(kept, connectivity=1))  # type: ignore[no-untyped-call]
    of = np.zeros(int(pieces.max()) + 1, np.int32)
    of[pieces.ravel()] = kept.ravel()
    by_size = np.argsort(np.bincount(pieces.ravel()), kind="stable")
    main = np.zeros(int(objects.max()) + 1, np.int64)
    main[of[by_size]] = by_size  # the largest piece of each object comes last
    return numbered(np.where((kept > 0) & (main[kept] == pieces), kept, 0))


def _apart(values: Floats32, color: Floats32) -> Floats32:
    """Squared distances of (..., D) values to a color or to that of each pixel."""
    return np.square(values - color).sum(axis=-1)


def largest_by_label(values: Array, labels: Array) -> Floats:
    """Return the largest value, >= 0, of each label from 0, whose is 0; without a sort, as in scipy.ndimage."""
    largest = np.zeros(int(labels.max(initial=0)) + 1)
    np.maximum.at(largest, labels[labels > 0], values[labels > 0])
    return largest


def numbered(objects: Array) -> Ints:
    """Return objects numbered from 1 without gaps; 0 stays 0."""
    return numbers_of(np.bincount(objects.ravel()) > 0)[objects]


def numbers_of(kept: Bools) -> Ints:
    """Return the new number of each label, from 1 for those that are kept, and 0 for others and for 0."""
    return np.append(np.int32(0), np.cumsum(kept[1:], dtype=np.int32) * kept[1:])
