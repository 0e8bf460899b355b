"""Color spaces in which distances are measured, by name: pure functions from sRGB and back.

Equal distances look about equally different in lab and oklab; in linear light means are those that blurring eyes and
lenses make; rgb, the default, is what files hold and what squared error and PSNR measure.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from cvtimg._shared.budgets import IN_CACHE
from cvtimg._shared.checks import check_channels, check_choice, check_within
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import peak
from cvtimg._shared.threads import in_stripes
from cvtimg._shared.types import Array, Dtype, Floats

# Oklab, Björn Ottosson 2020, https://bottosson.github.io/posts/oklab/: linear sRGB to cone responses, and the cube
# roots of these to lightness and two opponent channels.
_TO_CONES = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
# The opponent channels count twice: measured by CIEDE2000, plain ones let lightness weigh too much.
_TO_OPPONENT = np.array([[1], [2], [2]]) * np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
_FROM_CONES, _FROM_OPPONENT = np.linalg.inv(_TO_CONES), np.linalg.inv(_TO_OPPONENT)


def _decode(encoded: Floats) -> Floats:
    """Undo the transfer curve of sRGB, IEC 61966-2-1."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def _encode(light: Floats) -> Floats:
    """Apply the transfer curve of sRGB to what is within the gamut, and bring in what is not."""
    inside = np.clip(light, 0, 1)
    return np.where(inside <= 0.0031308, 12.92 * inside, 1.055 * inside ** (1 / 2.4) - 0.055)


def _transform(matrix: Floats, colors: Floats) -> Floats:
    # Not by BLAS, whose bits depend on the number of its threads.
    return np.einsum("cd,nd->nc", matrix, colors)


def _to_lab(rgb: Floats) -> Floats:
    from skimage.color import rgb2lab

    return rgb2lab(rgb)


def _from_lab(lab: Floats) -> Floats:
    from skimage.color import lab2xyz, xyz2rgb

    lightness = np.maximum(lab[:, 0], 0)
    # Beyond 200 / 116 times this there is less blue than none, of which scikit-image would warn.
    yellow = np.minimum(lab[:, 2], 1.724 * (lightness + 16))
    return xyz2rgb(np.maximum(lab2xyz(np.stack([lightness, lab[:, 1], yellow], axis=1)), 0))


@dataclass(frozen=True, slots=True)
class ColorSpace:
    """A color space.

    Attributes
    ----------
    forward, backward : callable
        Convert (N, 3) sRGB in 0..1 to coordinates of the space, and back. Colors outside the gamut may come back
        slightly outside 0..1.
    white : float
        First coordinate of white.
    gray : tuple of float
        The three coordinates of a gray are its first coordinate times these.
    """

    forward: Callable[[Floats], Floats]
    backward: Callable[[Floats], Floats]
    white: float = 1.0
    gray: tuple[float, float, float] = (1.0, 0.0, 0.0)


#: The registry of color spaces: the values of `space` and ``--space``.
SPACES: dict[str, ColorSpace] = {
    "rgb": ColorSpace(lambda rgb: rgb, lambda rgb: rgb, gray=(1.0, 1.0, 1.0)),
    "linear": ColorSpace(_decode, _encode, gray=(1.0, 1.0, 1.0)),
    "lab": ColorSpace(_to_lab, _from_lab, white=100.0),
    "oklab": ColorSpace(
        lambda rgb: _transform(_TO_OPPONENT, np.cbrt(_transform(_TO_CONES, _decode(rgb)))),
        lambda oklab: _encode(_transform(_FROM_CONES, _transform(_FROM_OPPONENT, oklab) ** 3)),
    ),
}


def to_space(colors: Array, space: SpaceName) -> Array:
    """Give colors their coordinates in a color space.

    Parameters
    ----------
    colors : (N, C) array
        Integers, of which the largest of the type is white, or floating point in 0..1. C is 3 (sRGB) or 1 (gray); any
        other number only for "rgb".
    space : {"rgb", "linear", "lab", "oklab"}
        "rgb" leaves the colors as they are, in type and unit too.

    Returns
    -------
    (N, C) array
        Gray has one coordinate in every space: its light in "linear", its lightness in "lab" and "oklab". Floating
        point, but for "rgb": light in 0..1, Lab in its own units (lightness in 0..100), Oklab with lightness in 0..1
        and twice its opponent channels.

    Examples
    --------
    >>> to_space(np.array([[255, 0, 0]], np.uint8), "lab").round().tolist()
    [[53.0, 80.0, 67.0]]
    """
    chosen = SPACES[check_choice("space", space, SPACES)]
    if space == "rgb":
        return colors
    check_channels("an image", colors.shape[1], (1, 3), f"for space={space!r}")
    if colors.dtype.kind in "if":
        check_within(f"{colors.dtype} samples", colors, 0, peak(colors.dtype), f" for space={space!r}")

    def places(rows: slice) -> Floats:
        unit = (colors[rows] / peak(colors.dtype)).astype(np.float64)
        return chosen.forward(np.repeat(unit, 3 // unit.shape[1], axis=1))[:, : unit.shape[1]] + 0.0  # no -0.0

    return np.concatenate(in_stripes(places, len(colors), 256.0 * colors.size, IN_CACHE) or [places(slice(0))])


def from_space(places: Floats, space: SpaceName, dtype: np.dtype[np.generic]) -> Array:
    """Bring places in a color space back to colors of a type, inside the gamut: the inverse of `to_space`.

    Integers are rounded; floating point in "rgb" comes back as it is, whatever its range.
    """
    chosen = SPACES[check_choice("space", space, SPACES)]
    n_channels = places.shape[1]
    if space == "rgb":
        colors = places
    else:
        check_channels("an image", n_channels, (1, 3), f"for space={space!r}")
        full = places if n_channels == 3 else places * chosen.gray
        colors = np.clip(chosen.backward(full)[:, :n_channels], 0, 1) * peak(dtype)
    return _rounded(colors.astype(np.float64), dtype) if dtype.kind in "iu" else colors.astype(dtype)


def to_depth(colors: Array, dtype: DTypeLike) -> Array:
    """Bring colors to an integer type or floating point in 0..1: black to black, white to white, integers rounded."""
    dtype = np.dtype(dtype)
    if colors.dtype == dtype:
        return colors
    white = peak(colors.dtype)
    if colors.dtype.kind in "if":
        check_within("samples", colors, 0, white, f" to become {dtype}")
    wide = max((kind.itemsize for kind in (colors.dtype, dtype) if kind.kind in "iu"), default=0) > 2
    working = np.float64 if wide else colors.dtype if colors.dtype.kind == "f" else np.float32
    unit: Array = colors / np.asarray(white, working)
    if dtype.kind in "iu":
        unit *= unit.dtype.type(peak(dtype))
        return _rounded(unit, dtype)
    return unit.astype(dtype, copy=False)


def _rounded(values: Array, dtype: Dtype) -> Array:
    """Round floating point, in place, to the nearest integers of a type."""
    low, high = float(np.iinfo(dtype).min), peak(dtype)
    if dtype.itemsize == 8:  # the largest integer of 64 bits would be rounded up, beyond the type
        high = float(np.nextafter(high, 0))
    np.rint(values, out=values)
    np.clip(values, low, high, out=values)
    return values.astype(dtype)
