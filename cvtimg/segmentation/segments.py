"""Segmentation: the tessellation of the colors of an image carried to its pixels, for clean and for noisy images."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_choice, check_count, check_excluded, check_non_negative
from cvtimg._shared.choices import EffortName, SpaceName
from cvtimg._shared.progress import part
from cvtimg._shared.sums import contiguous, take_rows
from cvtimg._shared.types import Array, Bools, Floats32, ImageLike, Ints
from cvtimg.colors.spaces import SPACES
from cvtimg.elbow.rules import CHORD_ENDS
from cvtimg.engine.tessellation import tessellate
from cvtimg.labels.components import absorb_small, connected_pieces
from cvtimg.segmentation.counting import checked_bands
from cvtimg.segmentation.edge_weight import Planes, length_cost
from cvtimg.segmentation.frames import Frame, frame_of
from cvtimg.segmentation.prepared import Smoothness, curve_of_segments
from cvtimg.segmentation.result import Segmentation, from_labels
from cvtimg.segmentation.touching import Objects
from cvtimg.segmentation.values import at_pixels, picture_values


def segment(
    image: ImageLike,
    n_segments: int | Literal["auto"],
    *,
    space: SpaceName = "rgb",
    shading: bool = False,
    averaging: float = 0,
    smallest_detail: float | str = "auto",
    edge_weight: float | str = "auto",
    edge_radius: int = 3,
    volume_power: float = 0,
    components: bool = False,
    min_size: int = 0,
    objects: bool | Objects = False,
    spacing: Sequence[float] | None = None,
    mask: ArrayLike | None = None,
    effort: EffortName = "balanced",
    rng: int | np.random.Generator = 0,
) -> Segmentation:
    """Divide an image into segments of similar color.

    Labels depend on neither the type nor the scale of the image: an 8-bit image and the same image in 16 bits or in
    floating point have the same segments. Weights are in squared 8-bit levels: they count as if white,
    which is the largest integer of the type and 1 in floating point, were 255 in any space.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image; with `spacing`, (Z, H, W) or (Z, H, W, C) array
        Any integer or floating point type, with any number of bands. Pixels that are NaN or infinite in any band, or
        masked in a masked array, are left out.
    n_segments : int or "auto"
        The most segments; there are fewer if some are not worth their edges, or if there are fewer colors. "auto" takes
        the elbow of the energies of 1, 2, ... segments, `curve` of the result, with averaging and the cost of edges.
    space : {"rgb", "linear", "lab", "oklab"}
        Color space in which distances are measured. All but "rgb" need 1 or 3 bands.
    shading : bool
        Take uneven light out first: a factor that varies slowly across the image, found together with the segments.
    averaging : float
        For noisy images and fine texture: average the image by a Gaussian of this standard deviation first, in pixels,
        at most 1000.
    smallest_detail : float or "auto"
        Radius in pixels (>= 0) of the smallest detail that counts: edges cost enough that smaller discs are not worth
        theirs, even where the contrast is greatest, and larger ones are. With 0, only noise is taken away. "auto" keeps
        what describes the image in fewer bits, by the variance in each segment and the length of its edges: dots and
        lines of a pixel where all is quiet, and little of a texture. Edges then cost at most as with 1.
    edge_weight : float or "auto"
        Penalty (>= 0) for each pair of near pixels in different segments; larger values give smoother and shorter
        edges: segments are then those of low energy, the sum of squared distances to generators and of these costs.
        "auto" follows `smallest_detail`, and the noise of the image where that needs more. With 0, each pixel
        has the generator nearest to its color, with all specks.
    edge_radius : int
        Pixels are near each other up to this distance, in pixels.
    volume_power : float
        Weight segments by their size to this power, as in `tessellate`; 0 weighs all the same.
    components : bool
        Make each connected piece of a segment a segment of its own. `n_segments` is then the number of colors.
    min_size : int
        Merge pieces of fewer pixels into the neighbor that raises the energy least. Only pieces that the mask
        separates from all others remain.
    objects : bool or Objects
        Take all segments but the largest, the background, for objects: each gets a label of its own, touching ones are
        split at their necks, and the background gets label 0. See `Objects` for other backgrounds and necks.
    spacing : (float, float, float), optional
        Distances of voxels along Z, H and W in any unit, for a volume of square pixels: the last two are the same. Near
        pixels are then those in a ball, and details are balls. Not with `shading`, `averaging`, `components`,
        `min_size` and `objects`, which know planes alone; `count_objects` finds objects in volumes.
    mask : array of the size of the image, optional
        Pixels to segment: those where the mask is not 0. The others have label 0 and no influence.
    effort, rng
        As in `tessellate`. With "best", regions also move in finer parts, and twice.

    Returns
    -------
    Segmentation

    References
    ----------
    Q. Du, M. Gunzburger, L. Ju, X. Wang, J. Math. Imaging Vision 24 (2006) 177-194, doi 10.1007/s10851-005-3620-4.
    J. Wang, L. Ju, X. Wang, IEEE Transactions on Image Processing 18 (2009) 1844-1858, doi 10.1109/TIP.2009.2021087:
    edge weight. Y. Boykov, O. Veksler, R. Zabih, IEEE Trans. Pattern Analysis and Machine Intelligence 23 (2001)
    1222-1239, doi 10.1109/34.969114: moves of regions by minimum cuts. Y. Leclerc, Int. J. Computer Vision 3 (1989)
    73-102, doi 10.1007/BF00054839: least description.

    Examples
    --------
    >>> from cvtimg import segment
    >>> image = np.zeros((20, 30), np.uint8)
    >>> image[:, 12:] = 200
    >>> image[5, 5] = 180  # a speck
    >>> result = segment(image, 2, smallest_detail=1)
    >>> np.unique(result.labels, return_counts=True)[1].tolist()
    [240, 360]
    """
    of_planes = {"shading": shading, "averaging": averaging, "components": components, "min_size": min_size}
    check_excluded("spacing", spacing is not None, **of_planes, objects=objects)
    check_excluded("objects", bool(objects), components=components)
    size, color_space = int(check_non_negative("min_size", min_size)), check_choice("space", space, SPACES)
    if n_segments != "auto":
        n_segments = check_count("n_segments", n_segments, 1 << 16, "the largest number of segment colors")
    bands, known, size_of_voxels = checked_bands(image, spacing, mask)
    shape, planes, frame = known.shape, None, frame_of(bands, known)
    bands, known = contiguous(frame.of(bands)), contiguous(frame.of(known))
    framed = known.shape
    if spacing is not None:
        bands, known, planes = below_each_other(bands, known, size_of_voxels[0], edge_radius)
    smoothness = Smoothness.checked(averaging, edge_weight, edge_radius, smallest_detail, volume_power, planes, effort)
    values = picture_values(bands, color_space, known)
    shaded = (2 if n_segments == "auto" else min(n_segments, values.samples.n_colors)) if shading else 0
    prepared = smoothness.prepare(values, shaded)
    curve = None
    if n_segments == "auto":
        with part(0, 0.4):  # of the time
            curve = curve_of_segments(prepared, CHORD_ENDS, rng)
        n_segments = curve.elbow()
    n_cells = min(n_segments, values.samples.n_colors)
    start = prepared.start(n_cells)
    samples: Any = values.samples if start is None else start[values.inside]
    with part(0.4 if curve else 0, 0.6):
        cells = tessellate(samples, n_cells, effort=effort, volume_power=volume_power, rng=rng)
    own = cells.labels + np.int32(1)
    if start is None:
        own = take_rows(own, values.samples.inverse[0])
    with part(0.6, 1):
        labels, descent = prepared.settle(at_pixels(own, values.inside), n_cells)
    weight, field = descent.edge_weight if descent else 0.0, prepared.field
    if components or size or objects:  # pieces and objects are numbered as the image is read
        data, is_same = prepared.data, prepared.data is field
        del prepared, own  # half of the memory
        labels, data = frame.back(labels, shape), frame.back(data, shape)
        field = data if is_same else frame.back(field, shape)
        frame = Frame(tuple(map(slice, shape)), (slice(None),) * len(shape), False)
        if components or size:
            labels = _in_pieces(labels, data, size, weight * length_cost(edge_radius, planes), components)
        if objects:
            labels = (Objects() if objects is True else objects).found(labels, data)
    scale = values.scale**2 if descent is None and start is None else 1.0
    end: Any = descent or replace(cells, energies=tuple(scale * energy for energy in cells.energies))
    result = from_labels(values, field, labels, end, weight, curve)
    own = result.labels
    if planes is not None:
        first = (len(own) // planes.rows - framed[0]) // 2
        own = own.reshape(-1, planes.rows, framed[2])[first : first + framed[0], : framed[1]]
    return replace(result, labels=frame.back(own, shape))


def below_each_other(bands: Array, inside: Bools, spacing: float, radius: int) -> tuple[Array, Bools, Planes]:
    """Return the planes of a volume as one image, with as much around them as `Planes` needs, and what counts of it."""
    planes = Planes(bands.shape[1] + radius, spacing)
    first = int(radius / planes.spacing)
    around = [(first, first), (0, radius), (0, 0)]
    tall = np.pad(bands, [*around, (0, 0)]).reshape(-1, *bands.shape[2:])
    return tall, np.pad(inside, around).reshape(tall.shape[:2]), planes


def _in_pieces(labels: Ints, data: Floats32, size: int, price: float, apart: bool) -> Ints:
    """Merge small pieces of segments into their neighbors; apart, pieces are segments of their own."""
    pieces = connected_pieces(labels)
    kept = absorb_small(pieces, data, size, price)
    if apart:
        return kept
    label_of = np.zeros(int(pieces.max()) + 1, np.int32)
    label_of[pieces] = labels
    return label_of[kept]
