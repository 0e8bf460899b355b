"""How alike two images look: SSIMULACRA2, a measure that was fitted to the opinions of many people.

J. Sneyers, SSIMULACRA 2, Cloudinary (2022), https://github.com/cloudinary/ssimulacra2.
"""

import json
from functools import cache, reduce
from pathlib import Path
from typing import NamedTuple

import numpy as np

import cvtimg.looks._looks as _looks
from cvtimg._shared.pixels import peak
from cvtimg._shared.threads import in_stripes
from cvtimg._shared.types import Array, Floats, Floats32
from cvtimg.colors.places import has_alpha
from cvtimg.colors.spaces import to_space

#: Each scale has half the width and height of the one before; smaller images have fewer.
_N_SCALES, _LEAST_SIDE = 6, 8
#: Sides from which on the content of images is judged as it is: with five scales quality is about that with six, with
#: fewer as much as 60 points above or 25 below. Larger ones enlarge more images.
_ENOUGH = 128
#: A Gaussian of sigma 1.5.
_BELL = np.exp(-(np.arange(-5, 6) ** 2) / 4.5)
_BLUR = (_BELL / _BELL.sum()).astype(np.float32)
#: XYB: cone responses of linear light, with a bias before the cube root.
_TO_CONES = np.array(
    [[0.3, 0.622, 0.078], [0.23, 0.692, 0.078], [0.24342268924547819, 0.20476744424496821, 0.5518098665095536]],
    np.float32,
)
_BIAS = np.float32(0.0037930732552754493)
#: (3, 6, 2, 3), by channel and scale: of the mean, and of the root of the mean of fourth powers, of the errors in
#: structure, artifacts and lost detail.
_WEIGHTS = np.array(json.loads((Path(__file__).parent / "weights.json").read_text()))


class _Scale(NamedTuple):
    """An image at one scale: its planes (3, H, W), their blurs, and the blurs of their squares."""

    planes: Floats32
    means: list[Floats32]
    squares: list[Floats32]


class VisualQuality:
    """SSIMULACRA2 of images against an original, which is prepared once.

    Parameters
    ----------
    original : (H, W) or (H, W, C) array
        Gray or RGB, with or without alpha. Of any integer or floating type, with the usual white.
    ground : float
        The gray, in 0..1 of sRGB, that alpha is composed on.

    Examples
    --------
    >>> ramp = np.tile(np.arange(256, dtype=np.uint8), (64, 1))
    >>> quality = VisualQuality(ramp)
    >>> round(quality(ramp))
    100
    >>> bool(quality(ramp // 64 * 64) < quality(ramp // 8 * 8))
    True
    """

    def __init__(self, original: Array, ground: float = 0.5) -> None:
        self._shape, self._ground = np.asarray(original).shape[:2], ground
        pyramid = _pyramid(original, ground)
        self._scales, self._counts = [_scale(linear) for linear in pyramid], [_n_busy(linear) for linear in pyramid]

    def __call__(self, image: Array) -> float:
        """Return the quality of an image of the same size, up to 100; below 0 it is hardly the same image."""
        return self.judged(image)[0]

    def judged(self, image: Array) -> tuple[float, float]:
        """Return the quality of an image of the same size, and that of its content, see `content_quality`."""
        if np.asarray(image).shape[:2] != self._shape:
            raise ValueError(f"image of {image.shape[:2]} pixels must have the size of the original, {self._shape}")
        totals = np.zeros(2)
        levels = zip(self._scales, self._counts, _pyramid(image, self._ground), strict=True)
        for level, (original, n_busy, linear) in enumerate(levels):
            sums = _sums_of_errors(original, _planes(linear))
            for of_what, count in enumerate((linear[0].size, n_busy)):
                errors = sums / count
                errors[:, 1] **= 0.25
                for channel in range(3):
                    # The reference goes through the weights one by one, also where an image has fewer scales.
                    place = divmod(channel * len(self._scales) + level, _N_SCALES)
                    totals[of_what] += (_WEIGHTS[place] * errors[channel]).sum()
        whole, content = (_score(float(total)) for total in totals)
        return whole, content


class Qualities:
    """The `content_quality` and the `visual_quality` of images against an original, which is prepared once."""

    def __init__(self, original: Array) -> None:
        self._original, bands = original, _enlarged(original)
        seen_through = bands.ndim == 3 and has_alpha(bands.shape[2]) and (bands[..., -1] != peak(bands.dtype)).any()
        # In sRGB the error of a pixel is affine in what is behind it: no gray shows more of it than black or white.
        self._of_grounds = [VisualQuality(bands, ground) for ground in ((0.0, 1.0) if seen_through else (0.5,))]
        self._is_apart = seen_through or bands.shape != np.shape(original)

    def content(self, image: Array) -> float:
        """Return the quality of the content of an image."""
        bands = _enlarged(image)
        return min(quality.judged(bands)[1] for quality in self._of_grounds)

    def whole(self, image: Array) -> float:
        """Return the quality of an image with its canvas, on gray."""
        return (VisualQuality(self._original) if self._is_apart else self._of_grounds[0])(image)


