"""What must not change in counts when a picture of objects gets a frame, other values or another form."""

import numpy as np
from relations.relation import Relation, close, equal, quick_and_wide
from relations.remembering import beside, remembered
from scipy import ndimage
from scipy.optimize import linear_sum_assignment
from skimage.filters import threshold_otsu
from skimage.measure import label

from cvtimg._shared.types import Array, Ints
from cvtimg.segmentation import count_objects

Image = Array
SIDE = 220
DOWN, RIGHT = np.mgrid[:SIDE, :SIDE]
SPRINKLED = np.random.default_rng(0).random((SIDE, SIDE)) < 0.02


def truth(rng: np.random.Generator) -> Ints:
    """Label discs and rods of up to four times their width, apart from each other, in cells of 55 pixels."""
    labels = np.zeros((SIDE, SIDE), np.int32)
    for index, (y, x) in enumerate(np.mgrid[27:SIDE:55, 27:SIDE:55].reshape(2, -1).T):
        radius, turn = rng.uniform(4, 6), rng.uniform(0, np.pi)
        along = (RIGHT - x) * np.cos(turn) + (DOWN - y) * np.sin(turn)
        across = (DOWN - y) * np.cos(turn) - (RIGHT - x) * np.sin(turn)
        labels[np.hypot(np.maximum(abs(along) - radius * rng.choice([0, 3]), 0), across) < radius] = index + 1
    return labels


def picture(rng: np.random.Generator) -> Image:
    """Draw them in 8 bits, with noise of a twentieth of their contrast."""
    level = ndimage.gaussian_filter(70 + 100.0 * (truth(rng) > 0), 0.8)
    return np.uint8((level + rng.normal(0, 5, level.shape)).clip(0, 255).round())


def empty(rng: np.random.Generator) -> Image:
    """Return noise alone."""
    return rng.normal(100, 8, (SIDE, SIDE))


def light(rng: np.random.Generator) -> Image:
    """Return light alone, without noise: from a side, through a lens that darkens corners, or in a wave."""
    along = (RIGHT * rng.uniform(0, 1) + DOWN) / SIDE
    lens = 1 / (1 + rng.uniform(0.2, 1.5) * ((DOWN / SIDE - 0.5) ** 2 + (RIGHT / SIDE - 0.5) ** 2)) ** 2
    return rng.uniform(0, 80) + rng.uniform(20, 80) * rng.choice([along, 2 * lens, 1 + np.sin(2 * along)])


@remembered
def number(image: Image) -> int:
    return count_objects(image).n_segments


def in_a_well(image: Image) -> Image:
    """Put it in a round well in a plate that is as bright as objects."""
    well = np.pad(image, 50, mode="reflect")
    y, x = np.mgrid[: len(well), : len(well)] - len(well) / 2
    ground = np.random.default_rng(0).normal(70, 5, well.shape)
    inner = np.where(np.pad(np.ones(image.shape, bool), 50), well, ground)
    return np.where(np.hypot(y, x) < len(well) / 2 - 4, inner, ground + 110)


def enlarged(image: Image) -> Image:
    return ndimage.zoom(image.astype(float), 1.5, order=1, grid_mode=True, mode="nearest")


def with_truth(rng: np.random.Generator) -> tuple[Image, Ints]:
    """Return a picture and its labels."""
    seed = int(rng.integers(1 << 30))
    return picture(np.random.default_rng(seed)), truth(np.random.default_rng(seed))


def matched(labels: Array, right: Ints) -> int:
    """Return how many objects have a label that shares half of the union with them."""
    shared = np.histogram2d(right.ravel(), labels.ravel(), [np.arange(n + 2) for n in (right.max(), labels.max())])[0]
    union = shared.sum(axis=1)[:, None] + shared.sum(axis=0) - shared
    overlap = (shared / np.maximum(union, 1))[1:, 1:] > 0.5
    return int(overlap[linear_sum_assignment(overlap, maximize=True)].sum())


