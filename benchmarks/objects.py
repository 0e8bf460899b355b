"""Objects counted without settings, beside Otsu's threshold and the watershed of the distance, tuned, of scikit-image.

Twelve phantoms of touching discs and ellipses with known truth (noise, uneven light, specks, dim and bright, small and
large, dark), four volumes of touching balls in planes some pixels apart, and 125 nuclei if they are there. F1 is of
objects whose overlap is over half of the union. The rival is tuned on these very images: to one setting for all, and to
the best for each. It is told which objects are dark. Then errors of counts on 300 drawn scenes, 50 of each kind.

    python benchmarks/objects.py [--seed N]
"""

import argparse
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from common import DATA, Rows, parser, run, timed
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter
from segmentation_scenes import DUST, pieces, score
from skimage.feature import peak_local_max
from skimage.filters import gaussian, threshold_otsu
from skimage.segmentation import watershed

import cvtimg
from cvtimg.segmentation import count_objects

SIDE = 320
#: Usual distance of the planes of a volume, in pixels.
SPACING = 3.0
#: What each phantom differs in.
SCENES: dict[str, dict[str, Any]] = {
    "clean": {"noise": 0.03},
    "noisy": {"noise": 0.3},
    "very noisy": {"noise": 0.6, "radius": 14, "n": 50},
    "crowded": {"overlap": 0.75, "n": 110},
    "uneven light": {"light": 0.9, "noise": 0.08},
    "uneven light, noisy": {"light": 0.9, "noise": 0.2},
    "dim and bright": {"levels": (0.25, 1.2), "noise": 0.06},
    "small": {"radius": 5, "n": 250, "noise": 0.15},
    "large": {"radius": 28, "n": 16, "noise": 0.15},
    "ellipses": {"elongation": 1.35, "n": 60},
    "specks": {"specks": 120},
    "dark": {"dark": True, "light": 0.5, "spread": 0.3},
}
#: What each volume differs in; `spacing` is the distance of planes in pixels.
VOLUMES: dict[str, dict[str, Any]] = {
    "volume": {},
    "volume, noisy": {"noise": 0.4},
    "volume, few planes": {"spacing": 5.0},
    "volume, small": {"radius": 7, "n": 150},
}
#: What drawn scenes differ in, of which only numbers are compared.
KINDS = ("bright in dark", "dark in bright", "touching", "shaded", "textured", "hollow")
N_OF_KIND = 50
BEST_FOR_PHANTOMS = (2, 7)
#: Blurs and least distances of peaks among which the rival is tuned.
SETTINGS = list(product((0.5, 1, 2, 3), (2, 3, 5, 7, 10, 14)))

Labels = NDArray[np.int32]


def objects(asked: argparse.Namespace) -> Rows:
    """Compare F1 of objects, and seconds with those of Otsu's threshold and the watershed."""
    scenes = {name: (*phantom(asked.seed + number, **how), how) for number, (name, how) in enumerate(SCENES.items())}
    scenes |= {name: (*volume(asked.seed + number, **how), how) for number, (name, how) in enumerate(VOLUMES.items())}
    folder = (asked.data or DATA) / "scenes"
    if (folder / "dsb2018_nuclei_img2d.png").exists():
        truth = np.load(folder / "dsb2018_nuclei_mask2d.npz")["labels"]
        scenes["125 nuclei"] = (cvtimg.read_image(folder / "dsb2018_nuclei_img2d.png"), truth, {})
    tuned = {name: [] for name in scenes}
    rows = []
    for name, (image, truth, how) in scenes.items():
        told = {"dark": how.get("dark", False), "spacing": None}
        if image.ndim == 3:
            told["spacing"] = (how.get("spacing", SPACING), 1, 1)
        tuned[name] = [score(rival(image, *one, **told), truth)["f1"] for one in SETTINGS]
        ours = partial(count_objects, image, spacing=told["spacing"])
        found, seconds = min((timed(ours) for _ in range(3)), key=lambda run: run[1])
        _, theirs = min((timed(partial(rival, image, 1, 3, **told)) for _ in range(3)), key=lambda run: run[1])
        row = score(found.labels, truth)
        rows.append({"scene": name, "f1": row["f1"], "objects": row["objects"], "times": seconds / theirs})
    best = np.mean(list(tuned.values()), axis=0).argmax()
    for row in rows:
        row |= {"tuned for all": tuned[row["scene"]][best], "tuned for each": max(tuned[row["scene"]])}
    mean = {name: float(np.mean([row[name] for row in rows])) for name in ("f1", "tuned for all", "tuned for each")}
    print(f"\nThe best setting for all: blur {SETTINGS[best][0]}, peaks {SETTINGS[best][1]} apart")
    return [*rows, {"scene": "mean", **mean}]