def visual_quality(original: Array, image: Array) -> float:
    """Return how alike two images look: SSIMULACRA2, at most 100.

    About 90 cannot be told from the original, 70 is good, 50 is fair, and below 30 is poor.

    Parameters
    ----------
    original, image : (H, W) or (H, W, C) arrays
        Gray or RGB, of the same size; alpha is composed on mid-gray.

    Examples
    --------
    >>> import cvtimg
    >>> image = cvtimg.read_image("sample_images/coffee.png")
    >>> round(cvtimg.visual_quality(image, image))
    100
    """
    return VisualQuality(original)(image)


def content_quality(original: Array, image: Array) -> float:
    """Return how alike the content of two images looks, on the worse of a black and a white background, at most 100.

    `visual_quality` is a mean over all pixels, so an empty canvas hides what befalls a small logo on it. Here errors
    are divided by the pixels near which the original is not of one color (in a window of 11 x 11 pixels, the reach of
    the measure, at each of its scales): a canvas that is 160 pixels wide, as windows reach at the coarsest scale, and
    gets wider by multiples of 32, does not change the quality. Pixels of images of less than 128 pixels across, such
    as icons, are repeated until they have as many: of fewer scales the measure means little. Other photographs without
    clipped areas have the same quality by both. This is what `cvtimg.quantize` aims at for eyes.

    Parameters
    ----------
    original, image : (H, W) or (H, W, C) arrays
        Gray or RGB, with or without alpha, of the same size.

    Examples
    --------
    >>> import cvtimg
    >>> canvas = np.full((200, 300), 255, np.uint8)
    >>> canvas[20:40, 20:60] = np.arange(40) * 6
    >>> cvtimg.content_quality(canvas, canvas // 32 * 36) < cvtimg.visual_quality(canvas, canvas // 32 * 36) - 5
    True
    """
    return Qualities(original).content(image)


