"""Alignment: each version is moved to the place of the first, by a translation or up to a homography.

A transform maps pixels (x, y) of the first version to those of another. It is found from coarse to fine on a pyramid:
phase correlation at the top, then least squares at each level, with little weight where versions disagree, and with a
gain and an offset for their exposures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates, spline_filter

from cvtimg._shared.budgets import IN_CACHE
from cvtimg._shared.messages import warn
from cvtimg._shared.progress import each
from cvtimg._shared.threads import in_stripes, side_by_side
from cvtimg._shared.types import Bools, Floats, Floats32
from cvtimg.restoration.versions import Versions, fill

#: Models of motion, from simple to rich, and how many of the generators below each has.
MODELS = {"translation": 2, "euclidean": 3, "affine": 6, "homography": 8}
#: Generators of motions: translations, rotation, scales, shear, perspectives. Each model is a group.
_GENERATORS = np.eye(9).reshape(9, 3, 3)[[2, 5, 3, 0, 4, 1, 6, 7]]
_GENERATORS[2] -= _GENERATORS[2].T

#: Longest side, in pixels, of the top of the pyramid; blur of each level, which removes noise that would outvote the
#: image; and that below which, down to one, the structure lies that phase correlation compares.
_TOP, _BLUR, _COARSE = 192, 1.0, 8.0
#: Steps of least squares at each level, the pixels that they look at, and the length of a step at which they end.
_STEPS, _SAMPLED, _SHORT = 12, 1 << 16, 0.003
#: Standard deviations of differences that count half.
_OUTLYING = 3.0
#: Pixels that can be aligned, and the contrast, as a share of the values, up to which there is nothing to align.
_FEWEST, _FLAT = 64, 1e-5
#: Pixels at the border, which are not compared.
_BORDER = 2
#: Share of what a pixel is made from that must be known for it to be compared.
_COMPARED = 0.3
#: Times what the Bayesian information criterion asks for, that a richer model must explain.
_CAUTION = 1.5
#: Factor by which no motion between versions changes areas.
_ZOOM = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """Where versions lie."""

    transforms: Floats  # (S, 3, 3): from pixels (x, y, 1) of the first version to those of each
    models: tuple[str, ...]  # (S,): model of the motion of each

    @classmethod
    def none(cls, n_versions: int) -> Alignment:
        """Return versions where they are."""
        return cls(np.tile(np.eye(3), (n_versions, 1, 1)), ("translation",) * n_versions)

    def shifts(self, shape: tuple[int, ...]) -> Floats:
        """(S, 2) pixels, down and to the right, by which the center of each version was moved."""
        center = (np.array(shape[1::-1]) - 1) / 2
        places = np.array([_mapped(transform, *center) for transform in self.transforms])
        return (center - places)[:, ::-1]


def align(versions: Versions, model: str = "auto") -> tuple[Versions, Alignment]:
    """Find how versions moved and move them to the place of the first; pixels that this uncovers are unknown."""
    # S. Baker and I. Matthews, Int. J. Computer Vision 56 (2004) 221-255, doi 10.1023/B:VISI.0000011205.11775.fd, for
    # steps with the slopes of the image that stays in place, which are the same in all of them.
    values, known = list(versions.stack), versions.known.copy()
    alignment = Alignment.none(versions.n_versions)
    models, stuck = list(alignment.models), []
    fixed = _pyramid(versions, 0)

    def move(version: int) -> tuple[Floats, str, Floats32, Bools] | None:
        moving, seen = _pyramid(versions, version), versions.known[:, :, version]
        if fixed[-1].is_flat or moving[-1].is_flat or np.count_nonzero(seen & versions.known[:, :, 0]) < _FEWEST:
            return None
        transform, used = _transform(fixed, moving, model)
        bands, seen = moved(versions.bands(version), seen, transform)
        return transform, used, bands.astype(np.float16 if versions.dtypes[version].itemsize == 1 else np.float32), seen

    others = range(1, versions.n_versions)
    for version, end in zip(each(others), side_by_side(move, others), strict=True):
        if end is None:
            stuck += [f"images[{version}]"] if known[:, :, version].any() else []
        else:
            alignment.transforms[version], models[version], values[version], known[:, :, version] = end
    if stuck:
        why = "one of them is of one color or has too few pixels, or they know no pixels in common"
        warn(f"{', '.join(stuck)} cannot be aligned with images[0] and stay in place: {why}")
    return replace(versions, stack=tuple(values), known=known), Alignment(alignment.transforms, tuple(models))


@dataclass(frozen=True, slots=True, eq=False)
class _Level:
    """A gray image without its finest noise, and how far its pixels are known, 0..1."""

    values: Floats32
    weight: Floats32

    @classmethod
    def of(cls, values: Floats32, weight: Floats32) -> _Level:
        """Blur an image by normalized convolution."""
        share = gaussian_filter(weight, _BLUR, axes=(0, 1))
        total = gaussian_filter(values * weight, _BLUR, axes=(0, 1))
        return cls(fill(total[:, :, None], np.where(share > 1e-3, share, 0))[:, :, 0], share)

    @property
    def is_flat(self) -> bool:
        """Whether there is nothing to align."""
        inner = slice(_BORDER, -_BORDER), slice(_BORDER, -_BORDER)
        seen = self.values[inner][self.weight[inner] > _COMPARED]
        return len(seen) < _FEWEST or float(np.ptp(seen)) <= _FLAT * float(np.abs(seen).max())


def _pyramid(versions: Versions, version: int) -> list[_Level]:
    """Levels of the mean of the bands of a version, from the finest to the coarsest."""
    gray, weight = versions.bands(version).mean(axis=2), versions.known[:, :, version].astype(np.float32)
    levels = [_Level.of(gray, weight)]
    while max(levels[-1].values.shape) > _TOP:
        levels.append(_Level.of(levels[-1].values[::2, ::2], levels[-1].weight[::2, ::2]))
    return levels


def _transform(fixed: list[_Level], moving: list[_Level], model: str) -> tuple[Floats, str]:
    """(3, 3) transform from pixels of one image to those of another, and its model."""
    most = MODELS["euclidean" if model == "auto" else model]
    steps = [n_generators for n_generators in MODELS.values() if n_generators <= most]
    transform = _whole_shift(fixed[-1], moving[-1])
    doubled = np.diag([2.0, 2.0, 1.0])
    for number in range(len(fixed) - 1, -1, -1):
        pair = _Pair.of(fixed[number], moving[number])
        for n_generators in steps if number == len(fixed) - 1 else steps[-1:]:
            transform, _, _ = pair.improved(transform, n_generators)
        if number:
            transform = doubled @ transform @ np.linalg.inv(doubled)
    return _simplest(pair, transform) if model == "auto" else (transform, model)


def _whole_shift(fixed: _Level, moving: _Level) -> Floats:
    """(3, 3) translation by whole pixels."""
    from skimage.registration import phase_cross_correlation

    correlate: Any = phase_cross_correlation

    def structure(level: _Level) -> Floats32:
        window = np.outer(*(np.hanning(side + 2)[1:-1] for side in level.values.shape))
        fine = gaussian_filter(level.values, 1, axes=(0, 1)) - gaussian_filter(level.values, _COARSE, axes=(0, 1))
        return np.asarray(fine * window * level.weight)

    shift, _, _ = correlate(structure(fixed), structure(moving), normalization=None)
    return np.eye(3) + np.tensordot(-np.asarray(shift, np.float64)[::-1], _GENERATORS[:2], 1)


def _simplest(pair: _Pair, transform: Floats) -> tuple[Floats, str]:
    """Return the simplest model that fits as well as richer ones, by the Bayesian information criterion."""
    center = (np.array(pair.shape[::-1]) - 1) / 2
    shift = np.eye(3) + np.tensordot(np.array(_mapped(transform, *center)) - center, _GENERATORS[:2], 1)
    used, best = "translation", pair.improved(shift, MODELS["translation"])
    for name in list(MODELS)[1:]:
        richer = pair.improved(transform if used == "translation" else best[0], MODELS[name])
        asked = _CAUTION * (MODELS[name] - MODELS[used]) * np.log(pair.n_independent)
        if pair.evidence(best, richer) > asked:
            used, best = name, richer
    return best[0], used


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    """Pixels of one image that are to be found in another."""

    shape: tuple[int, int]
    places: Floats  # (2, N): x and y of pixels
    values: Floats32  # (N,)
    weights: Floats32  # (N,)
    slopes: Floats32  # (2, N): along x and y
    look: Callable[[Floats], Floats32]  # gives the values of the other image at places
    other_weight: Floats32  # of the other image
    n_independent: float  # number of pixels whose noise differs

    @classmethod
    def of(cls, fixed: _Level, moving: _Level) -> _Pair:
        """Draw pixels that are known."""
        inner = np.zeros(fixed.values.shape, np.bool_)
        inner[_BORDER:-_BORDER, _BORDER:-_BORDER] = fixed.weight[_BORDER:-_BORDER, _BORDER:-_BORDER] > _COMPARED
        chosen = np.flatnonzero(inner)
        n_independent = max(min(len(chosen) / (4 * np.pi * _BLUR**2), _SAMPLED), 2)
        if len(chosen) > _SAMPLED:
            chosen = np.sort(np.random.default_rng(0).choice(chosen, _SAMPLED, replace=False))
        down, right = np.gradient(fixed.values)
        y, x = np.divmod(chosen, fixed.values.shape[1])
        return cls(
            fixed.values.shape,
            np.stack([x, y]).astype(np.float64),
            fixed.values.ravel()[chosen],
            fixed.weight.ravel()[chosen],
            np.stack([right.ravel()[chosen], down.ravel()[chosen]]),
            _interpolation(moving.values[:, :, None]),
            moving.weight,
            n_independent,
        )

    def seen(self, transform: Floats) -> tuple[Floats32, Floats32]:
        """(N,) values of the other image at the places of the pixels, and weight behind both."""
        x, y = _mapped(transform, *self.places)
        height, width = self.shape
        at = np.stack([y, x])
        inside = (x >= 1) & (x <= width - 2) & (y >= 1) & (y <= height - 2)
        behind, values = np.empty_like(self.weights), np.empty_like(self.values)

        def see(some: slice) -> None:
            behind[some] = map_coordinates(self.other_weight, at[:, some], order=1, mode="nearest")
            values[some] = self.look(at[:, some])[:, 0]

        in_stripes(see, len(values), 128.0 * len(values), IN_CACHE >> 4)
        weights = inside * self.weights * behind
        return values, np.where(weights > _COMPARED**2, weights, 0)

    def improved(self, transform: Floats, n_generators: int) -> tuple[Floats, float, float]:
        """Take steps of least squares along some generators; return the transform, and gain and offset of the other."""
        # If they lead nowhere, the transform is as it was.
        from scipy.linalg import expm

        # Coordinates from -1 to 1 along the longer side make all parameters alike.
        half = max(self.shape) / 2
        to_unit = np.array([[1, 0, (1 - self.shape[1]) / 2], [0, 1, (1 - self.shape[0]) / 2], [0, 0, half]]) / half
        from_unit = np.linalg.inv(to_unit)
        x, y = _mapped(to_unit, *self.places)
        ways = np.tensordot(_GENERATORS[:n_generators], np.stack([x, y, np.ones_like(x)]), 1)
        ways = ways[:, :2] - ways[:, 2:] * np.stack([x, y])
        columns = (half * self.slopes * ways).sum(axis=1)
        current, gain, offset = transform, 1.0, 0.0
        for _ in range(_STEPS):
            seen, weights = self.seen(current)
            if np.count_nonzero(weights) < _FEWEST:
                return transform, 1.0, 0.0
            apart = gain * seen + offset - self.values
            outlying = _OUTLYING * _scale(apart[weights > 0])  # differences that have half the weight
            weights = weights * np.reciprocal(1 + np.square(apart / outlying)).astype(np.float32, copy=False)
            rows = np.stack([*columns, seen, np.ones_like(seen)]).astype(np.float64)
            weighted = rows * weights
            step, *_ = np.linalg.lstsq(weighted @ rows.T, -(weighted @ apart))
            gain, offset = gain + step[-2], offset + step[-1]
            motion = expm(np.tensordot(step[:n_generators], _GENERATORS[:n_generators], axes=1))
            current = current @ from_unit @ motion @ to_unit
            current /= current[2, 2]
            if not 1 / _ZOOM < np.linalg.det(current[:2, :2]) < _ZOOM:
                return transform, 1.0, 0.0
            if np.abs(step[:n_generators]).max() * half < _SHORT:
                break
        return current, gain, offset

    def evidence(self, simple: tuple[Floats, float, float], rich: tuple[Floats, float, float]) -> float:
        """Twice the logarithm of the likelihood ratio of a richer motion and a simpler one, as `improved` has them."""
        seen = [self.seen(transform) for transform, _, _ in (simple, rich)]
        both = np.minimum(seen[0][1], seen[1][1]) > 0
        fits = zip((simple, rich), seen, strict=True)
        aparts = [(gain * values + offset - self.values)[both] for (_, gain, offset), (values, _) in fits]
        unit = _OUTLYING * _scale(aparts[0])
        costs = [_OUTLYING**2 * np.log1p((apart / unit) ** 2).mean() for apart in aparts]
        return float(self.n_independent * (costs[0] - costs[1]))


def _scale(apart: Floats32) -> float:
    """Return the standard deviation, > 0, of differences some of which are not noise."""
    size = np.abs(apart)
    return max(1.4826 * float(np.median(size)), 1e-6 * float(size.max()), 1e-30)


def _mapped(transform: Floats, x: object, y: object) -> tuple[Any, Any]:
    (a, b, c), (d, e, f), (g, h, i) = transform
    scale = g * x + h * y + i
    return (a * x + b * y + c) / scale, (d * x + e * y + f) / scale


def moved(bands: Floats32, known: Bools, transform: Floats, estimate: Floats32 | None = None) -> tuple[Floats32, Bools]:
    """(H, W, C) values of a version at the place of the first, and where they are known."""
    # Without an estimate of what versions show they are interpolated. With one, they are those of the nearest pixels,
    # each moved by what the estimate changes by over that way, a part of a pixel: this keeps noise white, and what is
    # finer than the pixels.
    values, still_known, share = np.empty_like(bands), np.empty_like(known), known.astype(np.float32)
    look = _interpolation(fill(bands, share) if estimate is None else estimate)
    inverse = np.asarray(np.linalg.inv(transform), np.float64)
    last = np.array(known.shape)[:, None, None] - 1

    def move(rows: slice) -> None:
        y, x = np.mgrid[rows, : known.shape[1]].astype(np.float64)
        at = np.stack(_mapped(transform, x, y)[::-1])
        if estimate is None:
            values[rows] = look(at)
        else:
            at = np.rint(at)
            y, x = np.clip(at, 0, last).astype(np.intp)
            values[rows] = bands[y, x] + estimate[rows] - look(np.stack(_mapped(inverse, x, y)[::-1]))
        still_known[rows] = map_coordinates(share, at, order=1, cval=0) >= 0.5

    in_stripes(move, len(bands), work=64.0 * bands.size)
    return values, still_known


def _interpolation(image: Floats32) -> Callable[[Floats], Floats32]:
    """Return what gives the (..., C) values of an image, (H, W, C), at rows and columns, (2, ...)."""
    splines = [*side_by_side(lambda band: spline_filter(band, 3, np.float32, mode="nearest").T, [*image.T])]
    look = partial(map_coordinates, order=3, mode="nearest", prefilter=False, output=np.float32)
    return lambda at: np.stack([look(spline, at) for spline in splines], axis=-1)
