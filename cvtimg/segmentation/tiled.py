"""Segmentation of images larger than memory: strip by strip, with the cells of the whole image.

The first pass counts colors and stores the pixels beside the target, so that later passes can read them downward and
upward. All that follows goes over these files strip by strip. The edge-weighted descent visits pixels in the same
order and with the same sums as in memory, so that strips leave no seams.
"""

from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from cvtimg._shared.checks import check_choice, check_count
from cvtimg._shared.choices import EffortName, SpaceName
from cvtimg._shared.types import Array, Bools, Floats, Floats32, Ints
from cvtimg.colors.counting import Count
from cvtimg.colors.samples import color_samples
from cvtimg.colors.spaces import SPACES
from cvtimg.engine.points import assign, pack
from cvtimg.engine.tessellation import tessellate
from cvtimg.files.whole import StrPath, scratch_folder
from cvtimg.pictures.stacks import Stack, open_stack
from cvtimg.pictures.tiles import TILED_SUFFIXES, Form, write_bands
from cvtimg.segmentation.edge_weight import Layers, Moves, State
from cvtimg.segmentation.frames import frame_of
from cvtimg.segmentation.noise import TRUNCATE, averaged, noise_of_rows
from cvtimg.segmentation.prepared import LARGEST_RADIUS, Smoothness, blur_at_start
from cvtimg.segmentation.result import SegmentedFile, sorted_ends
from cvtimg.segmentation.values import at_pixels, values_of

#: Averages of a noisy image from which its segments start, or a few more: time grows with them.
_ENOUGH_AVERAGES = 1 << 20
#: Pixels of a strip: values, labels and temporary arrays take about 100 bytes of memory for each.
STRIP_PIXELS = 1 << 21
#: Pixels at most of an image whose rows and columns may change places: strips of it are then read from all rows.
_MOST_TO_TURN = 1 << 26


