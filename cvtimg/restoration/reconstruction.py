"""Multichannel restoration: one good image from several bad ones, none of which holds it all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_edge_weight,
    check_excluded,
    check_non_negative,
    check_positive,
    check_that,
    hints_at_keywords,
)
from cvtimg._shared.choices import AlignName, AutoEffortName, AveragingName, NoiseName, SpaceName
from cvtimg._shared.progress import part
from cvtimg.engine.search import EFFORTS
from cvtimg.restoration.agreement import HIDDEN
from cvtimg.restoration.alignment import MODELS
from cvtimg.restoration.detail import denoise_versions
from cvtimg.restoration.evidence import prepare, without_copies
from cvtimg.restoration.merging import Merging, level_of, merge_versions
from cvtimg.restoration.recognition import is_drawing
from cvtimg.restoration.renormalization import RENORMALIZATIONS
from cvtimg.restoration.result import Restoration, in_order
from cvtimg.restoration.versions import stack_versions
from cvtimg.segmentation.averaging import Averaging, as_averaging

#: What noise may be like.
NOISES = get_args(NoiseName)
__all__ = ["Restoration", "restore"]

#: Parts of the time until versions are prepared, without and with their alignment, and for what they show.
_PREPARED, _ALIGNED, _RECOGNIZED = 0.05, 0.3, 0.05


@hints_at_keywords
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
    averaging: AveragingName | Averaging | None = None,
    edge_weight: float | str = "auto",
    volume_power: float = 0,
    renormalize: str | None = "range",
    detail: bool | str = False,
    noise: float | None = None,
    noise_like: NoiseName = "auto",
    effort: AutoEffortName = "auto",
    rng: int | np.random.Generator = 0,
) -> Restoration:
    """Restore one image from several noisy and incomplete versions of it.

    The values of all versions at a pixel, stacked, are one sample. Segments are cells of a tessellation of the samples
    in which unknown values have no weight. Pixels that no version knows follow those around them.

    Parameters
    ----------
    images : sequence of (H, W) or (H, W, C) arrays, or Pillow images
        The versions, all of one size unless they are aligned, of any integer or floating point type. Unknown pixels are
        NaN, masked in a masked array, have alpha 0, or are given by `masks` or `nodata`. A single version is denoised.
    n_generators : int or "auto"
        Initial number of segments K; with `detail`, of kinds of patches, which matters little. "auto" takes the elbow
        of the energy of the versions fused and blurred, up to 32, where painted-over parts may count as a color of
        their own; with `detail`, it is 32.
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
    averaging : {"before", "after"} or Averaging, optional
        Average the known pixels of each version before the search for segments, or the segments after it, as in
        `segment`.
    edge_weight : float or "auto"
        Penalty for each pair of pixels within a distance of 3 pixels in different segments, in squared 8-bit levels at
        any depth. "auto" is half the variance of the noise or, where versions disagree by more, of their disagreement.
    volume_power : float
        Weight segments by their share of the image to this power.
    renormalize : {"range", "median", "none"} or None
        How the generators of the versions become one color. The mean of a segment is diluted if a version hides parts
        of it. "range" takes the level that the segment has in each version on its own, where hidden parts belong to
        the background, so that colors span the range of the versions again. "median" takes the median of all that is
        known of the segment, "none" or None the mean. With `detail`, colors are means.
    detail : bool or "auto"
        For photographs: cells of patches of 5 x 5 pixels, cut into groups of patches that look alike, each with a
        filter that restores the detail its generator leaves out. Integer values are taken to be clipped at the
        ends of their type where they pile up there. Not available with averaging, edge weight or volume power.
        "auto" restores detail of what is no drawing in a few flat colors.
    noise : float, optional
        Standard deviation of the noise of each version, > 0, in 8-bit levels at any depth; by default it is estimated.
    noise_like : {"auto", "white"}
        With `detail`: whether pixels next to each other may share noise, as after demosaicing, scaling, blurring or
        JPEG, and whether its variance may follow the level, as that of light. "auto" finds out from quiet parts or, of
        versions in place, from what they differ by; and from the quantization tables of Pillow images that were JPEG
        files. "white" denies all.
    effort : {"auto", "fast", "balanced", "best"}
        Number of blurred images in which the search for segments starts: 1, 2 or 4; with `detail`, number of passes,
        in each of which groups are found anew: 2, 4 or 5. "auto" is "balanced"; with `detail`, it is "best" up to a
        quarter of a megapixel and "fast" from four on, so that large images take minutes.
    rng : int or numpy.random.Generator
        Seed of the patches that are drawn for `detail`.

    Returns
    -------
    Restoration

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or no version knows any pixel; the message names it.

    Warns
    -----
    UserWarning
        If versions cannot be laid over the others.

    See Also
    --------
    restore_frames : Each frame of a film from those around it.
    cvtimg.segment : Segments of a single image.

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
    (2009) 1844-1858, for the edges; P. Chatterjee, P. Milanfar, IEEE Trans. Image Processing 21 (2012) 1635-1649, doi
    10.1109/TIP.2011.2172799, for `detail`.

    Examples
    --------
    Each of three versions lacks another part of a bar, and nothing says which.

    >>> import numpy as np
    >>> from cvtimg import restore
    >>> bar = np.full((9, 30), 20, np.uint8)
    >>> bar[3:6] = 220
    >>> versions = [bar.copy() for _ in range(3)]
    >>> for number, version in enumerate(versions):
    ...     version[:, 10 * number : 10 * number + 8] = 20
    >>> bool((restore(versions, 2).image == bar).all())
    True
    """
    check_choice("effort", effort, ("auto", *EFFORTS))
    rule = check_choice("renormalize", renormalize or "none", RENORMALIZATIONS)
    hiding = check_choice("hidden", hidden or "none", HIDDEN)
    model = check_choice("align", "auto" if align is True else align, ("auto", *MODELS)) if align else None
    power, cost = check_non_negative("volume_power", volume_power), check_edge_weight(edge_weight)
    average = as_averaging(averaging)
    check_choice("noise_like", noise_like, NOISES)
    level = None if noise is None else check_positive("noise", noise)
    check_that("detail", detail in (True, False, "auto"), f"be True, False or 'auto', not {detail!r}")
    check_excluded(
        f"detail={detail!r}", bool(detail), channels=channels, averaging=average, edge_weight=cost, volume_power=power
    )
    given = stack_versions(images, masks, nodata, space, channels=channels, alpha=alpha, any_size=bool(model))
    if detail:
        given = without_copies(given)
    with part(0, prepared := _PREPARED if model is None else _ALIGNED):
        evidence = prepare(
            given,
            weights,
            align=model,
            hidden=hiding,
            channels=channels,
            level=level and level * level_of(given, space),
            white=noise_like == "white" or not detail,
        )
    if isinstance(n_generators, str):
        check_choice("n_generators", n_generators, ("auto",))
        number = None
    else:
        number = check_count("n_generators", n_generators, given.known[:, :, 0].size, "the number of pixels")
    if detail == "auto":
        with part(prepared, prepared + _RECOGNIZED):
            detail = not is_drawing(evidence)
    with part(prepared + _RECOGNIZED, 1):
        if detail:
            found = denoise_versions(evidence, number, effort, np.random.default_rng(rng))
        else:
            how = Merging(average, cost, power, rule, "balanced" if effort == "auto" else effort, space)
            found = merge_versions(evidence, number, how)
    return in_order(found, evidence, space)
