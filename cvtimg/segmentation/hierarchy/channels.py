"""What regions of a photograph differ in: color, channel by channel, and texture.

Every pixel gets a bin for each channel of color and one for its texture. Textures are told apart by textons: the
responses of filters to an image are samples as colors are, and the generators of their tessellation are the patterns
that the image is made of.

J. Malik, S. Belongie, T. Leung, J. Shi, Int. J. Computer Vision 43 (2001) 7-27, doi 10.1023/A:1011174803800: textons.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy import ndimage

from cvtimg._shared.threads import in_parts, of_each
from cvtimg._shared.types import Bools, Bytes, Floats32, Ints
from cvtimg.engine.points import assign, pack
from cvtimg.engine.tessellation import tessellate
from cvtimg.segmentation._segments import N_LEVELS, N_TEXTONS
from cvtimg.segmentation.hierarchy.settings import SETTINGS
from cvtimg.segmentation.noise import averaged, noise_covariance, noise_gain
from cvtimg.segmentation.values import PictureValues, from_nearest, pixels_of


@dataclass(frozen=True, slots=True, eq=False)
class Channels:
    """What pixels are like."""

    bins: Bytes  # (H, W, C): bins of color, `N_LEVELS` for each channel but the last, which has the textons
    #: (H, W, D): where distances of colors are measured, at full contrast and centered; 0 outside
    values: Floats32
    inside: Bools  # (H, W): pixels that count


def find_channels(values: PictureValues) -> Channels:
    """Sort the pixels of an image into bins of color and texture."""
    field, inside = values.field(), values.inside
    noise = noise_covariance(field, inside)
    # A Gaussian of width s leaves 1 / (2 s sqrt(pi)) of white noise: this one, what does no harm.
    blur = min(float(np.sqrt(noise[0, 0])) / SETTINGS.harmless_noise / (2 * np.sqrt(np.pi)), SETTINGS.blurs[1])
    if blur >= SETTINGS.blurs[0]:
        field = averaged(field, blur, inside)
        noise = noise * noise_gain(blur)
    colors, ranges = _colors(field, values)
    low, high = np.percentile(colors[inside][:, 0], SETTINGS.extremes)
    # Contrast is stretched to 255, but no bin is narrower than the noise.
    span = max(float(high - low), N_LEVELS * float(np.sqrt(noise[0, 0])))
    gain = 255 / span if span > 0 else 1.0
    bins = np.empty((*inside.shape, colors.shape[2] + 1), np.uint8)
    for channel, (least, greatest) in enumerate(ranges):
        offset = float(low) if least == 0 else 0.0
        share = (colors[..., channel] - np.float32(offset)) * np.float32(gain) - np.float32(least)
        share /= np.float32(greatest - least)
        bins[..., channel] = np.clip(share * N_LEVELS, 0, N_LEVELS - 1)
        if channel == 0:
            # Outside are values of the nearest pixels inside, so that filters see no edge there.
            bins[..., -1] = textons(share if inside.all() else from_nearest(share, inside), inside)
    return Channels(bins, field * np.float32(gain), inside)


def _colors(field: Floats32, values: PictureValues) -> tuple[Floats32, Sequence[tuple[float, float]]]:
    """(H, W, 1 or 3) colors, and the range of each channel: if it starts at 0, contrast may be stretched to fill it."""
    # Of more bands than three the three principal components are taken, or of two both.
    n_bands = field.shape[2]
    if n_bands in (1, 3):
        colors = field + values.center.astype(np.float32)
        return colors, SETTINGS.ranges[values.space][:n_bands]
    rows = field[values.inside].astype(np.float64)
    axes = np.linalg.eigh(np.einsum("ni,nj->ij", rows, rows))[1][:, ::-1][:, :3]
    axes *= np.where(axes.sum(axis=0) < 0, -1, 1)
    components = np.einsum("hwd,dc->hwc", field, axes.astype(np.float32))
    return components, [(0, 255), (-128, 128), (-128, 128)][: axes.shape[1]]


def textons(lightness: Floats32, inside: Bools) -> Ints:
    """(H, W) number of the pattern around each pixel."""
    responses = _responses(lightness)
    sampled = pixels_of(responses, inside)
    sampled = sampled[:: max(SETTINGS.texton_step, len(sampled) // SETTINGS.texton_samples)]
    responses = responses.reshape(lightness.size, -1)
    distinct = np.unique(sampled[:: 1 + len(sampled) // (16 * N_TEXTONS)], axis=0)
    if len(distinct) < N_TEXTONS:
        distinct = np.unique(sampled, axis=0)
    n_textons = min(N_TEXTONS, len(distinct))
    generators = tessellate(sampled, n_textons, effort="fast").generators
    packed = pack(responses, np.ones(len(responses)), center=np.zeros(responses.shape[1]))
    return assign(packed, packed.frame.inward(generators))[: lightness.size].reshape(lightness.shape)


def _responses(lightness: Floats32) -> Floats32:
    """(H, W, F) derivatives of the first and second order at each scale, their contrast compressed."""
    filters = list(product(SETTINGS.texton_scales, ((0, 1), (1, 0), (0, 2), (1, 1), (2, 0))))
    responses = np.empty((*lightness.shape, len(filters)), np.float32)

    def respond(number: int) -> None:
        scale, order = filters[number]
        gain = scale ** sum(order) * (2**0.5 if order == (1, 1) else 1)
        responses[..., number] = ndimage.gaussian_filter(lightness, scale, order) * np.float32(gain)

    def compress(first: int, last: int) -> None:
        rows = responses[first:last]
        size = np.sqrt(np.einsum("hwf,hwf->hw", rows, rows))
        gain = np.log1p(size / np.float32(SETTINGS.texton_contrast)) / np.maximum(size, np.float32(1e-9))
        rows *= gain[..., None]

    of_each(respond, len(filters), work=40.0 * responses.size)
    in_parts(compress, len(responses), work=4.0 * responses.size)
    return responses
