"""Restoration beside denoisers: pictures whose truth is known, damaged, and brought back.

Prints the quality (PSNR in dB where white is 1, and for flat pictures the share of pixels nearest to their true color)
and the seconds. cvtimg runs with its defaults. The parameter of each rival is the best of several, chosen by the truth,
which nobody who restores a picture has; its seconds are those of all of them.

    python benchmarks/restoration.py [--quick] [--photographs FOLDER]

With --photographs, the pictures of a folder are scaled to 384 x 256 pixels of 8 bits and restored from three versions
with 30 % holes each, and from a single complete one, at several noises. BM3D is a rival where its package, which is
not free software, is installed: with the true noise, and 0.9 and 1.1 times as much.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import ROOT, machine, parser, pin_threads, print_table, timed, write_results
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter
from skimage import __version__ as skimage_version
from skimage import data
from skimage.draw import disk, polygon
from skimage.restoration import denoise_nl_means, denoise_tv_chambolle

from cvtimg import restore, tessellate

sys.path.append(str(ROOT / "sample_images"))
from damage import Damage, damaged_versions

Floats = NDArray[np.float64]

CARD = np.array([[0.9, 0.85, 0.7], [0.2, 0.3, 0.75], [0.8, 0.2, 0.2], [0.15, 0.55, 0.3]])
PHOTOGRAPHS = ("astronaut", "coffee", "chelsea")


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A clean picture, what its three versions suffer, and what cvtimg is asked for."""

    name: str
    clean: Floats
    damage: Damage
    n_generators: int
    detail: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Damaged:
    """Versions, what each knows, and what every rival is given: their mean where known, filled, and its noise."""

    versions: list[Floats]
    known: list[NDArray[np.bool_]]
    mean: Floats
    filled: Floats
    sigma: float


def lecture() -> Floats:
    """(192, 192, 1) a ring and a bar on a background, in two levels."""
    side = 192
    picture = np.zeros((side, side, 1))
    picture[disk((0.42 * side, 0.4 * side), 0.25 * side)] = 1
    picture[int(0.55 * side) : int(0.85 * side), int(0.5 * side) : int(0.86 * side)] = 1
    picture[disk((0.42 * side, 0.4 * side), 0.1 * side)] = 0
    return picture


def card() -> Floats:
    """(256, 256, 3) a disc, a square and a triangle on a ground, in four colors."""
    side = 256
    which = np.zeros((side, side), np.intp)
    which[disk((0.35 * side, 0.3 * side), 0.2 * side)] = 1
    which[int(0.55 * side) : int(0.9 * side), int(0.1 * side) : int(0.45 * side)] = 2
    corners = np.array([[0.1, 0.75], [0.8, 0.55], [0.8, 0.95]]) * side
    which[polygon(*corners.T)] = 3
    return np.asarray(CARD[which], np.float64)


def cases() -> list[Case]:
    """List what is restored."""
    flat = [
        Case(f"two levels, painted over, noise {noise}", lecture(), Damage(noise=noise, occlusions=4), 2)
        for noise in (0.1, 0.3)
    ]
    flat.append(Case("card, noise 0.3, 30 % holes, a block", card(), Damage(noise=0.3, holes=0.3, blocks=1), 4))
    suffered = Damage(noise=0.1, holes=0.3)
    return flat + [Case(name, getattr(data, name)() / 255, suffered, 32, detail=True) for name in PHOTOGRAPHS]


def damaged(case: Case, seed: int, n_versions: int = 3) -> Damaged:
    """Damage a picture, three times unless told otherwise."""
    versions, known = damaged_versions(case.clean, n_versions, case.damage, seed)
    return fused(versions, known, case.damage.noise)


def fused(versions: list[Floats], known: list[NDArray[np.bool_]], noise: float) -> Damaged:
    """Take the mean of what is known; elsewhere, of what is near."""
    weight = np.sum(known, axis=0).astype(float)[:, :, None]
    total = np.sum([version * mask[:, :, None] for version, mask in zip(versions, known, strict=True)], axis=0)
    mean = total / np.maximum(weight, 1)
    near = gaussian_filter(total, (2, 2, 0)) / np.maximum(gaussian_filter(weight, (2, 2, 0)), 1e-9)
    filled = np.where(weight > 0, mean, near)
    sigma = noise * float(np.sqrt(np.mean(1 / weight[weight > 0])))
    return Damaged(versions, known, mean, filled, sigma)


