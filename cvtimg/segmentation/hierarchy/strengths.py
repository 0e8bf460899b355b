"""How strongly borders part neighboring regions: what is near them tells, and the structure of the whole image.

The strength of a border is measured at the cracks between the pixels on its two sides: a disc around a crack is
halved along the border, and the histograms of the halves are compared, channel by channel, for discs of several radii.

D. Martin, C. Fowlkes, J. Malik, IEEE Trans. Pattern Analysis and Machine Intelligence 26 (2004) 530-549, doi
10.1109/TPAMI.2004.1273918: half discs. Measuring at the borders of small regions alone is what makes it quick.

Neighboring regions are springs, weak across strong borders; the slowest vibrations of that graph move the large parts
of a picture against each other, and steps of them from region to region tell of borders that no disc can see.

P. Arbelaez, M. Maire, C. Fowlkes, J. Malik, IEEE Trans. Pattern Analysis and Machine Intelligence 33 (2011) 898-916,
doi 10.1109/TPAMI.2010.161: the same on pixels.

A tree tells how much regions differ, with one value for all of the border between two of them; people draw the part
that they see. Evidence that they draw a border is a product of powers of three views of it, a sum of log odds: its
altitudes near and from afar, and its strength. It is less amid many other borders, which are texture (C. Grigorescu,
N. Petkov, M. Westenberg, IEEE Trans. Image Processing 12 (2003) 729-739, doi 10.1109/TIP.2003.814250), and at the
margin of the image, which is a frame.
"""

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

import cvtimg.segmentation._segments as _segments
from cvtimg._shared.sums import sum_by_label
from cvtimg._shared.threads import in_parts, one_blas_thread
from cvtimg._shared.types import Bools, Floats, Floats32, Ints, Ints64
from cvtimg.labels.components import Borders
from cvtimg.segmentation._segments import HIDDEN, N_LEVELS, REACH
from cvtimg.segmentation.hierarchy.channels import Channels
from cvtimg.segmentation.hierarchy.settings import SETTINGS


def border_strengths(borders: Borders, channels: Channels) -> Floats:
    """(B,) mean strength of each border, about 0 to 1.5."""
    if not len(borders.pairs):
        return np.zeros(0)
    angles = _angles(borders)
    turns = (borders.is_flat * SETTINGS.n_angles + angles).astype(np.int32)
    distances = _half_disc_distances(channels, borders.places, turns)
    n_colors = distances.shape[1] - 1
    weights = np.outer([*SETTINGS.color_weights[:n_colors], SETTINGS.texton_weight], SETTINGS.radius_weights)
    strengths = np.einsum("pcr,cr->p", distances, weights)
    return borders.means(strengths)


