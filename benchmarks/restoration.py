"""Restoration beside denoisers: pictures whose truth is known, damaged, and brought back.

Prints the quality (PSNR in dB where white is 1, and for flat pictures the share of pixels nearest to their true color)
and the seconds. cvtimg runs with its defaults. The parameter of each rival is the best of several, chosen by the truth,
which nobody who restores a picture has; its seconds are those of all of them.

    python benchmarks/restoration.py [--quick] [--photographs FOLDER] [--damages 6] [--rivals BM3D]

With --photographs, the pictures of a folder are scaled to 384 x 256 pixels of 8 bits and restored from three versions
with 30 % holes each, and from a single complete one, at several noises. BM3D is a rival where its package, which is
not free software, is installed. Of the pictures of Kodak, parameters were chosen on kodim03, kodim05 and kodim19 only.
"""

import statistics
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import ROOT, machine, parser, pin_threads, print_means, print_table, timed, write_results
from denoisers import DENOISERS, NON_LOCAL_MEANS, TOTAL_VARIATION, Damaged, fused, psnr
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter
from skimage.draw import disk, polygon

from cvtimg import denoise, restore, tessellate
from cvtimg._shared.choices import EffortName

sys.path.append(str(ROOT / "sample_images"))
from damage import Damage, damaged_versions

Floats = NDArray[np.float64]

