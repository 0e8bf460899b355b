"""Restoration: one good image from several bad ones, none of which holds it all, or from one that is noisy."""

from collections.abc import Sequence
from dataclasses import replace
from inspect import signature
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_gradient_magnitude

from cvtimg._shared.checks import check_choice, check_count, check_edge_weight, check_in_range
from cvtimg._shared.choices import AlignName, AutoEffortName, EffortName, NoiseName, SpaceName
from cvtimg._shared.progress import part
from cvtimg._shared.threads import one_blas_thread
from cvtimg._shared.types import Array, Bools, Floats32
from cvtimg.engine.search import EFFORTS
from cvtimg.files.whole import StrPath
from cvtimg.restoration.detail import cells_of, denoised
from cvtimg.restoration.evidence import MOST_MISFIT, misfits_of_most, prepare, that_tell
from cvtimg.restoration.noise import Noise
from cvtimg.restoration.result import RENORMALIZATIONS, Denoised, Restoration, merge_versions
from cvtimg.restoration.versions import Versions, fuse, stack_versions, trust_in, usual_noise, with_tables

#: Part of the time in which versions are prepared.
_PREPARING = 0.2
#: Pixels of blur, which remove most of the noise; more mix colors.
_BLUR = 2.0
#: A drawing has at most 12 colors in this part of the pixels, those farthest from edges, some of which are looked
#: at. What they leave is below the variance of noise: drawings up to 0.6, photographs from 3 times that on.
_COLORS, _AWAY, _SAMPLED = 12, 0.5, 1 << 13
#: Correlation of neighbors in what a restored drawing leaves of one version, from which on it was no drawing.
_STRUCTURE = 0.08
#: Parts that red, green and blue have in lightness (Rec. 601).
_LUMA = np.array([0.299, 0.587, 0.114])
__all__ = ["Denoised", "Restoration", "denoise", "restore", "restore_versions"]