def best(pictures: Iterable[Floats], clean: Floats) -> Floats:
    """Choose by the truth."""
    return max(pictures, key=lambda picture: psnr(picture, clean))


def total_variation(case: Case, given: Damaged) -> Floats:
    """Minimise the total variation, at the best of eight weights."""
    weights = (0.05, 0.08, 0.12, 0.18, 0.27, 0.4, 0.6, 0.9)
    tries = (denoise_tv_chambolle(given.filled, weight=weight, channel_axis=-1) for weight in weights)
    return best(tries, case.clean)


def non_local_means(case: Case, given: Damaged) -> Floats:
    """Average pixels with similar patches about them, at the best of six strengths."""
    tries = (
        denoise_nl_means(
            given.filled.squeeze(),
            patch_size=5,
            patch_distance=6,
            h=strength * given.sigma,
            sigma=given.sigma,
            channel_axis=-1 if case.clean.shape[2] > 1 else None,
        ).reshape(case.clean.shape)
        for strength in (0.4, 0.6, 0.8, 1.0, 1.3, 1.7)
    )
    return best(tries, case.clean)


def blur_and_cluster(case: Case, given: Damaged) -> Floats:
    """Blur, at the best of six radii, and give each pixel the mean of its cell of the blurred colors."""

    def clustered(radius: float) -> Floats:
        blurred = gaussian_filter(given.filled, (radius, radius, 0))
        rows = blurred.reshape(-1, blurred.shape[2])
        cells = tessellate(rows, case.n_generators, effort="fast")
        return np.asarray(cells.generators[cells.labels].reshape(blurred.shape), np.float64)

    return best(map(clustered, (0.5, 1, 1.5, 2, 3, 4)), case.clean)


def reconstruction(case: Case, given: Damaged) -> Floats:
    """Restore the versions as they are."""
    result = restore(given.versions, case.n_generators, masks=given.known, detail=case.detail)
    return np.asarray(result.image, np.float64)


RIVALS: dict[str, Callable[[Case, Damaged], Floats]] = {
    "cvtimg restore": reconstruction,
    "mean of what is known": lambda case, given: given.mean,
    "mean, holes filled by a blur": lambda case, given: given.filled,
    f"total variation, scikit-image {skimage_version}": total_variation,
    f"non-local means, scikit-image {skimage_version}": non_local_means,
    "blur and k-means": blur_and_cluster,
}


def psnr(picture: Floats, clean: Floats) -> float:
    """In dB; what leaves 0..1 is cut, for all alike."""
    return float(-10 * np.log10(np.mean((np.clip(picture, 0, 1) - clean) ** 2)))


def accuracy(picture: Floats, clean: Floats) -> float:
    """Share of pixels that are nearest to their own of the true colors."""
    colors, which = np.unique(clean.reshape(-1, clean.shape[2]), axis=0, return_inverse=True)
    apart = ((picture.reshape(-1, 1, clean.shape[2]) - colors) ** 2).sum(axis=2)
    return float(np.mean(apart.argmin(axis=1) == which.ravel()))


def bm3d_of(case: Case, given: Damaged) -> Floats | None:
    """Denoise the filled mean by BM3D, at the best of three noises; None if it is not installed."""
    try:
        from bm3d import bm3d, bm3d_rgb
    except ImportError:
        return None
    denoise = bm3d_rgb if case.clean.shape[2] == 3 else bm3d
    tries = (denoise(given.filled, factor * given.sigma) for factor in (0.9, 1.0, 1.1))
    return best((np.asarray(one, np.float64).reshape(case.clean.shape) for one in tries), case.clean)


