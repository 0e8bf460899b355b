"""Noise, measured on an image alone, and averages by a Gaussian, which lower it.

Second differences along both axes remove what varies linearly and leave noise, edges and texture; the quieter blocks
have little of the latter two, so noise is measured there: J. Immerkaer, Computer Vision and Image Understanding 64
(1996) 300-302, doi 10.1006/cviu.1996.0060. Taking quiet blocks is our own.

With a kernel w of sum 1, averaging the squared distance to a generator gives the same cells as averaging the image,
because w * |u - z|^2 = |w * u - z|^2 + a term without z.
"""

from collections.abc import Callable

import numpy as np
from scipy import ndimage
from scipy.special import ndtri

from cvtimg._shared.threads import side_by_side
from cvtimg._shared.types import Array, Bools, Floats, Floats32, Ints64

#: Standard deviations at which a Gaussian is cut off, as in SciPy: time grows with it.
TRUNCATE = 4.0
#: Pixels along the side of a block, and blocks in which noise is measured at most: larger ones have more texture.
_BLOCK, _ENOUGH_BLOCKS = 16, 1 << 18
#: Shares of the blocks, sorted by how much they vary, between which noise is measured: more of them have texture.
_QUIET = (0.15, 0.35)
#: Standard deviations that the mean of the quiet blocks is below the mean of all, of normal noise.
_LESS_IN_QUIET = 0.674
#: Share of the second differences of a block that are 0, above which the others are edges: rounded noise leaves fewer
#: from a standard deviation of 0.3 levels.
_FLAT = 0.5
#: Second differences of near pixels, which are correlated, that count as one that is not.
_PIXELS_THAT_COUNT = 3.78
#: Median distance of normal noise from its median, in standard deviations.
MEDIAN_OF_NORMAL = 0.6745
#: Part of the narrowest light that a lens draws, a Gaussian of a width of .35 pixels, that the next pixel has: larger
#: takes more lights for impulses, which have none.
NEXT_TO_LIGHT = 1 / 64


def noise_covariance(values: Array, inside: Bools | None = None) -> Floats:
    """(D, D) covariance of the noise of (H, W, D) values, measured in the blocks that lie `inside`, (H, W)."""
    return noise_of_rows(
        lambda first, last: (values[first:last], None if inside is None else inside[first:last]), values.shape[:2]
    )


