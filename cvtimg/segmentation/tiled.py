"""Segmentation of images larger than memory: strip by strip, with the cells of the whole image.

The first pass counts colors and stores the pixels beside the target, so that later passes can read them downward and
upward. All that follows goes over these files strip by strip. The edge-weighted descent visits pixels in the same
order and with the same sums as in memory, so that strips leave no seams.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice, check_count
from cvtimg._shared.choices import EffortName, SpaceName
from cvtimg.colors.counting import Counter
from cvtimg.colors.samples import ColorSamples
from cvtimg.colors.spaces import SPACES
from cvtimg.engine.points import assign, pack
from cvtimg.engine.tessellation import Tessellation, tessellate
from cvtimg.files.whole import StrPath, scratch_folder
from cvtimg.pictures.tiles import TILED_SUFFIXES, Form, open_bands, write_bands
from cvtimg.segmentation.averaging import TRUNCATE, Averaging, averaged
from cvtimg.segmentation.disk_values import DiskRows, DiskValues
from cvtimg.segmentation.edge_weight import Layers, State, greatest_step, settle, weight_of_detail
from cvtimg.segmentation.noise import noise_of_rows
from cvtimg.segmentation.prepared import Smoothness, auto_weight, blur_at_start
from cvtimg.segmentation.values import dark_to_bright, in_order

__all__ = ["SegmentedFile", "segment_file"]

#: Labels have 8 or 16 bits, and 0 is outside the mask.
_MOST_SEGMENTS = 65535
#: Number of levels by which an averaged image is counted.
_LEVELS = 255


@dataclass(frozen=True, slots=True, eq=False)
class SegmentedFile:
    """The result of segmenting an image on disk.

    Attributes
    ----------
    generators, masses, energy, energies, edge_weight, converged
        As in `Segmentation`.
    shape : tuple of int
        Shape of the image: (H, W) or (H, W, C).
    exact : bool
        Whether segments start from all distinct colors of the image, or of its averages in 255 levels. Of more than
        2^22, similar ones are merged.
    """

    generators: NDArray[np.float64]
    masses: NDArray[np.float64]
    energy: float
    energies: tuple[float, ...]
    edge_weight: float
    converged: bool
    shape: tuple[int, ...]
    exact: bool

    @property
    def n_segments(self) -> int:
        """Number of segments, K."""
        return len(self.generators)

    def __repr__(self) -> str:
        size = " x ".join(map(str, self.shape[1::-1]))
        return f"SegmentedFile({self.n_segments} segments of {size} pixels, energy={self.energy:.6g})"


def segment_file(
    source: StrPath,
    target: StrPath,
    n_segments: int,
    *,
    space: SpaceName = "rgb",
    smallest_detail: float = 1,
    edge_weight: float | str = "auto",
    edge_radius: int = 3,
    has_alpha: bool | None = None,
    nodata: float | None = None,
    mask: StrPath | None = None,
    effort: EffortName = "balanced",
    rng: int | np.random.Generator = 0,
    overwrite: bool = False,
) -> SegmentedFile:
    """Divide an image on disk, of any size, into segments of similar color.

    Segments are those of the whole image, without seams. Memory does not grow with the image, as in `quantize_file`.
    Until the end, the folder of the target needs room for the uncompressed pixels and 4 bytes more per pixel, 7 with an
    edge weight.

    Parameters
    ----------
    source : path
        A TIFF in tiles or strips (BigTIFF too), or a Zarr array in a folder that ends in .zarr: any integer type,
        float32 or float64, (H, W) or (H, W, C). Pixels that are NaN or infinite in any band are left out.
    target : path
        Ends in .tif, .tiff or .zarr. Labels start at 1, from dark to bright; 0 marks pixels that are left out. They
        have 8 bits for up to 255 segments, otherwise 16. A TIFF keeps its georeference.
    n_segments : int
        K, in 1..65535.
    space, smallest_detail, edge_weight, edge_radius, effort, rng
        As in `segment`.
    has_alpha : bool, optional
        Whether the last band is alpha; pixels where it is 0 are left out. By default what the file says.
    nodata : float, optional
        Pixels with this value in all bands are left out; by default what the file says.
    mask : path, optional
        Image of the same size, whose black pixels are left out.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    SegmentedFile

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it.
    OSError
        If a file cannot be read in tiles or written.

    See Also
    --------
    segment : An image in memory.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from cvtimg import read_image, write_image
    >>> from cvtimg.segmentation import segment_file
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.tif", np.array([[10, 12, 200], [11, 202, 201]], np.uint8))
    ...     result = segment_file(f"{folder}/a.tif", f"{folder}/b.tif", 2)
    ...     read_image(f"{folder}/b.tif").tolist(), result.generators.ravel().tolist()
    ([[1, 1, 2], [1, 2, 2]], [11.0, 201.0])
    """
    check_choice(f"{target}: suffix", Path(target).suffix.lower(), TILED_SUFFIXES)
    check_count("n_segments", n_segments, _MOST_SEGMENTS, "the most labels of 16 bits")
    check_choice("space", space, SPACES)
    smoothness = Smoothness.checked(None, edge_weight, edge_radius, smallest_detail)
    weight, detail = smoothness.edge_weight, 0.0
    bands = open_bands(source)
    has_alpha = bands.form.alpha if has_alpha is None else has_alpha
    nodata = bands.form.nodata if nodata is None else nodata
    with scratch_folder(target) as folder:
        picture = DiskValues(bands, folder / "pixels", space, has_alpha=has_alpha, nodata=nodata, mask=mask)
        noise = np.zeros((1, 1)) if weight == 0 else noise_of_rows(picture.read, picture.shape)
        if weight is None:
            weight, detail = auto_weight(noise, edge_radius), smoothness.smallest_detail
        blur = blur_at_start(picture.variance, noise, min(n_segments, picture.values.samples.n_colors))
        start = _Start(picture, Averaging("before", "gaussian", blur) if blur else None)
        tessellation = start.tessellate(n_segments, effort, rng)
        cells = _LabelsOnDisk(picture, folder, edge_radius)
        cells.put(start.labels(tessellation))
        weight, energies, converged = cells.settle(len(tessellation.generators), weight, detail)
        generators = picture.values.to_picture(cells.state.cells.means[1:] + picture.values.center)
        masses = cells.state.cells.masses[1:, 0]
        new_label = dark_to_bright(generators, masses)
        dtype = np.dtype(np.uint8 if new_label.max() <= 255 else np.uint16)
        form = Form(bands.form.shape[:2], dtype, geo=bands.form.geo, nodata=0 if bands.form.geo else None)
        write_bands(target, form, cells.labels(np.append(0, new_label).astype(dtype)), overwrite=overwrite)
    order = in_order(new_label)
    unit = picture.values.unit**2
    if not weight:
        energies, converged = tuple(e * start.scale**2 for e in tessellation.energies), tessellation.converged
    return SegmentedFile(
        generators=generators[order],
        masses=masses[order],
        energy=float(cells.state.cells.energies.sum()) / unit,
        energies=tuple(energy / unit for energy in energies),
        edge_weight=weight,
        converged=converged,
        shape=bands.form.shape,
        exact=picture.exact and start.exact,
    )


class _Start:
    """The initial segments: of the image, or of its averages if it is noisy."""

    def __init__(self, picture: DiskValues, average: Averaging | None) -> None:
        self._picture, self._average = picture, average
        self._halo = int(TRUNCATE * average.radius + 0.5) if average else 0
        self.samples, self.scale, self._offset = picture.values.samples, picture.values.scale, -picture.values.center
        self.exact = True
        if average:
            self.samples = self._count()

    def _count(self) -> ColorSamples:
        """Count the averages, in levels of the range of the colors."""
        places = self.samples.colors * self.scale + self._offset
        low, high = float(places.min()), float(places.max())
        self.scale, self._offset = (high - low) / _LEVELS, np.full(places.shape[1], low)
        counter = Counter()
        for values, inside in self._strips():
            counter.add(np.rint((values[inside] - low) / self.scale).astype(np.uint8)[None])
        count = counter.total()
        self.exact = count.exact
        return count.of_some()

    def _strips(self) -> Iterator[tuple[NDArray[np.float32], NDArray[np.bool_]]]:
        """Yield strips of values, averaged if asked for, and the mask of each."""
        for first, last in self._picture.strips:
            above, below = max(first - self._halo, 0), min(last + self._halo, self._picture.shape[0])
            values, inside = self._picture.read(above, below)
            own = slice(first - above, last - above)
            if self._average:
                values = averaged(values, self._average, inside)
            yield values[own], inside[own]

    def tessellate(self, n_segments: int, effort: EffortName, rng: int | np.random.Generator) -> Tessellation:
        n_most = min(n_segments, self.samples.n_colors)
        return tessellate(self.samples, n_most, effort=effort, rng=rng)

    def labels(self, tessellation: Tessellation) -> Iterator[NDArray[np.int32]]:
        """Yield strips of labels, those of the nearest generators."""
        generators = tessellation.generators * self.scale + self._offset
        origin = np.zeros(generators.shape[1])  # the same for all strips, so that ties are broken alike
        for values, inside in self._strips():
            labels = np.zeros(inside.shape, np.int32)
            rows = values[inside]
            if len(rows):
                points = pack(rows, np.ones(len(rows)), center=origin)
                labels[inside] = assign(points, points.frame.inward(generators))[: len(rows)] + 1
            yield labels


class _LabelsOnDisk:
    """Labels on disk in a frame of zeros, and the counts that the descent keeps up to date with them."""

    def __init__(self, picture: DiskValues, folder: Path, radius: int) -> None:
        self.picture, self.radius = picture, radius
        shape = tuple(side + 2 * radius for side in picture.shape)
        kinds = {"labels": np.int32, "others": np.uint16, "stale": np.uint8}
        self._layers = Layers(picture, None, *(DiskRows(folder / name, shape, kinds[name]) for name in kinds))

    def _own(self, first: int, last: int) -> NDArray[np.int32]:
        """Return the labels of rows, without the frame."""
        framed: NDArray[np.int32] = self._layers.labels[first + self.radius : last + self.radius]
        return framed[:, self.radius : -self.radius]

    def put(self, strips: Iterable[NDArray[np.int32]]) -> None:
        for ends, strip in zip(self.picture.strips, strips, strict=True):
            self._own(*ends)[:] = strip

    def settle(self, n_segments: int, weight: float, detail: float) -> tuple[float, tuple[float, ...], bool]:
        """Measure the cells, after the descent if there is an edge weight; return that, the energies and the end."""
        shape = (self.picture.shape[1], self.picture.n_dims)
        self.state = State(self._layers, self.picture.strips, shape, n_segments, self.radius)
        self.state.measure()  # about the origin, to find the means
        self.state.measure()
        first = 0.0
        if detail:
            means, shares = self.state.cells.means[1:], np.ones(n_segments)
            strips = (self._own(first, last + 1) for first, last in self.picture.strips)
            worth = max(greatest_step(strip, means, shares) for strip in strips)
            worth *= weight_of_detail(detail, self.radius)
            weight, first = max(weight, worth), 2 * worth
        if not weight:
            return 0.0, (), True
        self.state.begin()
        if first > weight:
            settle(self.state, first)
            self.state.wake()
        return weight, *settle(self.state, weight)

    def labels(self, new_label: NDArray[np.unsignedinteger]) -> Iterator[NDArray[np.unsignedinteger]]:
        """Yield strips of labels, renumbered."""
        return (new_label[self._own(*ends)] for ends in self.picture.strips)