@one_blas_thread
def restore(
    images: Sequence[Any],
    n_generators: int | str = "auto",
    *,
    masks: Sequence[ArrayLike | None] | None = None,
    nodata: float | None = None,
    alpha: bool | None = None,
    weights: ArrayLike | None = None,
    align: bool | AlignName = False,
    channels: bool = False,
    hidden: str | None = "outliers",
    space: SpaceName = "rgb",
    edge_weight: float | str = "auto",
    renormalize: str | None = "range",
    noise: float | None = None,
    effort: EffortName = "balanced",
) -> Restoration:
    """Restore one image in flat colors from several noisy and incomplete versions of it.

    The values of all versions at a pixel, stacked, are one sample. Segments are cells of a tessellation of the samples
    in which unknown values have no weight. Pixels that no version knows follow those around them.

    Parameters
    ----------
    images : sequence of (H, W) or (H, W, C) arrays, or Pillow images
        The versions, all of one size unless they are aligned, of any integer or floating point type. Unknown pixels are
        NaN, masked in a masked array, have alpha 0, or are given by `masks` or `nodata`.
    n_generators : int or "auto"
        Initial number of segments K; an image of fewer colors has one for each. "auto" takes the elbow of the energy of
        the versions fused and blurred, up to 32, where painted-over parts may count as a color of their own.
    masks : sequence of (H, W) arrays or None, optional
        Known pixels of each version: those where its mask is True or not 0. None means all pixels.
    nodata : float, optional
        Pixels with this value in all bands are unknown.
    alpha : bool, optional
        Whether the last channel of versions of two or four channels is alpha; False makes it a band. By default it is.
    weights : (S,) array, optional
        Weight of each version, > 0; by default the inverse variance of its noise, which is estimated.
    align : bool or {"auto", "translation", "euclidean", "affine", "homography"}
        Move each version to the place of the first. The name is the model of the motion: "euclidean" is a rotation and
        a translation, "homography" suits what is flat or far away. "auto", or True, takes the simplest that fits.
    channels : bool
        The versions are different channels of one scene, such as day and night: they share segments but no colors.
        They may differ in bands and type, and the image is that of the first.
    hidden : {"outliers", "background", "motion", "none"} or None
        What to leave out where versions disagree by more than their noise. "outliers": what departs from the majority
        of three or more, such as cosmic rays, dust, passers-by and parts painted over; and if that happens, also where
        fewer know a pixel, what is likelier to be such an addition than what is around it. "background": versions that
        show the background, the most frequent color, where another shows something else; the result is the union of
        what all versions show, whichever of them hide it. "motion": what departs from the first version, as things that
        move by themselves do; the result is the moment that the first shows. "none" or None: nothing. But for "none",
        versions that cannot be laid over the others, as they are out of place or of something else, are left out
        altogether.
    space : {"rgb", "linear", "lab", "oklab"}
        Color space in which distances are measured. Floating point values are clipped to 0..1 except in "rgb".
    edge_weight : float or "auto"
        Penalty for each pair of pixels within a distance of 3 pixels in different segments, in squared 8-bit levels at
        any depth. "auto" is half the variance of the noise or, where versions disagree by more, of their disagreement.
    renormalize : {"range", "median", "none"} or None
        How the generators of the versions become one color. The mean of a segment is diluted if a version hides parts
        of it. "range" takes the level that the segment has in each version on its own, where hidden parts belong to
        the background, so that colors span the range of the versions again. "median" takes the median of all that is
        known of the segment, "none" or None the mean.
    noise : float, optional
        Standard deviation of the noise of each version, > 0, in 8-bit levels at any depth; by default it is estimated.
    effort : {"fast", "balanced", "best"}
        Number of blurred images in which the search for segments starts: 1, 2 or 4.

    Returns
    -------
    Restoration

    Raises
    ------
    TypeError, ValueError
        If no version knows any pixel, or an argument is invalid.

    Warns
    -----
    UserWarning
        If versions cannot be laid over the others.

    See Also
    --------
    denoise : The same for photographs, which have no flat colors.

    Notes
    -----
    The distance of a pixel to a generator is the sum of weight times squared distance over the versions that know it.
    Dividing by the sum of these weights would find the same nearest generator; as it stands, the distance is also
    balanced against the edges, because a pixel that few versions know tells less. An object that one of two versions
    lacks is still nearer to the generator of the object than to that of the background, so the union of what they show
    comes back. Renormalization is our reading of the images restored to full contrast in the lecture; its text does
    not define it.

    References
    ----------
    M. Gunzburger, lecture "Centroidal Voronoi Tessellations"; Q. Du, M. Gunzburger, L. Ju, X. Wang, J. Math. Imaging
    Vision 24 (2006) 177-194, doi 10.1007/s10851-005-3620-4; J. Wang, L. Ju, X. Wang, IEEE Trans. Image Processing 18
    (2009) 1844-1858, for the edges.

    Examples
    --------
    Each of three versions lacks another part of a bar, and nothing says which.

    >>> from cvtimg import restore
    >>> bar = np.full((9, 30), 20, np.uint8)
    >>> bar[3:6] = 220
    >>> versions = [bar.copy() for _ in range(3)]
    >>> for number, version in enumerate(versions):
    ...     version[:, 10 * number : 10 * number + 8] = 20
    >>> bool((restore(versions, 2).image == bar).all())
    True
    """
    check_choice("effort", effort, tuple(EFFORTS))
    rule = check_choice("renormalize", renormalize or "none", RENORMALIZATIONS)
    cost = check_edge_weight(edge_weight)
    given = stack_versions(images, masks, nodata, space, channels=channels, alpha=alpha, any_size=bool(align))
    if isinstance(n_generators, str):
        check_choice("n_generators", n_generators, ("auto",))
        number = None
    else:
        number = check_count("n_generators", n_generators, given.known[:, :, 0].size, "the number of pixels")
    with part(0, _PREPARING):
        evidence = prepare(given, weights, align=align, hidden=hidden, level=noise, space=space, channels=channels)
    with part(_PREPARING, 1):
        return merge_versions(evidence, number, edge_weight=cost, renormalize=rule, effort=effort, space=space)


