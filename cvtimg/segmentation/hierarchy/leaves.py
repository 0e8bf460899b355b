"""The leaves of a hierarchy: superpixels, the borders between them, and what is known of both."""

from dataclasses import dataclass

import numpy as np

import cvtimg.labels._labels as _labels
from cvtimg._shared.progress import part
from cvtimg._shared.types import Floats, Ints
from cvtimg.labels.components import Borders, absorb_small, find_borders, grid_of_cells
from cvtimg.segmentation._segments import N_LEVELS, N_TEXTONS
from cvtimg.segmentation.edge_weight import RADIUS, descend, moments_of
from cvtimg.segmentation.hierarchy.channels import Channels
from cvtimg.segmentation.hierarchy.settings import SETTINGS
from cvtimg.segmentation.hierarchy.strengths import border_strengths, global_strengths, smoothing_matrix
from cvtimg.segmentation.noise import noise_covariance
from cvtimg.segmentation.prepared import auto_weight
from cvtimg.segmentation.touching import numbered
from cvtimg.segmentation.values import PictureValues


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
        labels = _superpixels(channels, n_leaves)
    cells = moments_of(values.field(), labels)
    sizes, means = cells.masses[1:, 0].copy(), cells.means[1:]
    squares = cells.energies[1:] + sizes * np.einsum("nd,nd->n", means, means)
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


def _superpixels(channels: Channels, n_leaves: int) -> Ints:
    """(H, W) superpixels, numbered from 1 without gaps; 0 outside the mask."""
    cells = grid_of_cells(channels.inside, min(n_leaves, int(channels.inside.sum())))
    weight = max(SETTINGS.compactness, auto_weight(noise_covariance(channels.values, channels.inside), RADIUS))
    settled = descend(channels.values, cells, int(cells.max()), edge_weight=weight, connected=True).labels
    # Few pixels have no histogram that could be compared: they would stay regions of their own to the top.
    return numbered(absorb_small(settled, channels.values, int(channels.inside.sum()) // n_leaves // SETTINGS.speck))


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
