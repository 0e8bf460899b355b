"""The leaves of a hierarchy: superpixels, the borders between them, and what is known of both.

What people see in an image does not shrink as its pixels do: discs of a few pixels see little of a large photograph
but its grain. Leaves of one of many megapixels are found and measured on a reduced image, and their borders on the
whole one.
"""

from dataclasses import dataclass

import numpy as np

import cvtimg.labels._labels as _labels
from cvtimg._shared.pixels import peak
from cvtimg._shared.progress import part
from cvtimg._shared.sums import take_rows
from cvtimg._shared.threads import in_stripes
from cvtimg._shared.types import Array, Bools, Floats, Indices, Ints
from cvtimg.halfedges import EdgeTable
from cvtimg.labels.components import Borders, absorb_small, connected_pieces, find_borders, grid_of_cells
from cvtimg.segmentation._segments import N_LEVELS, N_TEXTONS
from cvtimg.segmentation.edge_weight import RADIUS, EdgeWeighted, descend, moments_of
from cvtimg.segmentation.hierarchy.channels import Channels
from cvtimg.segmentation.hierarchy.settings import SETTINGS
from cvtimg.segmentation.hierarchy.strengths import border_strengths, global_strengths, smoothing_matrix
from cvtimg.segmentation.noise import noise_covariance
from cvtimg.segmentation.prepared import auto_weight
from cvtimg.segmentation.touching import numbered
from cvtimg.segmentation.values import PictureValues

#: Reduced rows at a time.
_ROWS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Leaves:
    """N leaves, numbered from 0, and B borders between them."""

    labels: Ints  # (H, W): the number of each leaf plus 1; 0 outside the mask
    sizes: Floats  # (N,): pixels
    #: (N, D + 1): sums over the pixels of each leaf: of their values about the center, and of the squares of these
    moments: Floats
    histograms: list[Floats]  # (N, bins) each: of each channel, textons last
    borders: Borders  # between the leaves
    strengths: Floats  # (B,): how strongly each border parts its sides
    #: (B,) each: altitudes in the tree of the image alone, and in that of the image at half its size, if there is one
    near_and_far: tuple[Floats, ...] = ()

    def merged(self) -> tuple[Ints, Floats]:
        """Merge the leaves, those that differ least first; return (M, 2) the regions that merge, and (M,) altitudes."""
        # Merge m makes region N + m. Altitudes are the running maximum of what differs, so that they never fall.
        pairs, lengths, sizes = self.borders.pairs.copy(), self.borders.lengths.astype(np.float64), self.sizes.copy()
        blocks = np.cumsum([0, *(histogram.shape[1] for histogram in self.histograms)], dtype=np.int32)
        weights = SETTINGS.color, SETTINGS.texture, SETTINGS.shared, SETTINGS.size_power
        sums = np.concatenate(self.histograms, axis=1)
        merges, altitudes = _labels.merge(pairs, lengths, self.strengths * lengths, sizes, sums, blocks, *weights)
        return merges, np.maximum.accumulate(altitudes)