def _angles(borders: Borders) -> Ints:
    """(P,) number of the direction in which the border runs at each crack; a crack alone runs along itself."""
    from scipy.spatial import cKDTree

    reach, ids = 2 * SETTINGS.straight, np.repeat(np.arange(len(borders.pairs)), borders.lengths)
    angles = np.where(borders.is_flat, 0, SETTINGS.n_angles // 2).astype(np.int32)

    def measure(first: int, last: int) -> None:
        cracks = slice(*borders.starts[[first, last]])
        is_flat = borders.is_flat[cracks]
        middles = 2 * borders.places[cracks] + np.stack([is_flat, ~is_flat], axis=1)
        # Borders lie in planes of their own, so that those of others are out of reach.
        near = cKDTree(np.column_stack([middles, 2 * reach * ids[cracks]])).query_pairs(reach, output_type="ndarray")
        at, other = np.concatenate([near, near[:, ::-1]]).T
        down, right = (middles[other] - middles[at]).T
        powers = np.stack([down**0, down, right, down * down, down * right, right * right], axis=1)
        n, d, r, dd, dr, rr = sum_by_label(at, powers, len(middles)).T
        # Variances by sums of whole numbers, which are exact, so that no axis hangs on rounding; the crack counts too.
        along, both, across = (n + 1) * rr - r * r, (n + 1) * dr - d * r, (n + 1) * dd - d * d
        axes = np.rint(np.arctan2(2 * both, along - across) / (2 * np.pi) * SETTINGS.n_angles) % SETTINGS.n_angles
        angles[cracks] = np.where(n > 0, axes, angles[cracks])

    in_parts(measure, len(borders.pairs), work=3000.0 * len(angles))
    return angles


def _half_disc_distances(channels: Channels, places: Ints, turns: Ints) -> Floats32:
    """(P, C, R) distances of the halves of discs around cracks."""
    margin = SETTINGS.radii[-1]
    shown = np.where(channels.inside[..., None], channels.bins, np.uint8(HIDDEN))
    padded = np.pad(shown, ((margin, margin), (margin, margin), (0, 0)), constant_values=HIDDEN)
    width, n_channels = padded.shape[1:]
    bins = padded.reshape(-1, n_channels)
    down, right, counts = _discs()
    steps = (down * width + right).astype(np.int32)
    flat = ((places[:, 0] + margin) * width + places[:, 1] + margin).astype(np.int32)
    smoothing = _taps().astype(np.float32)
    distances = np.empty((len(flat), n_channels, len(SETTINGS.radii)), np.float32)

    def measure(first: int, last: int) -> None:
        _segments.half_disc_distances(bins, flat, turns, steps, counts, smoothing, first, last, distances)

    in_parts(measure, len(flat), work=3000.0 * len(flat))
    return distances


@cache
def _discs() -> tuple[Ints64, Ints64, Ints]:
    """Rows and columns (T, 2, S), from the pixel before a crack, of the halves of discs, and (T, R) their sizes."""
    # Upright cracks come first, then flat ones, each in all directions. Pixels on the line between the halves belong to
    # neither; inner ones come first.
    reach = np.arange(-SETTINGS.radii[-1], SETTINGS.radii[-1] + 2)
    rows, columns = (grid.ravel() for grid in np.meshgrid(reach, reach, indexing="ij"))
    halves, counts = [], []
    for is_flat in (False, True):
        down, right = rows - 0.5 * is_flat, columns - 0.5 * (not is_flat)
        distances = np.hypot(down, right)
        for angle in np.pi / SETTINGS.n_angles * np.arange(SETTINGS.n_angles):
            across = down * np.cos(angle) - right * np.sin(angle)
            for side in (-1, 1):
                half = np.flatnonzero((distances <= SETTINGS.radii[-1]) & (side * across > 1e-6))
                half = half[np.argsort(distances[half], kind="stable")]
                halves.append(half)
            counts.append(np.searchsorted(distances[half], SETTINGS.radii, side="right"))
    table = np.zeros((len(halves), max(map(len, halves))), np.intp)
    for line, half in zip(table, halves, strict=True):
        line[: len(half)] = half
    sides = table.reshape(len(counts), 2, -1)
    return rows[sides], columns[sides], np.array(counts, np.int32)


def _taps() -> Floats:
    taps = np.exp(-0.5 * (np.arange(-REACH, REACH + 1) / SETTINGS.smoothing) ** 2)
    return taps / taps.sum()


def smoothing_matrix() -> Floats:
    """(N_LEVELS, N_LEVELS) share of each level that smoothing gives to each other; rows have sum 1."""
    levels = np.arange(N_LEVELS)
    far = levels[:, None] - levels
    shares = np.where(abs(far) <= REACH, _taps()[np.clip(far + REACH, 0, 2 * REACH)], 0)
    return shares / shares.sum(axis=1, keepdims=True)


def global_strengths(pairs: Ints, strengths: Floats, lengths: Ints, sizes: Floats) -> Floats:
    """(B,) steps of the eigenvectors across borders, summed: of the order of the strengths of these."""
    # Borders have pairs (B, 2), strengths and lengths; regions have sizes in pixels.
    if not len(pairs):
        return np.zeros(0)
    weights = lengths.astype(np.float64) * np.exp(-strengths / SETTINGS.softness) + SETTINGS.least_spring
    eigenvalues, vectors = _slow_vectors(pairs, weights, sizes)
    if not len(eigenvalues):
        return np.zeros(len(pairs))
    spans = vectors.max(axis=0) - vectors.min(axis=0)
    steps = np.abs(vectors[pairs[:, 0]] - vectors[pairs[:, 1]]) / spans
    return np.einsum("bk,k->b", steps, np.sqrt(eigenvalues[0] / eigenvalues))


@one_blas_thread  # for the bits must not depend on how many there are
def _slow_vectors(pairs: Ints, weights: Floats, masses: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues, rising, and eigenvectors in columns; without those of 0, which only tell connected parts apart."""
    from scipy.sparse import coo_array, csc_array, diags_array
    from scipy.sparse.csgraph import connected_components
    from scipy.sparse.linalg import eigsh

    n_regions = len(masses)
    ends = np.concatenate([pairs, pairs[:, ::-1]]).T
    springs = coo_array((np.tile(weights, 2), (ends[0], ends[1])), shape=(n_regions, n_regions))
    n_still = connected_components(springs, directed=False)[0]
    n_vectors = min(SETTINGS.n_vectors + n_still, n_regions)
    stiffness = np.bincount(ends[0], np.tile(weights, 2), n_regions)
    roots = np.sqrt(masses / masses.mean())
    scale = diags_array(1 / roots)
    matrix = csc_array(scale @ (diags_array(stiffness) - springs) @ scale)
    if n_vectors >= n_regions - 1:  # all of them
        values, vectors = np.linalg.eigh(matrix.toarray())
    else:
        start = roots + 0.1 * np.cos(1.7 * np.arange(n_regions))
        shift = -1e-4 * stiffness.mean()
        values, vectors = eigsh(matrix, k=n_vectors, sigma=shift, which="LM", v0=start, tol=1e-4)
    order = np.argsort(values)[n_still:n_vectors]
    return np.maximum(values[order], 1e-9), vectors[:, order] / roots[:, None]


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
    inward = borders.means(_inward(box, places, accuracy))
    around = np.maximum(borders.means(_around(places, views[1], borders, box.shape)), SETTINGS.least_surround)
    return seen * np.minimum(inward / accuracy, 1) / (around / SETTINGS.usual_surround) ** SETTINGS.inhibition


def chances_of(evidence: NDArray[np.floating]) -> Floats32:
    """Chances that people draw borders, by their evidence."""
    odds = (np.asarray(evidence, np.float64) / SETTINGS.half_drawn) ** SETTINGS.drawn_power
    return (odds / (1 + odds)).astype(np.float32)


def _inward(inside: Bools, places: Ints, accuracy: float) -> Floats:
    """(P,) distance of pixels from the margin; gaps in it that are smaller than people draw have none."""
    if not inside.all():
        gaps, _ = ndimage.label(~inside)
        inside = inside | (np.bincount(gaps.ravel()) < np.pi * accuracy**2)[gaps]
    if inside.all():
        return np.asarray(np.minimum(places, np.array(inside.shape) - 1 - places).min(axis=1) + 0.5)
    distances: Floats = ndimage.distance_transform_edt(np.pad(inside, 1))
    return distances[tuple(places.T + 1)] - 0.5


def _around(places: NDArray[np.integer], strengths: Floats, borders: Borders, shape: tuple[int, ...]) -> Floats:
    """(P,) mean strength of the borders around each crack."""
    width = SETTINGS.surround * np.sqrt(shape[0] * shape[1])
    side = max(1, int(width / 6))  # of cells in which strengths are added up first, in pixels
    cells = places // side
    grid = cells.max(axis=0) + 1
    flat, size = np.ravel_multi_index(tuple(cells.T), grid), int(np.prod(grid))
    sums = [np.bincount(flat, np.repeat(strengths, borders.lengths), size), np.bincount(flat, np.ones(len(flat)), size)]
    sums = [ndimage.gaussian_filter(each.reshape(grid), width / side, mode="constant") for each in sums]
    total, length = (each.ravel()[flat] for each in sums)
    return total / length
