"""What must not change when a picture comes in another form: type, byte order, layout in memory, bands, alpha."""

from collections.abc import Callable
from typing import Any

import numpy as np
import PIL.Image
import pytest
from reference import of_three_threads, same_partition
from relations.relation import Relation, close, equal, quick_and_wide
from relations.remembering import beside, remembered
from skimage.filters import gaussian

import cvtimg
from cvtimg._shared.types import Array
from cvtimg.quantization.dithering import DITHERS

Image = Array
#: How often each of 44 columns stands in a picture, where weights are repetition.
TIMES = 1 + np.arange(44) % 3


def gray_picture(rng: np.random.Generator, shape: tuple[int, int] = (32, 44)) -> Image:
    """Return patches of light with a little noise, 8 bits, from 20 to 235."""
    patches = gaussian(rng.normal(size=shape), 4)
    levels = np.interp(patches, (patches.min(), patches.max()), (20, 235)).round(-1)
    return np.clip(levels + rng.normal(0, 2, shape), 0, 255).astype(np.uint8)


def color_picture(rng: np.random.Generator) -> Image:
    """Return three bands of such patches."""
    return np.dstack([gray_picture(rng) for _ in range(3)])


def alike(labels: Image, others: Image) -> None:
    """Assert that two label images have the same parts, but for a pixel of a hundred."""
    assert same_partition(labels, others) >= 0.99


def with_alpha(image: Image, alpha: Image) -> PIL.Image.Image:
    """Return a picture whose last band is declared to be its alpha."""
    return PIL.Image.merge(
        "LA" if image.ndim == 2 else "RGBA", [*map(PIL.Image.fromarray, np.dstack([image, alpha]).transpose(2, 0, 1))]
    )


#: What is compared of each verb, and how. Parts may differ by a few pixels where two are equally near; descents of
#: other roundings may end elsewhere; colors rounded to 8 bits cost a tenth of a decibel at most.
VERBS: dict[str, tuple[Callable[[Image], Any], Callable[[Any, Any], None]]] = {
    "quantize": (lambda image: cvtimg.quantize(image, 8).psnr, close(5e-3)),
    "segment": (lambda image: cvtimg.segment(image, 4).labels, alike),
    "superpixels": (lambda image: cvtimg.superpixels(image, 40).labels, alike),
    "segment_hierarchy": (lambda image: cvtimg.segment_hierarchy(image).cut(), alike),
    "mosaic": (lambda image: cvtimg.mosaic(image, 30).labels, equal),
    "stipple": (lambda image: cvtimg.stipple(image, 60).ink, close(1e-2)),
    "energy_curve": (lambda image: np.divide(*cvtimg.energy_curve(image, 6).energies[[3, 0]]), close(1e-2)),
}

#: Changes of any picture.
FORMS: dict[str, Callable[[Image], Any]] = {
    "16 bits": lambda image: image.astype(np.uint16) * np.uint16(257),
    "16 bits, big-endian": lambda image: (image.astype(np.uint16) * np.uint16(257)).astype(">u2"),
    "floats in 0..1": lambda image: image / 255,
    "integers of 64 bits": lambda image: image.astype(np.int64),
    "columns first in memory": np.asfortranarray,
    "every second of a larger array": lambda image: np.repeat(np.repeat(image, 2, 0), 2, 1)[::2, ::2],
    "a masked array that masks nothing": np.ma.masked_array,
    "an alpha that is opaque": lambda image: with_alpha(image, np.full(image.shape[:2], 255, np.uint8)),
}

#: Changes of gray pictures.
OF_GRAY: dict[str, Callable[[Image], Any]] = {"three equal bands": lambda image: np.dstack([image] * 3)}

#: Changes of the places of pixels, which do not matter to verbs that look at colors alone.
OF_PLACES: dict[str, Callable[[Image], Any]] = {
    "turned": np.rot90,
    "each pixel twice": lambda image: np.repeat(image, 2, 0),
    "bands permuted": lambda image: image[..., ::-1],
}
OF_COLORS: dict[str, Callable[[Image], Any]] = {
    "quantize": lambda image: cvtimg.quantize(image, 8).psnr,
    "energy_curve": lambda image: np.divide(*cvtimg.energy_curve(image, 6).energies[[3, 0]]),
    "find_palette": lambda image: cvtimg.find_palette(image, 5).tessellation.energy / image.size,
}

#: What is not so: an array (H, W) of other types than bytes is a table to `energy_curve`; three equal errors add up to
#: another rounding than one, and the descent of a mosaic may end in another of its many minima, not far above or below.
EXCEPT = {
    *(("energy_curve", form, gray_picture) for form in ("floats in 0..1", "integers of 64 bits")),
    ("mosaic", "three equal bands", gray_picture),
}