def _enlarged(image: Array) -> Array:
    """Repeat the pixels of a small image along each axis until it has enough."""
    bands = np.asarray(image)
    if bands.ndim not in (2, 3) or 0 in bands.shape:  # which is refused
        return bands
    for axis, side in enumerate(bands.shape[:2]):
        bands = np.repeat(bands, -(-_ENOUGH // side), axis)
    return bands


def _score(total: float) -> float:
    """Return the quality that errors lead to, weighted and added."""
    total *= 0.9562382616834844
    total = 2.326765642916932 * total - 0.020884521182843837 * total**2 + 6.248496625763138e-05 * total**3
    return 100 - 10 * total**0.6276336467831387 if total > 0 else 100.0


def _n_busy(linear: Floats32) -> int:
    """Return the number of pixels (3, H, W) in whose window there is more than one color, or that of all if none."""
    from scipy.ndimage import maximum_filter  # which takes long to import

    differs, reach = np.zeros(linear.shape[1:], np.bool_), len(_BLUR) // 2

    def compare(rows: slice) -> None:
        first = max(rows.start - 1, 0)
        part = linear[:, first : rows.stop + 1]
        near = np.zeros(part.shape[1:], np.bool_)
        for axis, here in enumerate((near, near.T)):
            steps = (np.diff(part, axis=axis + 1) != 0).any(axis=0)
            steps = steps if axis == 0 else steps.T
            here[:-1] |= steps
            here[1:] |= steps
        differs[rows] = near[rows.start - first :][: rows.stop - rows.start]

    def count(rows: slice) -> int:
        first = max(rows.start - reach, 0)
        near = maximum_filter(differs[first : rows.stop + reach], len(_BLUR))
        return int(np.count_nonzero(near[rows.start - first :][: rows.stop - rows.start]))

    in_stripes(compare, len(differs), 16 * linear.size)
    return sum(in_stripes(count, len(differs), 8 * linear.size)) or differs.size


def _pyramid(image: Array, ground: float) -> list[Floats32]:
    """Return the image at each scale, as planes (3, H, W) of linear light."""
    scales = [_linear(np.asarray(image), ground)]
    while len(scales) < _N_SCALES and min(scales[-1].shape[1:]) >= 2 * _LEAST_SIDE - 1:
        scales.append(_halved(scales[-1]))
    return scales


def _halved(linear: Floats32) -> Floats32:
    height, width = linear.shape[1:]
    half = np.empty((3, -(-height // 2), -(-width // 2)), np.float32)

    def halve(rows: slice) -> None:
        part = linear[:, 2 * rows.start : 2 * rows.stop]
        even = np.pad(part, ((0, 0), (0, part.shape[1] % 2), (0, width % 2)), mode="edge")
        half[:, rows] = (even[:, ::2, ::2] + even[:, ::2, 1::2]) + (even[:, 1::2, ::2] + even[:, 1::2, 1::2])
        half[:, rows] *= np.float32(0.25)

    in_stripes(halve, half.shape[1], 8 * linear.size)
    return half


def _linear(image: Array, ground: float) -> Floats32:
    """Return the linear light of an image, as planes (3, H, W)."""
    if image.ndim not in (2, 3) or 0 in image.shape or image.shape[2:] > (4,):
        raise ValueError(f"image of shape {image.shape} must have shape (H, W) or (H, W, C), with C in 1..4")
    bands = image[:, :, None] if image.ndim == 2 else image
    white, light, alpha = peak(image.dtype), np.empty((3, *image.shape[:2]), np.float32), has_alpha(bands.shape[2])

    def kernel(stripe: slice) -> None:
        rows: Array = bands[stripe]
        share: Array = rows[:, :, -1:]
        if rows.dtype == np.uint8:
            share = share.astype(np.int32)  # products are in steps of half a level of 16 bits
            mixed = 2 * share * rows[:, :, :-1] + (255 - share) * round(510 * ground) if alpha else rows
            linear = _light_of(2 * 255**2 if alpha else 255)[mixed]
        else:
            share = share / white
            mixed = share * (rows[:, :, :-1] / white) + (1 - share) * ground if alpha else rows
            linear = to_space(mixed.reshape(-1, 1), "linear").reshape(mixed.shape)
        light[:, stripe] = linear.transpose(2, 0, 1)

    in_stripes(kernel, len(bands), 8 * light.size)
    return light


@cache
def _light_of(n: int) -> Floats32:
    """Return the light of the levels 0 to n, of which n is white."""
    return to_space(np.arange(n + 1)[:, None] / n, "linear")[:, 0].astype(np.float32)


def _scale(linear: Floats32) -> _Scale:
    planes = _planes(linear)
    return _Scale(planes, blurred(planes), blurred(planes, planes))


def _planes(linear: Floats32) -> Floats32:
    """Return linear light in XYB."""
    planes = np.empty_like(linear)

    def to_xyb(rows: slice) -> None:
        red, green, blue = linear[:, rows]
        roots = [np.cbrt(r * red + g * green + b * blue + _BIAS) - np.cbrt(_BIAS) for r, g, b in _TO_CONES]
        brightness = np.float32(0.5) * (roots[0] + roots[1])
        planes[0, rows] = 7 * (roots[0] - roots[1]) + np.float32(0.42)
        planes[1, rows] = brightness + np.float32(0.01)
        planes[2, rows] = roots[2] - brightness + np.float32(0.55)

    in_stripes(to_xyb, linear.shape[1], 40 * linear.size)
    return planes


def blurred(*factors: list[Floats32] | Floats32) -> list[Floats32]:
    """Blur planes, or the products of planes, by a Gaussian of sigma 1.5; beyond the sides are zeros."""
    out, reach = [np.empty(plane.shape, np.float32) for plane in factors[0]], len(_BLUR) // 2

    def blur(rows: slice) -> None:
        first = max(rows.start - reach, 0)
        for channel, plane in enumerate(out):
            part = reduce(np.multiply, (planes[channel][first : rows.stop + reach] for planes in factors))
            _looks.blur(np.ascontiguousarray(part), _BLUR, rows.start - first, plane[rows])

    in_stripes(blur, len(out[0]), 20 * len(out) * out[0].size)
    return out


def _sums_of_errors(original: _Scale, planes: Floats32) -> Floats:
    """Return the sums of each error and of its fourth power, (3, 2, 3) by channel."""
    stripes = in_stripes(
        lambda rows: (original.planes[:, rows] != planes[:, rows]).any(axis=0), planes.shape[1], planes.size
    )
    differs, reach = np.concatenate(stripes), len(_BLUR) // 2
    inner, wide = list[slice](), list[slice]()
    for axis in range(2):  # there are errors only in windows with differences, which are part of many drawings
        places = np.flatnonzero(differs.any(axis=1 - axis))
        first, stop = (max(places[0] - reach, 0), places[-1] + reach + 1) if len(places) else (0, 0)
        wide.append(slice(max(first - reach, 0), stop + reach))
        inner.append(slice(first - wide[-1].start, stop - wide[-1].start))
    if not differs.any():
        return np.zeros((3, 2, 3))
    seen = original.planes[:, *wide], planes[:, *wide]
    others = blurred(seen[1]), blurred(seen[1], seen[1]), blurred(*seen)

    whole = [[plane[*wide] for plane in some] for some in (original.planes, original.means, original.squares)]
    bands = whole[0], seen[1], whole[1], others[0], whole[2], *others[1:]

    def errors(rows: slice) -> Floats:
        part = slice(inner[0].start + rows.start, inner[0].start + rows.stop), inner[1]
        parts = ([np.ascontiguousarray(some[channel][*part]) for some in bands] for channel in range(3))
        return np.stack([_looks.errors(*of_channel) for of_channel in parts], axis=1)

    rows = np.concatenate(in_stripes(errors, inner[0].stop - inner[0].start, 20 * seen[0].size))
    return np.cumsum(rows, axis=0)[-1].reshape(3, 3, 2).transpose(0, 2, 1)  # one row after the other