def segment_file(
    source: StrPath,
    target: StrPath,
    n_segments: int,
    *,
    space: SpaceName = "rgb",
    smallest_detail: float | str = "auto",
    edge_weight: float | str = "auto",
    edge_radius: int = 3,
    nodata: float | None = None,
    mask: StrPath | None = None,
    max_pixels: int | None = None,
    effort: EffortName = "balanced",
    rng: int | np.random.Generator = 0,
    overwrite: bool = False,
) -> SegmentedFile:
    """Divide an image on disk, of any size, into segments of similar color.

    Segments are those of the whole image, without seams. Memory does not grow with the image, as in `quantize_file`.
    Until the end, the folder of the target needs room for the uncompressed pixels and 10 bytes more per pixel.

    Parameters
    ----------
    source : path
        A TIFF in tiles or strips (BigTIFF too), or a Zarr array in a folder that ends in .zarr: any integer type,
        float32 or float64, (H, W) or (H, W, C). Pixels that are NaN or infinite in any band are left out, and those
        where a band of alpha is 0.
    target : path
        Ends in .tif, .tiff or .zarr. Labels start at 1, from dark to bright; 0 marks pixels that are left out. They
        have 8 bits for up to 255 segments, otherwise 16. A TIFF keeps its georeference.
    n_segments : int
        K, in 1..65535.
    space, smallest_detail, edge_weight, edge_radius, effort, rng
        As in `segment`.
    nodata : float, optional
        Pixels with this value in all bands are left out; by default what the file says.
    mask : path, optional
        Image of the same size, whose black pixels are left out.
    max_pixels : int, optional
        Refuse images of more pixels.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    SegmentedFile

    Raises
    ------
    OSError
        If a file cannot be read in tiles or written.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg import read_image, write_image
    >>> from cvtimg.segmentation import segment_file
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.tif", np.array([[10, 12, 200], [11, 202, 201]], np.uint8))
    ...     result = segment_file(f"{folder}/a.tif", f"{folder}/b.tif", 2)
    ...     read_image(f"{folder}/b.tif").tolist(), result.generators.ravel().tolist()
    ([[1, 1, 2], [1, 2, 2]], [11.0, 201.0])
    """
    check_choice(f"{target}: suffix", Path(target).suffix.lower(), TILED_SUFFIXES)
    n_segments = check_count("n_segments", n_segments, 65535, "the most labels of 16 bits")
    check_choice("space", space, SPACES)
    smoothness = Smoothness.checked(0, edge_weight, edge_radius, smallest_detail, effort=effort)
    stack = open_stack(source, mask, nodata, tiles=True, max_pixels=max_pixels)
    with scratch_folder(target) as folder:
        picture = PixelsOnDisk(stack, folder, space)
        samples: Any = picture.values.samples
        scale, origin = picture.values.scale, picture.values.center
        noise = np.zeros((1, 1)) if edge_weight == 0 else noise_of_rows(picture.read, picture.shape)
        weight, detail = smoothness.edge_weight_for(noise)
        n_cells = min(n_segments, samples.n_colors)
        blur = blur_at_start(picture.values.variance, noise, n_cells)
        if blur:
            samples, scale, origin = picture.averages(blur), 1.0, np.zeros_like(origin)
        cells = tessellate(samples, n_cells, effort=effort, rng=rng)
        layers = picture.layers(folder, edge_radius)
        inner = slice(edge_radius, -edge_radius)
        nearest = picture.nearest(cells.generators * scale - origin, blur)
        for (first, last), labels in zip(picture.strips, nearest, strict=True):
            layers.labels[first + edge_radius : last + edge_radius][:, inner] = labels
        moves = Moves(edge_radius, **smoothness.moves(weight, len(cells.generators)))
        state = State(layers, (*picture.shape, len(origin)), len(cells.generators), moves)
        energies, converged = tuple(energy * scale**2 for energy in cells.energies), cells.converged
        if weight or detail:
            energies, weight, converged = state.descend(weight, detail)
        energy = float(state.cells.energies.sum())
        means, masses = state.cells.means[1:], state.cells.masses[1:, 0]
        new_label, ends = sorted_ends(picture.values, means, masses, energy, energies)
        bands: Form = stack.content.form
        dtype = np.dtype(np.uint8 if new_label.max() <= 255 else np.uint16)
        form = Form(bands.shape[:2], dtype, geo=bands.geo, nodata=0 if bands.geo else None)
        numbers = np.append(0, new_label).astype(dtype)
        end = RowsOnDisk(folder / "end", bands.shape[:2], dtype)
        for first, last in picture.strips:
            rows = layers.labels[first + edge_radius : last + edge_radius][:, inner]
            picture.frame.of(end[:])[first:last] = numbers[rows]
        height = picture.strips[0][1]
        own = (end[first : first + height] for first in range(0, bands.shape[0], height))
        write_bands(target, form, own, overwrite=overwrite)
    return SegmentedFile(edge_weight=weight, converged=converged, shape=bands.shape, exact=picture.exact, **ends)


class RowsOnDisk:
    """An array of zeros in a file, of which slices of rows are mapped into memory."""

    def __init__(self, path: Path, shape: tuple[int, ...], dtype: DTypeLike) -> None:
        self.shape, self.dtype, self._path = shape, np.dtype(dtype), path
        self._n_bytes = prod(shape[1:]) * self.dtype.itemsize
        with path.open("wb") as file:  # takes the room now: a full disk is an error here, but ends a program that maps
            for _ in range(shape[0]):
                file.write(bytes(self._n_bytes))

    def __getitem__(self, rows: slice) -> Array:
        first, last, _ = rows.indices(self.shape[0])
        shape = (last - first, *self.shape[1:])
        return np.memmap(self._path, self.dtype, "r+", first * self._n_bytes, shape)


