"""Segmentation of images larger than memory: strip by strip, with the cells of the whole image.

The first pass counts colors and stores the pixels beside the target, so that later passes can read them downward and
upward. All that follows goes over these files strip by strip. The edge-weighted descent visits pixels in the same
order and with the same sums as in memory, so that strips leave no seams.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice, check_count, check_edge_weight
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
from cvtimg.segmentation.edge_weight import State, settle
from cvtimg.segmentation.noise import BLOCK, block_covariances, quiet_covariance
from cvtimg.segmentation.prepared import auto_weight, blur_at_start
from cvtimg.segmentation.values import dark_to_bright, in_order

__all__ = ["SegmentedFile", "segment_file"]

#: Labels have 8 or 16 bits, and 0 is outside the mask.
_MOST_SEGMENTS = 65535
#: Number of blocks from which noise is estimated; with more, some rows of blocks are left out.
_NOISE_BLOCKS = 1 << 18
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
    edge_weight: float | str = 0,
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
    space, edge_weight, edge_radius, effort, rng
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
    segment_blocks : Dask arrays.

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
    check_count("edge_radius", edge_radius, 30, "the largest disc")
    check_choice("space", space, SPACES)
    weight = check_edge_weight(edge_weight)
    bands = open_bands(source)
    has_alpha = bands.form.alpha if has_alpha is None else has_alpha
    nodata = bands.form.nodata if nodata is None else nodata
    with scratch_folder(target) as folder, ExitStack() as stack:
        picture = DiskValues(bands, folder / "pixels", space, has_alpha=has_alpha, nodata=nodata, mask=mask)
        stack.callback(picture.close)
        noise = np.zeros((1, 1)) if weight == 0 else _noise(picture)
        if weight is None:
            weight = auto_weight(noise, edge_radius)
        blur = blur_at_start(picture.variance, noise, min(n_segments, picture.values.samples.n_colors))
        start = _Start(picture, Averaging("before", "gaussian", blur) if blur else None)
        tessellation = start.tessellate(n_segments, effort, rng)
        cells = _LabelsOnDisk(picture, folder, edge_radius if weight else 1)
        stack.callback(cells.close)
        cells.put(start.labels(tessellation))
        energies, converged = cells.settle(len(tessellation.generators), weight)
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


def _noise(picture: DiskValues) -> NDArray[np.float64]:
    """(D, D) covariance of the noise, from all rows of blocks or from enough of them."""
    height, width = picture.shape
    if min(height, width) < BLOCK + 2:
        values, inside = picture.read(0, height)
        sides = [min(BLOCK, max(side - 2, 1)) for side in picture.shape]
        return quiet_covariance(block_covariances(values, inside), sides[0] * sides[1])
    n_rows, n_columns = (height - 2) // BLOCK, (width - 2) // BLOCK
    rows = range(0, n_rows, -(-n_rows * n_columns // _NOISE_BLOCKS))
    found = [block_covariances(*picture.read(BLOCK * row, BLOCK * row + BLOCK + 2)) for row in rows]
    return quiet_covariance(np.concatenate(found), BLOCK**2)


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
        self.on_disk = {
            name: DiskRows(folder / name, shape, dtype)
            for name, dtype in (("labels", np.int32), ("others", np.uint16), ("stale", np.uint8))
        }

    def put(self, strips: Iterable[NDArray[np.int32]]) -> None:
        top = self.radius
        for strip in strips:
            self.on_disk["labels"].write(top, np.pad(strip, ((0, 0), (self.radius, self.radius))))
            top += len(strip)

    def settle(self, n_segments: int, edge_weight: float) -> tuple[tuple[float, ...], bool]:
        """Measure the cells, after the descent if there is an edge weight."""
        shape = (self.picture.shape[1], self.picture.n_dims)
        self.state = State(self._strips, shape, n_segments, self.radius)
        if edge_weight:
            self.state.begin()
            return settle(self.state, edge_weight)
        self.state.measure()
        self.state.measure()
        return (), True

    def _strips(self, backward: bool) -> Iterator[_Strip]:
        strips = self.picture.strips
        return (_Strip(self, *ends) for ends in (reversed(strips) if backward else strips))

    def labels(self, new_label: NDArray[np.unsignedinteger]) -> Iterator[NDArray[np.unsignedinteger]]:
        """Yield strips of labels, renumbered."""
        frame = slice(self.radius, -self.radius)
        return (new_label[strip.labels[frame, frame]] for strip in self._strips(False))

    def close(self) -> None:
        for rows in self.on_disk.values():
            rows.close()


class _Strip:
    """Some rows of cells, each array read when it is first used."""

    weights = None

    def __init__(self, cells: _LabelsOnDisk, first: int, last: int) -> None:
        self._cells, self._first, self._last = cells, first, last
        self._rows: dict[str, NDArray[Any]] = {}

    def _read(self, name: str) -> NDArray[Any]:
        if name not in self._rows:
            self._rows[name] = self._cells.on_disk[name].read(self._first, self._last + 2 * self._cells.radius)
        return self._rows[name]

    @cached_property
    def values(self) -> NDArray[np.float32]:
        return self._cells.picture.read(self._first, self._last)[0]

    @property
    def labels(self) -> NDArray[np.int32]:
        return self._read("labels")

    @property
    def others(self) -> NDArray[np.uint16]:
        return self._read("others")

    @property
    def stale(self) -> NDArray[np.uint8]:
        return self._read("stale")

    def save(self) -> None:
        """Write back what was read."""
        for name, rows in self._rows.items():
            self._cells.on_disk[name].write(self._first, rows)