def counts(asked: argparse.Namespace) -> Rows:
    """Compare counts of 24 drawn discs: the mean error of either, in percent, and in how many scenes there is one."""
    rows = []
    for kind in KINDS:
        wrong = []
        for seed in range(asked.seed, asked.seed + N_OF_KIND):
            image = drawn(kind, seed)
            theirs = rival(image, *BEST_FOR_PHANTOMS, dark=kind == "dark in bright")
            wrong.append([abs(count_objects(image).n_segments - 24), abs(len(np.unique(theirs)) - 1 - 24)])
        ours, others = np.transpose(wrong)
        found = {"errors, %": ours.mean() / 0.24, "scenes with errors": int((ours > 0).sum())}
        rows.append({"kind": kind, **found, "Otsu and watershed, %": others.mean() / 0.24})
    return rows


def drawn(kind: str, seed: int) -> NDArray[np.uint8]:
    """Draw 24 discs of one kind, blurred and noisy."""
    rng = np.random.default_rng(seed)
    down, right = np.mgrid[:SIDE, :SIDE]
    level, at = np.zeros((SIDE, SIDE)), np.zeros(2)
    for number in range(24):
        before, at = at, np.array(divmod(number, 5)) * 62 + 34 + rng.uniform(-8, 8, 2)
        size, turn = rng.uniform(12, 18), rng.uniform(0, 2 * np.pi)
        if kind == "touching":
            size = 12
            at = before + 23 * np.array([np.sin(turn), np.cos(turn)]) if number % 2 else at
        away = np.hypot(down - at[0], right - at[1])
        level[(away < size) & (away > size - 5 if kind == "hollow" else True)] = rng.uniform(0.8, 1.2)
    relief = gaussian_filter(rng.normal(size=level.shape), 2)
    image = level * (1 + 0.3 * relief / relief.std() if kind == "textured" else 1)
    image = 0.25 + gaussian_filter(1.2 - image if kind == "dark in bright" else image, 1)
    if kind == "shaded":
        image *= 0.6 + 0.8 * right / SIDE
    return np.uint8((100 * (image + rng.normal(0, 0.05, image.shape))).clip(0, 255))


def phantom(
    seed: int,
    *,
    radius: float = 12,
    spread: float = 0.2,
    n: int = 70,
    overlap: float = 0.85,
    levels: tuple[float, float] = (1, 1),
    noise: float = 0.1,
    light: float = 0,
    specks: int = 0,
    elongation: float = 1,
    dark: bool = False,
) -> tuple[NDArray[np.uint8], Labels]:
    """Draw ellipses, most of which touch another, and return the image and their labels."""
    rng = np.random.default_rng(seed)
    down, right = np.mgrid[:SIDE, :SIDE]
    level, nearest, truth = np.zeros((SIDE, SIDE)), np.full((SIDE, SIDE), np.inf), np.zeros((SIDE, SIDE), np.int32)
    for label, (y, x, size) in enumerate(placed(rng, radius, spread, n, overlap), start=1):
        turn, stretch = rng.uniform(0, np.pi), elongation ** rng.uniform(-1, 1)
        along = (right - x) * np.cos(turn) + (down - y) * np.sin(turn)
        across = (down - y) * np.cos(turn) - (right - x) * np.sin(turn)
        away = np.hypot(along / (size * stretch), across * stretch / size)
        here = (away < 1) & (away < nearest)
        nearest[here], truth[here], level[here] = away[here], label, rng.uniform(*levels)
    image = gaussian_filter(level, 1.0)
    for y, x in rng.integers(3, SIDE - 3, (specks, 2)):
        image[y - 1 : y + 2, x - 1 : x + 1] += rng.uniform(0.5, 1)
    tilt = (right / SIDE - 0.5) * np.cos(seed) + (down / SIDE - 0.5) * np.sin(seed)
    bump = np.exp(-((right / SIDE - 0.6) ** 2 + (down / SIDE - 0.4) ** 2) * 4)
    image = (0.2 + image) * (1 + light * (tilt + bump - 0.5))
    image = (1.6 - image if dark else image) + rng.normal(0, noise, image.shape)
    return np.uint8((image * 110 + 10).clip(0, 255)), pieces_of(truth)