def as_bytes(given: Damaged) -> Damaged:
    """Round and clip versions to 8 bits, as files hold them, and fuse them again."""
    versions = [np.rint(255 * np.clip(version, 0, 1)) / 255 for version in given.versions]
    weight = np.sum(given.known, axis=0)
    return fused(versions, given.known, given.sigma / float(np.sqrt(np.mean(1 / weight[weight > 0]))))


def photographs(folder: Path, quick: bool) -> list[dict[str, Any]]:
    """Restore the photographs of a folder, from three versions and from one."""
    rows = []
    paths = sorted(folder.glob("*.png"))[: 3 if quick else None]
    for n_versions, holes, noise in (
        (3, 0.3, 0.03),
        (3, 0.3, 0.1),
        (3, 0.3, 0.2),
        (1, 0, 0.05),
        (1, 0, 0.1),
        (1, 0, 0.2),
    ):
        for path in paths:
            with Image.open(path) as image:
                size = (384, 256) if image.width > image.height else (256, 384)
                clean = np.asarray(image.convert("RGB").resize(size, Image.Resampling.LANCZOS)) / 255
            case = Case(path.stem, clean, Damage(noise=noise, holes=holes), 32, detail=True)
            given = as_bytes(damaged(case, 1, n_versions))
            levels = [np.rint(255 * version).astype(np.uint8) for version in given.versions]
            result, seconds = timed(partial(restore, levels, masks=given.known, detail=True))
            other = bm3d_of(case, given)
            row = {"case": path.stem, "versions": n_versions, "holes": holes, "noise": noise, "seconds": seconds}
            row |= {"psnr": psnr(result.image / 255, clean), "bm3d": None if other is None else psnr(other, clean)}
            rows.append(row)
        found = rows[-len(paths) :]
        table = [
            [str(row["case"]), f"{row['psnr']:.2f}", "-" if row["bm3d"] is None else f"{row['bm3d']:.2f}"]
            for row in found
        ]
        table.append(["mean", f"{statistics.mean(row['psnr'] for row in found):.2f}", ""])
        print_table(f"{n_versions} versions, noise {noise}, {holes:.0%} holes", ("", "cvtimg", "BM3D"), table)
    return rows


def measure(case: Case, seeds: Iterable[int]) -> list[dict[str, Any]]:
    """Restore with all rivals, on the same damage; medians over the seeds."""
    records: dict[str, list[tuple[float, float, float]]] = {name: [] for name in RIVALS}
    for seed in seeds:
        given = damaged(case, seed)
        for name, rival in RIVALS.items():
            picture, seconds = timed(partial(rival, case, given))
            right = float("nan") if case.detail else accuracy(picture, case.clean)
            records[name].append((psnr(picture, case.clean), right, seconds))
    rows = []
    for name, runs in records.items():
        quality, right, seconds = (statistics.median(column) for column in zip(*runs, strict=True))
        rows.append({"case": case.name, "rival": name, "psnr": quality, "accuracy": right, "seconds": seconds})
    return rows


def main() -> None:
    """Measure, print, write."""
    arguments = parser(__doc__)
    arguments.add_argument("--photographs", type=Path, metavar="FOLDER")
    given = arguments.parse_args()
    pin_threads(given.threads)
    print(machine())
    if given.photographs:
        found = photographs(given.photographs, given.quick)
        write_results("photographs", {"quick": given.quick}, found)
        return
    rows = []
    for case in cases():
        n_seeds = 1 if given.quick or case.detail else 3
        found = measure(case, range(n_seeds))
        rows += found
        table = [
            [
                row["rival"],
                f"{row['psnr']:.1f}",
                "-" if case.detail else f"{row['accuracy']:.2%}",
                f"{row['seconds']:.2f}",
            ]
            for row in found
        ]
        print_table(case.name, ("", "PSNR, dB", "right pixels", "seconds"), table)
    of_photographs = [row for row in rows if row["case"] in PHOTOGRAPHS]
    means = [
        [name, f"{statistics.mean(row['psnr'] for row in of_photographs if row['rival'] == name):.2f}"]
        for name in RIVALS
    ]
    print_table("mean of the photographs", ("", "PSNR, dB"), means)
    write_results("restoration", {"quick": given.quick}, rows)


if __name__ == "__main__":
    main()