@one_blas_thread
def denoise(
    images: Sequence[Any],
    *,
    masks: Sequence[ArrayLike | None] | None = None,
    nodata: float | None = None,
    alpha: bool | None = None,
    weights: ArrayLike | None = None,
    align: bool | AlignName = False,
    hidden: str | None = "outliers",
    space: SpaceName = "rgb",
    noise: float | None = None,
    noise_like: NoiseName = "auto",
    luma: float = 1.0,
    chroma: float = 1.0,
    effort: AutoEffortName = "auto",
    rng: int | np.random.Generator = 0,
) -> Denoised:
    """Restore a photograph from several noisy and incomplete versions of it, or from a single one.

    Patches of 5 x 5 pixels are tessellated, and cells cut into groups of patches that look alike, each with a filter
    that restores the detail that its generator leaves out. A picture without noise comes back as it is.

    Parameters
    ----------
    images, masks, nodata, alpha, weights, align, hidden, space, noise
        As in `restore`. Integer values are taken to be clipped at the ends of their type where they pile up there.
    noise_like : {"auto", "white"}
        Whether pixels next to each other may share noise, as after demosaicing, scaling, blurring or JPEG, and whether
        its variance may follow the level, as that of light. "auto" finds out from quiet parts or, of versions in place,
        from what they differ by; and from the quantization tables of Pillow images that were JPEG files. "white" denies
        all.
    luma, chroma : float
        Part of the noise of lightness, and of the colors, that is taken away, 0 to 1. A low `luma` keeps grain.
    effort : {"auto", "fast", "balanced", "best"}
        Number of passes, in each of which groups are found anew: 2, 4 or 5. "auto" is "best" up to a quarter of a
        megapixel and "fast" from four on, so that large images take minutes.
    rng : int or numpy.random.Generator
        Seed of the patches that are drawn.

    Returns
    -------
    Denoised

    Raises
    ------
    TypeError, ValueError
        If no version knows any pixel, or an argument is invalid.

    Warns
    -----
    UserWarning
        If versions cannot be laid over the others, are copies, which count once, or are of one color where others are
        not.

    References
    ----------
    P. Chatterjee, P. Milanfar, IEEE Trans. Image Processing 21 (2012) 1635-1649, doi 10.1109/TIP.2011.2172799.

    Examples
    --------
    >>> from cvtimg import denoise
    >>> clean = np.add.outer(np.arange(40.0), np.arange(60.0)) + 50
    >>> noisy = clean + np.random.default_rng(0).normal(0, 5, clean.shape)
    >>> bool(np.std(denoise([noisy], effort="fast").image - clean) < 2.5)
    True
    """
    check_choice("effort", effort, ("auto", *EFFORTS))
    check_choice("noise_like", noise_like, get_args(NoiseName))
    check_in_range("luma", luma, 0 <= luma <= 1, "from 0 to 1")
    check_in_range("chroma", chroma, 0 <= chroma <= 1, "from 0 to 1")
    stacked = that_tell(stack_versions(images, masks, nodata, space, alpha=alpha, any_size=bool(align)))
    given, bands = stacked.distinct()
    white = noise_like == "white"
    with part(0, _PREPARING):
        evidence = prepare(given, weights, align=align, hidden=hidden, level=noise, space=space, white=white)
    with part(_PREPARING, 1):
        image, used = denoised(evidence, effort, np.random.default_rng(rng))
    if (luma, chroma) != (1, 1):
        image = _in_part(image, *fuse(used, evidence.trust), luma, chroma, space)
    return Denoised.of(stacked.with_all(image, bands), used, evidence, space, bands=bands)


def _in_part(
    image: Floats32, fused: Floats32, weights: Floats32, luma: float, chroma: float, space: SpaceName
) -> Floats32:
    """(H, W, C) image with a part of the noise of what was fused, and its weights, back in lightness and in colors."""
    noise = np.where(weights[:, :, None] > 0, fused - image, 0)
    if space in ("lab", "oklab"):
        light = noise * (np.arange(image.shape[2]) == 0)
    else:
        light = np.average(noise, axis=2, weights=_LUMA if image.shape[2] == 3 else None)[:, :, None]
    return np.asarray(image + (1 - luma) * light + (1 - chroma) * (noise - light), np.float32)


# --- what versions are: drawings, whose few colors explain what they show, or photographs; and how noisy