class PixelsOnDisk:
    """The pixels of an image in an uncompressed file, which of them count, and their colors."""

    # `strips` are the rows to hold in memory at a time, `values` the colors of all pixels inside, and `exact` says
    # whether they distinguish all.

    def __init__(self, stack: Stack, folder: Path, space: SpaceName) -> None:
        form = stack.content.form
        n_dims = (form.shape[2] if len(form.shape) > 2 else 1) - form.alpha
        self._pixels = RowsOnDisk(folder / "pixels", (*form.shape[:2], n_dims), form.dtype)
        self._inside = RowsOnDisk(folder / "inside", form.shape[:2], np.bool_)
        count, top = Count(), 0
        for band, known in stack:
            colors = band.reshape(*known.shape, -1)
            colors = colors[:, :, :-1] if form.alpha else colors
            seen = known & (band[:, :, -1] > 0) if form.alpha else known
            rows = slice(top, top + len(band))
            self._pixels[rows][:], self._inside[rows][:] = colors, seen
            if seen.any():
                count = count.plus(color_samples(colors if seen.all() else colors[seen][None], alpha=False))
            top += len(band)
        self.exact = count.exact
        self.values = values_of(count.of_some("is known"), np.empty((0, 0), np.bool_), space, form.dtype)
        self.frame = frame_of(self._pixels[:], self._inside[:], prod(form.shape[:2]) <= _MOST_TO_TURN)
        height, width = self.shape = self.frame.of(self._inside[:]).shape
        n_rows = max(STRIP_PIXELS // width, LARGEST_RADIUS + 1)  # more than the largest disc of neighbors reaches
        self.strips = [(first, min(first + n_rows, height)) for first in range(0, height, n_rows)]
        self._center = self.values.center

    def read(self, first: int, last: int) -> tuple[Floats32, Bools]:
        """Return (H, W, D) values of some rows about the mean of all, 0 outside, and (H, W) where they are known."""
        colors, inside = (self.frame.of(pixels[:])[first:last] for pixels in (self._pixels, self._inside))
        rows = colors.reshape(inside.size, -1) if inside.all() else colors[inside]
        return at_pixels(self.values.of_colors(rows, self._center), inside), inside

    def __getitem__(self, rows: slice) -> Floats32:
        return self.read(rows.start, rows.stop)[0]

    def layers(self, folder: Path, margin: int) -> Layers:
        """Return the values, and labels of 0 with what the descent knows about them."""
        shape = tuple(side + 2 * margin for side in self.shape)
        kinds = {"labels": np.int32, "others": np.uint16, "stale": np.uint8}
        return Layers(self, None, *(RowsOnDisk(folder / name, shape, kinds[name]) for name in kinds))

    def blurred(self, blur: float) -> Iterator[tuple[Floats32, Bools]]:
        """Yield strips of values, averaged by a Gaussian unless the blur is 0, and the mask of each."""
        halo = int(TRUNCATE * blur + 0.5)
        for first, last in self.strips:
            above = max(first - halo, 0)
            values, inside = self.read(above, min(last + halo, self.shape[0]))
            within = slice(first - above, last - above)
            yield (averaged(values, blur, inside) if blur else values)[within], inside[within]

    def averages(self, blur: float) -> Floats32:
        """(N, D) averages: of a large image, those of pixels at even steps."""
        step = max(int(self.values.samples.density.sum()) // _ENOUGH_AVERAGES, 1)
        return np.concatenate([values[inside][::step] for values, inside in self.blurred(blur)])

    def nearest(self, generators: Floats, blur: float) -> Iterator[Ints]:
        """Yield strips of labels, those of the generators nearest to the averages."""
        origin = np.zeros(generators.shape[1])  # the same for all strips, so that ties are broken alike
        for values, inside in self.blurred(blur):
            labels = np.zeros(inside.shape, np.int32)
            rows = values[inside]
            if len(rows):
                points = pack(rows, np.ones(len(rows)), center=origin)
                labels[inside] = assign(points, points.frame.inward(generators))[: len(rows)] + 1
            yield labels