def noise_of_rows(read: Callable[[int, int], tuple[Array, Bools | None]], shape: tuple[int, ...]) -> Floats:
    """(D, D) covariance of the noise of an image of which some rows are read at a time, with where they count."""
    # It is 0 if nothing can be measured. Of a large image, some rows of blocks are enough.
    height, width = (min(_BLOCK, max(side - 2, 1)) for side in shape)
    n_rows, n_columns = max((shape[0] - 2) // height, 1), max((shape[1] - 2) // width, 1)
    firsts = range(0, height * n_rows, height * -(-n_rows * n_columns // _ENOUGH_BLOCKS))
    parts = side_by_side(lambda first: _block_covariances(*read(first, first + height + 2)), firsts)
    covariances = np.concatenate([*parts])
    n_dims = covariances.shape[1]
    if not len(covariances):
        return np.zeros((n_dims, n_dims))
    order = np.argsort(np.trace(covariances, axis1=1, axis2=2), kind="stable")
    first, last = (int(share * len(order)) for share in _QUIET)
    if last == first:
        return np.asarray(covariances.mean(axis=0))
    mean = covariances[order[first:last]].mean(axis=0)
    n_noisy = max(int(np.count_nonzero(np.diagonal(mean))), 1)  # an empty band makes blocks no more alike
    variation = np.sqrt(2 * _PIXELS_THAT_COUNT / (height * width * n_noisy))
    return np.asarray(mean / (1 - _LESS_IN_QUIET * variation))


def _block_covariances(values: Array, inside: Bools | None) -> Floats:
    """(B, D, D) covariance of the second differences in each block of a row of blocks that is inside the mask."""
    n_dims = values.shape[2]
    if min(values.shape[:2]) < 3:
        return np.zeros((0, n_dims, n_dims))
    differences = np.diff(np.diff(values.astype(np.float64), 2, axis=0), 2, axis=1) / 6
    if inside is not None and not inside.all():
        whole = ndimage.binary_erosion(inside, np.ones((3, 3)))[1:-1, 1:-1]
        differences[~whole] = np.nan
    height, width = differences.shape[:2]
    n_columns = min(_BLOCK, width)
    bands = np.moveaxis(differences[:, : width // n_columns * n_columns], 2, 0).copy()  # for long loops
    products = np.stack([(band * bands).sum(axis=1) for band in bands]).reshape(n_dims, n_dims, -1, n_columns)
    covariances: Floats = products.sum(axis=3).transpose(2, 0, 1) / (height * n_columns)
    flat = (bands == 0).all(axis=0).reshape(height, -1, n_columns).mean(axis=(0, 2))
    covariances[flat > _FLAT] = 0
    return covariances[np.isfinite(covariances).all(axis=(1, 2))]


def noise_gain(deviation: float) -> float:
    """Return the part of the variance of white noise that averages have: the sum of the squared weights."""
    line = np.zeros(2 * int(TRUNCATE * deviation) + 5)
    line[len(line) // 2] = 1
    weights = ndimage.gaussian_filter(line, deviation, mode="constant", truncate=TRUNCATE)
    return float(weights @ weights) ** 2


def averaged(values: Floats32, deviation: float, inside: Bools | None = None) -> Floats32:
    """(H, W, D) averages of (H, W, D) values over the pixels `inside`, (H, W); 0 elsewhere."""
    # Deviations are in pixels. Pixels beyond the border of the image are outside too.
    within = np.ones(values.shape[:2], bool) if inside is None else inside

    def filtered(image: Floats32) -> Floats32:
        return np.asarray(ndimage.gaussian_filter(image, deviation, mode="constant", truncate=TRUNCATE, axes=(0, 1)))

    mass = filtered(within[..., None].astype(np.float32))
    sums = filtered(np.where(within[..., None], values, np.float32(0)))
    return np.divide(sums, mass, out=np.zeros_like(sums), where=within[..., None])


def without_impulses(plane: Floats32) -> Floats32:
    """Replace impulses by medians: pixels that stand out from all around and lend nothing to what is next to them."""
    for _ in range(2):  # what is left of groups that were the median themselves stands out then
        around = ndimage.median_filter(plane, 3, mode="mirror")
        away = np.abs(plane - around)
        # The largest of this many values of normal noise.
        out = _deviation(plane, away) * np.sqrt(2 * np.log(plane.size))
        hits = away > out
        y, x = np.nonzero(hits)
        near = _near(plane, y, x)
        alone = (plane[y, x] > near.max(axis=0, initial=-np.inf) + out) | (plane[y, x] < near.min(axis=0) - out)
        steps = (plane - around)[y, x]
        others = plane.copy()  # impulses that touch lend each other nothing
        others[y[alone], x[alone]] = around[y[alone], x[alone]]
        near = _near(others, y, x)
        lent = (near[[1, 3, 4, 6]].mean(axis=0) - near[[0, 2, 5, 7]].mean(axis=0)) * np.sign(steps)
        if not abs(lent[alone].sum()) < NEXT_TO_LIGHT * np.abs(steps[alone]).sum():
            break
        # By chance, impulses touch in groups: of n in N pixels, n (8 n / N)^(k - 1) in groups of k.
        n, pieces = len(y), ndimage.label(hits, np.ones((3, 3)))[0]
        chance = 8 * n / plane.size
        most = 2 + np.log(n) / -np.log(chance) if chance < 1 else np.inf
        plane = np.where(hits & (np.bincount(pieces.ravel())[pieces] <= most), around, plane)
    return plane


def _near(plane: Floats32, y: Ints64, x: Ints64) -> Floats32:
    """(8, N) values of the pixels next to some, row by row, reflected at the border."""
    padded = np.pad(plane, 1, mode="reflect" if min(plane.shape) > 1 else "edge")
    return np.stack([padded[y + down, x + right] for down, right in np.ndindex(3, 3) if (down, right) != (1, 1)])


def _deviation(plane: Floats32, away: Floats32) -> float:
    """Return the standard deviation of noise of which values are `away` from medians, also where most are rounded to 0.

    Values are rounded if all are multiples of a unit apart. What leaves most blocks of 3 x 3 pixels as they are is no
    noise.
    """
    share = np.count_nonzero(away) / away.size
    if share >= 0.5:
        return float(np.median(away)) / MEDIAN_OF_NORMAL
    steps = np.diff(np.unique(plane))
    if share < 1 - _FLAT ** (1 / 9) or len(steps) < 2:
        return 0.0
    in_units = steps / steps.min()
    return float(steps.min() / 2 / ndtri(1 - share / 2)) if np.allclose(in_units, np.rint(in_units), atol=0.01) else 0.0