def restore_versions(
    images: Sequence[Any],
    paths: Sequence[StrPath] = (),
    *,
    flat: bool | None = None,
    masks: Sequence[ArrayLike | None] | None = None,
    nodata: float | None = None,
    alpha: bool | None = None,
    align: bool | AlignName = False,
    **options: Any,
) -> Denoised:
    """Restore versions of one image by `cvtimg.restore` or `cvtimg.denoise`, whichever suits what they show.

    Parameters
    ----------
    images, masks, nodata, alpha, align
        As in `cvtimg.restore`.
    paths : sequence of paths, optional
        Files of the images, one for each, or none: what JPEG has rounded away of those is known from their tables,
        where detail is restored.
    flat : bool, optional
        Whether the image has few flat colors. By default it has, if a few explain all but the noise, and segments of a
        single image leave no more of it.
    **options
        Those of `cvtimg.restore` and of `cvtimg.denoise`; those of the other are left out.

    Examples
    --------
    >>> from cvtimg.restoration import restore_versions
    >>> type(restore_versions([np.eye(32)])).__name__
    'Restoration'
    """
    about: dict[str, Any] = {"masks": masks, "nodata": nodata, "alpha": alpha}
    segments, detail = (signature(verb).parameters for verb in (restore, denoise))  # what neither has, each refuses
    for_segments = {name: value for name, value in options.items() if name in segments or name not in detail}
    for_detail = {name: value for name, value in options.items() if name in detail or name not in segments}
    if for_segments.get("effort") == "auto":
        del for_segments["effort"]
    some = 1 if align else None  # others may be out of place
    if flat or (flat is None and _shows_drawing(stack_versions(images[:some], **about))):
        result = restore(images, align=align, **about, **for_segments)
        if flat or len(images) > 1 or not _leaves_structure(result.image, images[0], result.coverage > 0):
            return result
    if len(paths) == len(images):
        images = [*map(with_tables, images, paths)]
    return denoise(images, align=align, **about, **for_detail)


def _leaves_structure(image: Array, version: Array, known: Bools) -> bool:
    """Tell whether what a restored image leaves of a version is more than noise, as faint text is."""
    bands = image.reshape(*known.shape, -1)
    values = np.asarray(version).reshape(*known.shape, -1)[:, :, : bands.shape[2]]
    inside = known[:, :, None] & (values > values.min()) & (values < values.max())  # what is clipped has a mean
    apart = np.where(inside, values - bands.astype(np.float64), 0.0)
    power = np.square(apart).sum()
    pairs = [(apart[1:] * apart[:-1]).sum(), (apart[:, 1:] * apart[:, :-1]).sum()]
    return bool(power and np.mean(pairs) > _STRUCTURE * power)


@one_blas_thread
def _shows_drawing(versions: Versions) -> bool:
    """Tell whether versions in place show a few flat colors, as far as noise lets see: it hides what is faint."""
    versions = that_tell(versions, quietly=True)
    noise = Noise.of(versions).levels
    if versions.n_versions > 1:
        _, apart = misfits_of_most(versions, usual_noise(versions, noise))
        versions = replace(versions, known=versions.known & (apart <= MOST_MISFIT))
    trust = trust_in(versions, None, noise)
    picture, weight = fuse(versions, trust, _BLUR)
    slopes = [gaussian_gradient_magnitude(band, 1.0) for band in np.moveaxis(picture, 2, 0)]
    slope = np.square(slopes).sum(axis=0).ravel()
    rows = picture.reshape(slope.size, -1)[slope <= np.quantile(slope, _AWAY)]
    rows = rows[:: -(-len(rows) // _SAMPLED)].astype(np.float64)
    cells = cells_of(rows, min(_COLORS, len(rows)), effort="fast")
    left = np.square(rows - cells.generators[cells.labels]).mean()
    noisy = float(np.mean(trust * np.nan_to_num(noise) ** 2))
    noisy /= max(float(weight.mean()), 1e-9) * 4 * np.pi * _BLUR**2
    return bool(left <= noisy + (versions.rounding / 2) ** 2)  # a level of 8 bits is lost by rounding
