"""Means that vary slowly across an image, and light that does."""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from cvtimg._shared.types import Array, Bools, Floats32
from cvtimg.engine.tessellation import tessellate
from cvtimg.segmentation.touching import ROUNDS

#: Light and means vary over this share of the longer side; light is found on this number of pixels.
REACH, _ENOUGH_PIXELS = 0.125, 1 << 18
_BLOCKS_IN_REACH = 4
#: Where few pixels are near, the mean of all counts for this share of a neighborhood.
PRIOR = 0.02


def in_even_light(values: Floats32, inside: Bools, n_segments: int, rng: int | np.random.Generator) -> Floats32:
    """Divide (H, W, D) values, 0 for black, by the light: a gain that varies slowly, times the means of segments."""
    # The values less the gain times the mean of their segment are least in squares, of which those near a place count
    # there: segments are found in what the gain of the segments before leaves.
    apart = max(int(np.sqrt(inside.size / _ENOUGH_PIXELS)), 1)
    some, known = values[::apart, ::apart], inside[::apart, ::apart]
    means: Array = np.broadcast_to(some[known].mean(axis=0), some.shape)
    for share in (REACH, REACH / 2):  # the latter to follow light into the corners
        reach, light = [share * max(known.shape)] * 2, np.ones(0, np.float32)
        for _ in range(ROUNDS):
            before = light
            shared = local_mean((some * means).sum(axis=2), known, reach, PRIOR)
            squares = local_mean(np.square(means).sum(axis=2), known, reach, PRIOR)
            light = np.divide(shared, squares, out=np.ones_like(squares), where=squares > 0)
            light /= light.mean()
            if before.size and np.abs(light - before).max() < 1e-3:
                break
            even = some / spread(light, known.shape)[..., None]
            cells = tessellate(even[known], n_segments, effort="fast", rng=rng)
            means = np.zeros(some.shape, np.float32)
            means[known] = cells.generators[cells.labels]
    return np.where(inside[..., None], values / spread(light, inside.shape)[..., None], np.float32(0))


def local_mean(values: Floats32, of: Bools, reach: Sequence[float], prior: float) -> Floats32:
    """Return the Gaussian mean of some pixels around each, drawn to the mean of all where there are few, in blocks."""
    sizes = [max(int(far / _BLOCKS_IN_REACH), 1) for far in reach]  # fine enough for what varies so slowly
    sigmas = [far / side for far, side in zip(reach, sizes, strict=True)]
    sums, counts = values * of, of.astype(np.float32)
    for axis, side in enumerate(sizes):
        if side > 1:
            starts = np.arange(0, of.shape[axis], side)
            sums, counts = (np.add.reduceat(whole, starts, axis=axis) for whole in (sums, counts))
    mean = float(sums.sum(dtype=np.float64) / counts.sum(dtype=np.float64))
    total, mass = (ndimage.gaussian_filter(each / np.prod(sizes), sigmas, mode="nearest") for each in (sums, counts))
    return np.asarray((total + prior * mean) / (mass + prior), np.float32)


def spread(blocks: Floats32, shape: tuple[int, ...]) -> Floats32:
    """Interpolate between the centers of blocks, of which the last one along an axis may be cut off."""
    for axis, length in enumerate(shape):
        n_blocks = blocks.shape[axis]
        at = np.clip((np.arange(length) + 0.5) / -(-length // n_blocks) - 0.5, 0, n_blocks - 1)
        after = np.ceil(at).astype(np.intp)
        shares = (after - at).astype(np.float32).reshape(-1, *(1,) * (len(shape) - axis - 1))
        last = blocks.take(after, axis)
        blocks = last + shares * (blocks.take(np.floor(at).astype(np.intp), axis) - last)
    return blocks