def find_leaves(values: PictureValues, channels: Channels, n_leaves: int) -> Leaves:
    """Divide an image into about the given number of superpixels, and measure them."""
    with part(0, 0.5):  # superpixels take half of the time
        n_pixels = int(np.count_nonzero(channels.inside))
        cells = grid_of_cells(channels.inside, min(n_leaves, n_pixels))
        weight = max(SETTINGS.compactness, auto_weight(noise_covariance(channels.values, channels.inside), RADIUS))
        settled = descend(channels.values, cells, int(cells.max()), edge_weight=weight, connected=True).labels
        # Few pixels have no histogram that could be compared: they would stay regions of their own to the top.
        labels = numbered(absorb_small(settled, channels.values, n_pixels // n_leaves // SETTINGS.speck))
    measured = moments_of(values.field(), labels)
    sizes, means = measured.masses[1:, 0].copy(), measured.means[1:]
    squares = measured.energies[1:] + sizes * np.einsum("nd,nd->n", means, means)
    borders = find_borders(labels)
    strengths = border_strengths(borders, channels)
    steps = global_strengths(borders.pairs, strengths, borders.lengths, sizes)
    return Leaves(
        labels=labels,
        sizes=sizes,
        moments=np.column_stack([sizes[:, None] * means, squares]),
        histograms=_histograms(labels[values.inside] - 1, len(sizes), channels),
        borders=borders,
        # Eigenvectors have slopes even where there is nothing to see: they can only confirm other evidence.
        strengths=strengths + np.minimum(SETTINGS.other_view * steps, strengths),
    )


def _histograms(own: Ints, n_leaves: int, channels: Channels) -> list[Floats]:
    """(N, bins) histogram of each channel, colors smoothed, for the leaves (n,) of the pixels inside."""
    n_colors = channels.bins.shape[2] - 1
    histograms = []
    for channel, n_bins in enumerate([N_LEVELS] * n_colors + [N_TEXTONS]):
        bins = channels.bins[..., channel][channels.inside]
        counts = np.bincount(own * np.int64(n_bins) + bins, minlength=n_leaves * n_bins).reshape(-1, n_bins)
        mixing = smoothing_matrix() if channel < n_colors else np.eye(n_bins)
        histograms.append(np.einsum("nb,bc->nc", counts, mixing))
    return histograms


def reduction(n_pixels: int) -> int:
    """Return how many times an image of a number of pixels is reduced along each axis."""
    return max(1, int(np.ceil(np.sqrt(n_pixels / SETTINGS.most_pixels))))


def reduced(image: Array, inside: Bools, factor: int) -> tuple[Array, Bools]:
    """Replace blocks of an (H, W, C) image by the mean of their pixels inside; also say which have some."""
    # Blocks at the right and lower border may be smaller. Integers become floating point with white at 1: rounded means
    # would depend on the type.
    height, width, n_bands = image.shape
    columns = np.arange(0, width, factor)
    means = np.empty((-(-height // factor), len(columns), n_bands), np.result_type(image.dtype, np.float32))
    occupied = np.empty(means.shape[:2], np.bool_)

    def reduce(own: slice) -> None:
        part = slice(own.start * factor, own.stop * factor)
        rows = np.arange(0, len(inside[part]), factor)
        counts = np.add.reduceat(np.add.reduceat(inside[part].astype(np.float64), rows), columns, axis=1)
        weighted = image[part] * inside[part, :, None].astype(np.float64)
        sums = np.add.reduceat(np.add.reduceat(weighted, rows), columns, axis=1)
        means[own] = sums / (np.maximum(counts, 1)[..., None] * peak(image.dtype))
        occupied[own] = counts > 0

    in_stripes(reduce, len(means), 16.0 * image.size, _ROWS)
    return means, occupied


def enlarged(leaves: Leaves, image: Array, inside: Bools, factor: int) -> Leaves:
    """Carry the leaves of a reduced image to the whole one, and let their borders follow its edges."""
    height, width = inside.shape
    blocks = take_rows(leaves.labels.repeat(factor, axis=1)[:, :width], np.arange(height) // factor)
    labels, parents = blocks, np.arange(len(leaves.sizes))
    if not inside.all():
        # Pieces into which the mask cuts leaves are leaves; very small ones join a neighbor, if they have one.
        pieces = connected_pieces(np.where(inside, blocks, np.int32(0)))
        labels = numbered(absorb_small(pieces, np.zeros((*pieces.shape, 1), np.float32), 4 * factor**2))
        parents = np.zeros(int(labels.max()) + 1, np.intp)
        parents[labels] = blocks
        parents = parents[1:] - 1
    at_edges = _at_edges(image, labels, factor)
    labels, sizes = at_edges.labels, at_edges.masses[:, 0].copy()
    shares = (sizes / leaves.sizes[parents])[:, None]
    borders = find_borders(labels)
    return Leaves(
        labels=labels,
        sizes=sizes,
        moments=leaves.moments[parents] * shares,
        histograms=[histogram[parents] * shares for histogram in leaves.histograms],
        borders=borders,
        strengths=_known(leaves, leaves.strengths, parents[borders.pairs]),
        near_and_far=tuple(_known(leaves, altitudes, parents[borders.pairs]) for altitudes in leaves.near_and_far),
    )


def _at_edges(image: Array, labels: Ints, factor: int) -> EdgeWeighted:
    """Move the borders of leaves, no farther than a block or two, to the edges of the image."""
    some = image[:: factor * 4, :: factor * 4]
    low, high = np.percentile(some, (0.1, 99.9))
    gain = 255 / (high - low) if high > low else 1
    values = np.empty(image.shape, np.float32)

    def stretch(rows: slice) -> None:
        np.subtract(image[rows], np.float32((low + high) / 2), out=values[rows], dtype=np.float32)
        values[rows] *= np.float32(gain)

    in_stripes(stretch, len(image), 16.0 * image.size, _ROWS)
    n_leaves, weight, n_sweeps = int(labels.max()), SETTINGS.compactness, SETTINGS.sweeps * factor
    return descend(values, labels, n_leaves, edge_weight=weight, connected=True, max_sweeps=n_sweeps)


def _known(leaves: Leaves, values: Floats, pairs: Indices) -> Floats:
    """(B,) values of borders between leaves; 0 within one, and the mean where two have met only now."""
    known_at = EdgeTable(leaves.borders.pairs, len(leaves.sizes)).find(pairs)
    known = np.full(len(pairs), values.mean() if len(values) else 0.0)
    known[known_at >= 0] = values[known_at[known_at >= 0]]
    known[pairs[:, 0] == pairs[:, 1]] = 0
    return known