def by_cvtimg(pair: tuple[Image, Ints]) -> int:
    return matched(count_objects(pair[0]).labels, pair[1])


def by_otsu(pair: tuple[Image, Ints]) -> int:
    """Match labels of what Otsu's threshold finds in an image that is blurred a little."""
    smooth = ndimage.gaussian_filter(pair[0].astype(float), 1)
    return matched(label(smooth > threshold_otsu(smooth)), pair[1])


def not_fewer(result: int, rival: int) -> None:
    assert result >= rival


CHANGES = {
    "a frame of a pixel": lambda image: np.pad(image, 1, constant_values=255),
    "a frame of the least value": lambda image: np.pad(image, 2),
    "a frame in a frame": lambda image: np.pad(np.pad(image, 3), 9, constant_values=255),
    "bars above and below": lambda image: np.pad(image, ((20, 30), (0, 0)), constant_values=255),
    "a well in a plate": in_a_well,
    "shifted": lambda image: np.roll(image, (55, 110), (0, 1)),
    "cut": lambda image: image[2:-2, 1:-1],
    "turned by a quarter": np.rot90,
    "mirrored": np.fliplr,
    "turned by 30 degrees": lambda image: ndimage.rotate(image.astype(float), 30, order=1, cval=0),
    "scaled and with an offset": lambda image: image * 1e-3 - 7,
    "16 bits": lambda image: image.astype(np.uint16) * 257,
    "integers below 0": lambda image: image.astype(np.int16) - 3000,
    "in negative": lambda image: 255 - image,
    "larger by half": enlarged,
    "three equal bands": lambda image: np.dstack([image] * 3),
    "light from the left": lambda image: image + 2.0 * RIGHT,
    "light from below": lambda image: image + 3.0 * DOWN,
    "a light in the middle": lambda image: image - 0.015 * ((DOWN - 110) ** 2 + (RIGHT - 110) ** 2),
    "salt": lambda image: np.where(SPRINKLED, 255, image),
}
#: However noise is treated, it holds no objects.
TREATMENTS = {
    "nothing": lambda image: image,
    "a blur": lambda image: ndimage.gaussian_filter(image, 1),
    "a median": lambda image: ndimage.median_filter(image, 3),
    "half a pixel": lambda image: ndimage.shift(image, 0.5, order=1, mode="nearest"),
    "larger by half": enlarged,
    "shade": lambda image: image + np.linspace(0, 60, SIDE),
    "rounded to some levels": lambda image: np.rint(image / 13),
    "impulses alone": lambda image: np.where(image > 120, 255, np.where(image < 80, 0, 128))[:60, :50],
    "pepper": lambda image: np.where(SPRINKLED, 0, image),
    "salt": lambda image: np.where(SPRINKLED, 255, image),
}
#: What light alone is rounded to holds none either.
ROUNDED = {
    "noise": lambda image: np.random.default_rng(0).normal(100, 8, image.shape),
    "8 bits": lambda image: np.uint8(image.clip(0, 255).round()),
    "64 bits": lambda image: (2.0**55 * image).astype(np.uint64),
    "single floats": lambda image: np.float32(image),
    "a strip": lambda image: image[:, :12].round(),
}
SINCE = "2026-11-27"
#: Noise that interpolation shares among pixels moves outlines farther than the law of ripples says: one may be two.
MAY_SPLIT = {"larger by half": close(0, 4)}
RELATIONS = [
    *(
        Relation("count_objects", name, picture, number, change, MAY_SPLIT.get(name, equal), SINCE)
        for name, change in CHANGES.items()
    ),
    *(Relation("count_objects, empty", name, empty, number, how, equal, SINCE) for name, how in TREATMENTS.items()),
    *(Relation("count_objects, light", name, light, number, how, equal, "2026-11-28") for name, how in ROUNDED.items()),
    beside("count_objects", "Otsu's threshold, with labels", with_truth, by_cvtimg, by_otsu, not_fewer, SINCE),
]
test_a_count_follows_its_picture, test_a_count_follows_any_picture = quick_and_wide(RELATIONS)