CARD = np.array([[0.9, 0.85, 0.7], [0.2, 0.3, 0.75], [0.8, 0.2, 0.2], [0.15, 0.55, 0.3]])
#: What photographs of a folder suffer: number of versions, share of holes in each, noise.
DAMAGES = ((3, 0.3, 0.1), (1, 0.0, 0.1), (3, 0.3, 0.2), (3, 0.3, 0.03), (1, 0.0, 0.05), (1, 0.0, 0.2))
EFFORTS: tuple[EffortName, ...] = ("balanced", "best")


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A clean picture, what its three versions suffer, and what cvtimg is asked for."""

    name: str
    clean: Floats
    damage: Damage
    n_generators: int


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
    return flat


def damaged(case: Case, seed: int, n_versions: int = 3) -> Damaged:
    """Damage a picture, three times unless told otherwise."""
    versions, known = damaged_versions(case.clean, n_versions, case.damage, seed)
    return fused(versions, known, case.damage.noise)


def blur_and_cluster(case: Case, given: Damaged) -> Floats:
    """Blur, at the best of six radii, and give each pixel the mean of its cell of the blurred colors."""

    def clustered(radius: float) -> Floats:
        blurred = gaussian_filter(given.filled, (radius, radius, 0))
        rows = blurred.reshape(-1, blurred.shape[2])
        cells = tessellate(rows, case.n_generators, effort="fast")
        return np.asarray(cells.generators[cells.labels].reshape(blurred.shape), np.float64)

    return max(map(clustered, (0.5, 1, 1.5, 2, 3, 4)), key=lambda picture: psnr(picture, case.clean))


def reconstruction(case: Case, given: Damaged) -> Floats:
    """Restore the versions as they are."""
    return np.asarray(restore(given.versions, case.n_generators, masks=given.known).image, np.float64)


RIVALS: dict[str, Callable[[Case, Damaged], Floats]] = {
    "cvtimg restore": reconstruction,
    "mean of what is known": lambda case, given: given.mean,
    "mean, holes filled by a blur": lambda case, given: given.filled,
    **{
        rival.name: lambda case, given, rival=rival: rival.best(case.clean, given)  # type: ignore[misc]
        for rival in (TOTAL_VARIATION, NON_LOCAL_MEANS)
    },
    "blur and k-means": blur_and_cluster,
}


def accuracy(picture: Floats, clean: Floats) -> float:
    """Share of pixels that are nearest to their own of the true colors."""
    colors, which = np.unique(clean.reshape(-1, clean.shape[2]), axis=0, return_inverse=True)
    apart = ((picture.reshape(-1, 1, clean.shape[2]) - colors) ** 2).sum(axis=2)
    return float(np.mean(apart.argmin(axis=1) == which.ravel()))


def as_bytes(given: Damaged) -> Damaged:
    """Round and clip versions to 8 bits, as files hold them, and fuse them again."""
    versions = [np.rint(255 * np.clip(version, 0, 1)) / 255 for version in given.versions]
    weight = np.sum(given.known, axis=0)
    return fused(versions, given.known, given.sigma / float(np.sqrt(np.mean(1 / weight[weight > 0]))))


def photograph(path: Path) -> Floats:
    """(256, 384, 3) or (384, 256, 3) photograph, in 0..1."""
    with Image.open(path) as image:
        size = (384, 256) if image.width > image.height else (256, 384)
        return np.asarray(image.convert("RGB").resize(size, Image.Resampling.LANCZOS)) / 255


def photographs(paths: list[Path], n_damages: int, words: list[str] | None) -> list[dict[str, Any]]:
    """Restore photographs, from three versions and from one, beside denoisers."""
    rows = []
    denoisers = [one for one in DENOISERS if words is None or any(word in one.name for word in words)]
    for n_versions, holes, noise in DAMAGES[:n_damages]:
        quality, seconds = list[dict[str, float]](), list[dict[str, float]]()
        for path in paths:
            clean = photograph(path)
            given = as_bytes(damaged(Case(path.stem, clean, Damage(noise=noise, holes=holes), 32), 1, n_versions))
            found = {one.name: one.quality(clean, given) for one in denoisers}
            levels = [np.rint(255 * version).astype(np.uint8) for version in given.versions]
            for effort in EFFORTS:
                result, time_ = timed(partial(denoise, levels, masks=given.known, effort=effort), time.process_time)
                found[f"cvtimg, {effort}"] = psnr(result.image / 255, clean), time_
            quality.append({name: one[0] for name, one in found.items()})
            seconds.append({name: one[1] for name, one in found.items()})
        title, names = f"{n_versions} versions, noise {noise}, {holes:.0%} holes", [path.stem for path in paths]
        print_means(f"{title}: PSNR, dB", names, quality, ".2f")
        print_means(f"{title}: processor seconds", names, seconds, ".1f")
        about = {"versions": n_versions, "holes": holes, "noise": noise}
        rows += [
            {**about, "case": name, "psnr": one, "seconds": other}
            for name, one, other in zip(names, quality, seconds, strict=True)
        ]
    return rows


def measure(case: Case, seeds: Iterable[int]) -> list[dict[str, Any]]:
    """Restore with all rivals, on the same damage; medians over the seeds."""
    records: dict[str, list[tuple[float, float, float]]] = {name: [] for name in RIVALS}
    for seed in seeds:
        given = damaged(case, seed)
        for name, rival in RIVALS.items():
            picture, seconds = timed(partial(rival, case, given))
            records[name].append((psnr(picture, case.clean), accuracy(picture, case.clean), seconds))
    rows = []
    for name, runs in records.items():
        quality, right, seconds = (statistics.median(column) for column in zip(*runs, strict=True))
        rows.append({"case": case.name, "rival": name, "psnr": quality, "accuracy": right, "seconds": seconds})
    return rows


def main() -> None:
    """Measure, print, write."""
    arguments = parser(__doc__)
    arguments.add_argument("--photographs", type=Path, metavar="FOLDER")
    arguments.add_argument("--damages", type=int, default=len(DAMAGES), metavar="N", help="only the first N damages")
    arguments.add_argument(
        "--rivals", nargs="+", metavar="WORD", help="only denoisers whose name has one of these words"
    )
    given = arguments.parse_args()
    pin_threads(given.threads)
    print(machine())
    if given.photographs:
        paths = sorted(given.photographs.glob("*.png"))[: 3 if given.quick else None]
        found = photographs(paths, given.damages, given.rivals)
        write_results("photographs", {"quick": given.quick}, found)
        return
    rows = []
    for case in cases():
        found = measure(case, range(1 if given.quick else 3))
        rows += found
        table = [
            [row["rival"], f"{row['psnr']:.1f}", f"{row['accuracy']:.2%}", f"{row['seconds']:.2f}"] for row in found
        ]
        print_table(case.name, ("", "PSNR, dB", "right pixels", "seconds"), table)
    write_results("restoration", {"quick": given.quick}, rows)


if __name__ == "__main__":
    main()