def volume(
    seed: int,
    *,
    spacing: float = SPACING,
    radius: float = 11,
    n: int = 60,
    noise: float = 0.15,
    overlap: float = 0.85,
    light: float = 0.6,
) -> tuple[NDArray[np.uint8], Labels]:
    """Draw balls, most of which touch another, in planes that are darker the deeper they are."""
    rng = np.random.default_rng(seed)
    sides = np.array([70, 160, 160])
    balls: list[NDArray[np.float64]] = []
    while len(balls) < n:
        size = radius * np.exp(rng.normal(0, 0.15))
        center = rng.uniform(0, sides)
        if balls and rng.random() < 0.6:
            other, way = balls[rng.integers(len(balls))], rng.normal(size=3)
            center = other[:3] + way / np.linalg.norm(way) * (other[3] + size) * rng.uniform(overlap, 1)
        inside = (center > size / 2).all() and (center < sides - size / 2).all()
        if inside and all(np.linalg.norm(center - b[:3]) >= overlap * (size + b[3]) for b in balls):
            balls.append(np.append(center, size))
    z, y, x = np.meshgrid(np.arange(0, sides[0], spacing), *map(np.arange, sides[1:]), indexing="ij")
    level, nearest, truth = np.zeros(z.shape), np.ones(z.shape), np.zeros(z.shape, np.int32)
    for label, (a, b, c, size) in enumerate(balls, start=1):
        away = np.sqrt((z - a) ** 2 + (y - b) ** 2 + (x - c) ** 2) / size
        here = away < nearest
        nearest[here], truth[here], level[here] = away[here], label, rng.uniform(0.7, 1.2)
    image = gaussian_filter(level, (1.5 / spacing, 1, 1))
    image = (0.2 + image) * (1 + light * (x / sides[2] - 0.5)) * np.exp(-0.7 * light * z / sides[0])
    return np.uint8(((image + rng.normal(0, noise, image.shape)) * 90 + 15).clip(0, 255)), pieces_of(truth)


def placed(
    rng: np.random.Generator, radius: float, spread: float, n: int, overlap: float
) -> list[tuple[float, float, float]]:
    """Place n discs, three of five beside another, none nearer than `overlap` times the sum of radii."""
    discs: list[tuple[float, float, float]] = []
    for _ in range(20000):
        size = radius * np.exp(rng.normal(0, spread))
        if discs and rng.random() < 0.6:
            other, turn = discs[rng.integers(len(discs))], rng.uniform(0, 2 * np.pi)
            away = (other[2] + size) * rng.uniform(overlap, 1)
            y, x = other[0] + away * np.sin(turn), other[1] + away * np.cos(turn)
        else:
            y, x = rng.uniform(0, SIDE, 2)
        inside = size / 2 < min(y, x) and max(y, x) < SIDE - size / 2
        if inside and all(np.hypot(y - b, x - a) >= overlap * (size + other) for b, a, other in discs):
            discs.append((y, x, size))
        if len(discs) == n:
            break
    return discs


def pieces_of(truth: Labels) -> Labels:
    """Leave out what is nearly hidden."""
    kept = np.bincount(truth.ravel()) > DUST
    kept[0] = False
    return np.where(kept[truth], truth, 0)


def rival(image: NDArray[Any], blur: float, apart: int, *, dark: bool = False, spacing: Any = None) -> Labels:
    """Find objects by scikit-image: threshold, distance, its peaks, and a watershed."""
    sides = np.array(spacing or (1, 1))
    smooth = gaussian(image, blur / sides, preserve_range=True)
    level = threshold_otsu(smooth)
    numbers = pieces(smooth < level if dark else smooth > level)
    distance = distance_transform_edt(numbers > 0, sides)
    peaks = peak_local_max(gaussian(distance, 1 / sides), min_distance=apart, labels=numbers, exclude_border=False)
    markers = np.zeros(image.shape, np.int32)
    markers[tuple(peaks.T)] = np.arange(1, len(peaks) + 1)
    return np.asarray(watershed(-distance, markers, mask=numbers > 0), np.int32)


if __name__ == "__main__":
    read = parser(__doc__)
    read.add_argument("--seed", type=int, default=700, help="of the first phantom (default: 700)")
    run(read, objects, counts)