def with_holes(rng: np.random.Generator) -> tuple[Image, Image]:
    """Return a picture, and which of its pixels can be seen."""
    return color_picture(rng), gray_picture(rng) > 110


def noisy_below(given: tuple[Image, Image]) -> tuple[Image, Image]:
    """Change the colors that cannot be seen."""
    image, seen = given
    noise = np.random.default_rng(0).integers(0, 256, image.shape, np.uint8)
    return np.where(seen[..., None], image, noise), seen


def of_seen(verb: Callable[[Image], Any]) -> Callable[[tuple[Image, Image]], Any]:
    """Return what a verb makes of a picture with transparent pixels, but for what it has at these."""

    def result(given: tuple[Image, Image]) -> Any:
        image, seen = given
        made = np.asarray(verb(with_alpha(image, np.where(seen, np.uint8(255), np.uint8(0)))))
        return made[seen] if made.shape[:2] == seen.shape else made

    return result


#: Verbs that read transparent pictures, and what is compared.
OF_HOLES: dict[str, tuple[Callable[[Any], Any], Callable[[Any, Any], None]]] = {
    **VERBS,
    "find_palette": (lambda image: cvtimg.find_palette(image, 6).colors, equal),
    "stipple": (lambda image: cvtimg.stipple(image, 200).points, equal),
    "count_objects": (lambda image: cvtimg.segmentation.count_objects(image).labels, equal),
    "denoise": (lambda image: cvtimg.denoise([image]).image, equal),
    **{
        f"quantize, dither {dither}": (lambda image, d=dither: cvtimg.quantize(image, 6, dither=d).image, equal)
        for dither in DITHERS
    },
}


def measured(rng: np.random.Generator) -> Image:
    """Return values that are no shades of a screen, as some are below 0."""
    return gray_picture(rng) - 128.0


def drawn(verb: str) -> Callable[[Image], Any]:
    """Return what draws measurements, and tells that they are."""

    def result(image: Image) -> Any:
        with pytest.warns(UserWarning, match="measurements"):
            return OF_DRAWINGS[verb](image)

    return result


OF_DRAWINGS: dict[str, Callable[[Image], Any]] = {
    "stipple": lambda image: cvtimg.stipple(image, 60).points,
    "mosaic": lambda image: cvtimg.mosaic(image, 30).labels,
}


def of_repeated(image: Image, weights: Array | None = None) -> Any:
    return cvtimg.quantize(image, 12, weights=weights).palette


RELATIONS = (
    [
        Relation(verb, f"{change}, {inputs.__name__}", inputs, before, form, follows, "2026-11-27", rival=result)
        for verb, (result, follows) in VERBS.items()
        for before in [remembered(result)]
        for inputs in (gray_picture, color_picture)
        for change, form in {**FORMS, **(OF_GRAY if inputs is gray_picture else {})}.items()
        if (verb, change, inputs) not in EXCEPT
    ]
    + [
        Relation(verb, change, color_picture, result, moved, close(5e-3), "2026-11-28", "descents end elsewhere")
        for verb, result in ((verb, remembered(result)) for verb, result in OF_COLORS.items())
        for change, moved in OF_PLACES.items()
    ]
    + [
        Relation(verb, "hidden colors", with_holes, of_seen(result), noisy_below, follows, since="2026-11-28")
        for verb, (result, follows) in OF_HOLES.items()
    ]
    + [
        Relation(verb, f"measurements {change}", measured, drawn(verb), form, equal, since="2026-11-28")
        for verb in OF_DRAWINGS
        for change, form in {
            "in a unit of 2^-20": lambda image: image * 2.0**20,
            "with an offset": lambda image: image + 1e6,
        }.items()
    ]
    + [
        beside(verb, "three threads", color_picture, result, of_three_threads(result))
        for verb, (result, _) in OF_HOLES.items()
    ]
    + [
        Relation(
            "quantize",
            "a far row",
            lambda rng: gray_picture(rng).astype(float),
            lambda image: cvtimg.quantize(image, 5).palette[:5],
            lambda image: np.vstack([image, np.full((1, image.shape[1]), 1e20)]),
            close(1e-6),
            since="2026-11-28",
            rival=lambda image: cvtimg.quantize(image, 6).palette[:5],
        ),
        beside(
            "quantize",
            "weights as repetition",
            color_picture,
            lambda image: of_repeated(np.repeat(image, TIMES, axis=1)),
            lambda image: of_repeated(image, np.broadcast_to(TIMES, image.shape[:2])),
        ),
    ]
)
test_a_result_follows_its_picture, test_a_result_follows_any_picture = quick_and_wide(RELATIONS)
