"""A tree of regions, and what is cut from it."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from cvtimg._shared.checks import (
    check_at_least,
    check_choice,
    check_count,
    check_in_range,
    check_non_negative,
    check_that,
)
from cvtimg._shared.extras import shapely
from cvtimg._shared.records import Claims, ReadOnly, equals
from cvtimg._shared.types import Array, Bools, Floats, Floats32, ImageLike, Indices, Ints, Points
from cvtimg.files.arrays import load_arrays, save_arrays
from cvtimg.files.whole import StrPath
from cvtimg.halfedges import EdgeTable
from cvtimg.labels.components import find_borders
from cvtimg.labels.contours import find_contours, simplify, strings_of
from cvtimg.pictures.files import encode_image
from cvtimg.segmentation.hierarchy.strengths import chances_of
from cvtimg.segmentation.values import dark_to_bright

_KIND = "region hierarchy"
_ARRAYS = ("leaves", "merges", "altitudes", "sizes", "colors", "means", "energies", "evidence")
#: Lines from this chance on are what people drew, with the best F on the 60 training photographs.
_CHANCE = 0.3


class Lines(NamedTuple):
    """Lines, the most likely first.

    Attributes
    ----------
    lines : tuple of (N, 2) float64 arrays
        Points (x, y) in pixels, as in `Contours`. A closed line ends where it begins; lines meet at their ends.
    chances : (L,) float64 array
        Chance that a person draws each line, the mean along it, in 0..1.
    """

    lines: tuple[Points, ...]
    chances: Floats


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RegionHierarchy(ReadOnly):
    """A tree of regions of an image.

    N leaves are small regions of similar color, numbered from 0. Merge m makes node N + m of two nodes, until every
    part of the image is one region; there are several parts only where a mask keeps them apart. Every cut of the tree
    is a partition of the image into connected regions, and of two cuts one refines the other.

    Attributes
    ----------
    leaves : (H, W) int32 array
        Leaf of each pixel, plus 1; 0 outside of the mask.
    merges : (M, 2) int32 array
        The two nodes of each merge, the lower number first.
    altitudes : (M,) float64 array
        How much the two regions of each merge differ, on a scale that is the same for all images; never falling.
    sizes : (N + M,) float64 array
        Pixels of each node.
    colors : (N + M, C) float64 array
        Mean color of each node, in the units of the image.
    means : (N + M, D) float64 array
        The same in the color space, about the mean of the image, in units in which white is 255.
    energies : (N + M,) float64 array
        Sum over the pixels of each node of the squared distance to its mean, in those units.
    evidence : (B,) float64 array
        For each border between two leaves, by their numbers, how much speaks for people drawing it, on a scale that is
        the same for all images; >= 0.
    default_threshold : float
        Where the tree is cut by default: at 0.5, the best single threshold on photographs that people had divided into
        regions, or in 0.25 .. 0.5 where hardly any border of the image is so strong but regions explain most of its
        variance, as in micrographs of many small objects.
    """

    leaves: Ints
    merges: Ints
    altitudes: Floats
    sizes: Floats
    colors: Floats
    means: Floats
    energies: Floats
    evidence: Floats
    default_threshold: float

    def _claims(self) -> Claims:
        yield "altitudes never fall", np.diff(self.altitudes) >= 0
        of_two = self.sizes[self.merges].sum(axis=1)
        yield "a region has the pixels of its two", equals(self.sizes[self.n_leaves :], of_two)

    def __repr__(self) -> str:
        height, width = self.leaves.shape
        return f"RegionHierarchy({width} x {height} pixels, {self.n_leaves} leaves)"

    def _repr_png_(self) -> bytes:
        """Draw edges, the darker the more likely a person draws them."""
        return encode_image(".png", np.rint(255 * (1 - self.find_edges(strength=True))).astype(np.uint8))

    @property
    def n_leaves(self) -> int:
        """Number of leaves, N: the most regions that a cut can have."""
        return len(self.sizes) - len(self.merges)

    @property
    def n_parts(self) -> int:
        """Number of parts that never merge: the fewest regions that a cut can have, 1 without a mask."""
        return self.n_leaves - len(self.merges)

    def n_regions(self, threshold: float | None = None) -> int:
        """Count the regions of the cut at a threshold, by default `default_threshold`."""
        return self.n_leaves - int(np.searchsorted(self.altitudes, self._threshold(threshold), side="right"))

    def cut(self, n_regions: int | None = None, *, threshold: float | None = None, min_regions: int = 1) -> Ints:
        """Cut the tree into regions.

        Parameters
        ----------
        n_regions : int, optional
            How many, in `n_parts` .. `n_leaves`.
        threshold : float, optional
            Keep regions apart that differ by more than this, >= 0. Without `n_regions`, it is `default_threshold` by
            default.
        min_regions : int
            With a threshold, the least number of regions.

        Returns
        -------
        (H, W) int32 array
            Labels from 1, sorted by the sum of the bands of the mean colors from dark to bright; 0 outside the mask.
            Regions are connected by sides of pixels.

        Examples
        --------
        >>> from cvtimg import segment_hierarchy
        >>> image = np.zeros((60, 90), np.uint8)
        >>> image[:, 30:], image[:, 60:] = 120, 255
        >>> hierarchy = segment_hierarchy(image, n_leaves=50)
        >>> hierarchy.cut(3)[0, ::15].tolist(), hierarchy.cut().max()
        ([1, 1, 2, 2, 3, 3], np.int32(3))
        """
        if n_regions is None:
            least = check_count("min_regions", min_regions, self.n_leaves, "the number of leaves")
            n_regions = max(self.n_regions(threshold), least)
        else:
            check_that("n_regions", threshold is None, "not be given with threshold")
            n_regions = check_count("n_regions", n_regions, self.n_leaves, "the number of leaves")
            n_regions = check_at_least("n_regions", n_regions, self.n_parts, "the parts that the mask leaves")
        nodes, leaf_labels = self._cut(n_regions)
        colors = self.colors[nodes]
        new_label = np.append(np.int32(0), dark_to_bright(colors, self.sizes[nodes]))
        return np.append(np.int32(0), new_label[leaf_labels])[self.leaves]

    def contour_map(self) -> Floats32:
        """Map how strongly the regions at the two sides of each border differ.

        The pixels where the map exceeds a threshold are the borders of the cut at that threshold.

        Returns
        -------
        (H, W) float32 array
            At the pixel above or to the left of each crack between leaves its strength, 0 elsewhere.

        Examples
        --------
        >>> from cvtimg import segment_hierarchy
        >>> image = np.zeros((40, 60), np.uint8)
        >>> image[:, 30:] = 200
        >>> strengths = segment_hierarchy(image, n_leaves=24).contour_map()
        >>> np.flatnonzero(strengths[20] > 0.5).tolist()
        [29]
        """
        borders = find_borders(self.leaves)
        strengths = altitudes_between(borders.pairs, self.merges, self.altitudes, self.n_leaves)
        return borders.on_pixels(strengths, self.leaves.shape)

    def find_edges(self, threshold: float | None = None, *, strength: bool = False) -> Array:
        """Find edges in an image: the borders of the cut at a threshold, thinned to lines one pixel wide.

        Parameters
        ----------
        threshold : float, optional
            Keep borders that are stronger than this, >= 0; by default, `default_threshold`. About 0.4 finds the most
            edges that people would draw for the fewest that they would not.
        strength : bool
            Return how likely a person draws each edge, of all borders unless a threshold is given.

        Returns
        -------
        (H, W) bool array; with `strength`, (H, W) float32 array
            Chances are in 0..1, and 0 beside edges.

        Notes
        -----
        Chances are ``1 / (1 + (h / e)^p)`` for the `evidence` e. The two numbers fit the share of people who drew an
        edge within 0.75 % of the diagonal, on 60 photographs of the Berkeley Segmentation Data Set. Evidence is a
        product of powers of how much the regions at both sides differ in the tree, as seen near and from afar, and of
        how strong that part of their border is. It is less at the margin of the image, and amid many other edges.

        References
        ----------
        C. Grigorescu, N. Petkov, M. Westenberg, IEEE Trans. Image Processing 12 (2003) 729-739, doi
        10.1109/TIP.2003.814250: edges amid others.

        Examples
        --------
        >>> from cvtimg import segment_hierarchy
        >>> image = np.zeros((40, 60), np.uint8)
        >>> image[:, 30:] = 200
        >>> hierarchy = segment_hierarchy(image, n_leaves=24)
        >>> np.flatnonzero(hierarchy.find_edges()[20]).tolist(), hierarchy.find_edges(strength=True)[20, 29] > 0.5
        ([29], np.True_)
        """
        from skimage.morphology import thin

        strengths = self.contour_map()
        lines = thin(strengths > (0.0 if strength and threshold is None else self._threshold(threshold)))  # type: ignore[no-untyped-call]
        if not strength:
            return np.asarray(lines)
        # Of two pixels beside each other, thinning may have kept the weaker one: it takes what the other has.
        evidence = find_borders(self.leaves).on_pixels(self.evidence, lines.shape)
        evidence = np.maximum(evidence, ndimage.maximum_filter(np.where(lines, 0, evidence), 3))
        return np.where(lines, chances_of(evidence), np.float32(0))

    def find_lines(
        self,
        chance: float = _CHANCE,
        *,
        n_lines: int | None = None,
        image: ImageLike | None = None,
        tolerance: float = 0,
    ) -> Lines:
        """Find edges as lines, each with the chance that a person draws it.

        Parameters
        ----------
        chance : float
            Least chance of the borders that are joined to lines, in 0..1; by default what finds the most edges that
            people drew for the fewest that they did not.
        n_lines : int, optional
            Keep the lines with the greatest chance times length, at most this many.
        image, tolerance
            As in `find_contours`: the image places lines with subpixel accuracy, and lines are simplified.

        Returns
        -------
        Lines
            `lines`, a tuple of (N, 2) arrays of points (x, y) in pixels, and their `chances`, falling. They end at the
            margin of the image and where three meet.

        Examples
        --------
        >>> from cvtimg import segment_hierarchy
        >>> image = np.zeros((40, 60), np.uint8)
        >>> image[:, 30:] = 200
        >>> found = segment_hierarchy(image, n_leaves=24).find_lines(tolerance=0.5)
        >>> [line.tolist() for line in found.lines], found.chances > 0.5
        ([[[30.0, 0.0], [30.0, 40.0]]], array([ True]))
        """
        check_in_range("chance", chance, 0 <= chance <= 1, "in 0..1")
        check_non_negative("tolerance", tolerance)
        most = None if n_lines is None else check_at_least("n_lines", n_lines, 1, "the most lines")
        contours = find_contours(self.leaves, image)
        border = EdgeTable(find_borders(self.leaves).pairs, self.n_leaves).find(contours.sides - 1)
        chance_of = np.where((contours.sides > 0).all(axis=1), np.append(chances_of(self.evidence), 0.0)[border], 0.0)
        kept = np.flatnonzero((chance_of >= chance) & (chance_of > 0))
        if not len(kept):
            return Lines((), np.zeros(0))
        parts = strings_of([contours.lines[line] for line in kept])
        joined = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(parts)))
        middles = shapely.line_interpolate_point(parts, 0.5, normalized=True)
        of_part = shapely.STRtree(joined).query_nearest(middles, all_matches=False)[1]
        lengths = shapely.length(parts)
        drawn = np.bincount(of_part, chance_of[kept] * lengths)
        means = drawn / np.bincount(of_part, lengths)
        order = np.argsort(-drawn, kind="stable")[:most]
        order = order[np.argsort(-means[order], kind="stable")]
        lines = [shapely.get_coordinates(line) for line in joined]
        simple = simplify(lines, tolerance) if tolerance else lines
        return Lines(tuple(simple[line] for line in order), means[order])

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the hierarchy as .npz, whole or not at all.

        Parameters
        ----------
        path : str or path-like
            Ends in .npz.
        overwrite : bool
            Replace an existing file.
        """
        check_choice("suffix", Path(path).suffix.lower(), (".npz",))
        arrays = {name: getattr(self, name) for name in ("default_threshold", *_ARRAYS)}
        save_arrays(path, _KIND, arrays, compressed=True, overwrite=overwrite)

    @classmethod
    def load(cls, path: StrPath) -> RegionHierarchy:
        """Read a hierarchy that `save` wrote.

        Raises
        ------
        ValueError
            If the file holds something else.
        OSError
            If it cannot be read.
        """
        arrays: dict[str, Any] = load_arrays(path, _KIND, ("default_threshold", *_ARRAYS))
        return cls(**arrays | {"default_threshold": float(arrays["default_threshold"])})

    def divide(self, leaves: NDArray[np.integer]) -> Bools:
        """Return which of the N leaves are on one side of the last merge of some leaves (n >= 2), from 0."""
        sizes = range(self.n_parts, self.n_leaves + 1)
        apart = bisect_left(sizes, True, key=lambda n: len(np.unique(self._cut(n)[1][leaves])) > 1)
        parts = self._cut(sizes[apart])[1]
        return parts == parts[leaves].max()

    def _threshold(self, threshold: float | None) -> float:
        return self.default_threshold if threshold is None else check_non_negative("threshold", threshold)

    def _cut(self, n_regions: int) -> tuple[Indices, Ints]:
        """Return the nodes of a cut, and for each leaf the number, from 1, of the one that it is part of."""
        n_merges = self.n_leaves - n_regions
        roots = parents_of(self.merges[:n_merges], self.n_leaves)
        numbers = np.arange(len(roots))
        nodes = np.flatnonzero(roots == numbers)
        while len(nodes) < len(roots) and (roots != (above := roots[roots])).any():
            roots = above
        label_of = np.zeros(len(roots), np.int32)
        label_of[nodes] = np.arange(1, len(nodes) + 1)
        return nodes, label_of[roots[: self.n_leaves]]


def parents_of(merges: Ints, n_leaves: int) -> Indices:
    """Return the node that each node becomes part of by these merges, or its own number."""
    parents = np.arange(n_leaves + len(merges))
    parents[merges.ravel()] = np.repeat(np.arange(n_leaves, len(parents)), 2)
    return parents


def altitudes_between(pairs: Ints, merges: Ints, altitudes: Floats, n_leaves: int) -> Floats:
    """(B,) altitudes at which pairs of leaves come to be in one region."""
    parents = parents_of(merges, n_leaves)
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    while (apart := low != high).any():
        # The lower of two nodes is not above the other.
        above = np.where(apart, parents[low], low)
        low, high = np.minimum(above, high), np.maximum(above, high)
    return altitudes[low - n_leaves]
