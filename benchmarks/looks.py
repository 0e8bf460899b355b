"""Bytes of indexed PNG files of equal looks, by cvtimg for eyes, cvtimg for least error, and pngquant.

Each program writes a curve of files of several qualities. Where two curves overlap in SSIMULACRA2, which the package
`ssimulacra2` computes and not cvtimg, the ratio of bytes is the mean over the common range, and over pictures.

    python benchmarks/looks.py [--quick] [--pictures 4] [--side 512]
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from common import Picture, machine, parser, picture_sets, print_table, progress, write_results
from numpy.typing import NDArray
from PIL import Image
from ssimulacra2 import compute_ssimulacra2

from cvtimg import quantize

#: What each program is asked for, from large files to small ones.
COLORS = (256, 192, 128, 96, 64, 48, 32, 16)
#: Points of a curve at which bytes are compared.
N_POINTS = 50

Curve = NDArray[np.float64]


def for_eyes(picture: Path, folder: Path) -> list[Path]:
    """Write files of falling size, as parts of the bytes at the lowest price of bits."""
    pixels = np.asarray(Image.open(picture))
    found = []
    for quality in (88, 85, 82, 79, 76, 73, 70, 66, 62):
        try:
            result = quantize(pixels, quality=quality)
        except ValueError:  # which 256 colors do not reach
            continue
        found.append(folder / f"eyes{quality}.png")
        result.save(found[-1], overwrite=True)
    return found


def least_error(picture: Path, folder: Path) -> list[Path]:
    """Write files of fewer and fewer colors."""
    pixels = np.asarray(Image.open(picture))
    for n_colors in COLORS:
        quantize(pixels, n_colors).save(folder / f"error{n_colors}.png", overwrite=True)
    return [folder / f"error{n_colors}.png" for n_colors in COLORS]


def pngquant(picture: Path, folder: Path) -> list[Path]:
    """Write files of fewer and fewer colors by pngquant's default."""
    paths = [folder / f"pngquant{n_colors}.png" for n_colors in COLORS]
    for n_colors, path in zip(COLORS, paths, strict=True):
        subprocess.run(["pngquant", "--force", "--output", path, str(n_colors), picture], check=True)
    return paths


def curve(picture: Path, paths: list[Path]) -> Curve:
    """Return (n, 2) scores and logarithms of bytes: files that no smaller one beats, by score."""
    files = sorted((path.stat().st_size, compute_ssimulacra2(str(picture), str(path))) for path in paths)
    best = files[:1]
    for file in files[1:]:
        if file[1] > best[-1][1]:
            best.append(file)
    return np.array([(score, np.log(size)) for size, score in best])


def ratio(rival: Curve, ours: Curve) -> float:
    """Return the bytes of ours over those of a rival at equal scores; NaN if their scores do not overlap."""
    low, high = max(rival[0, 0], ours[0, 0]), min(rival[-1, 0], ours[-1, 0])
    if high <= low:
        return float("nan")
    scores = np.linspace(low, high, N_POINTS)
    return float(np.exp((np.interp(scores, *ours.T) - np.interp(scores, *rival.T)).mean()))


def measure(picture: Picture, side: int) -> dict[str, float | str]:
    """Compare the programs on the middle of a picture."""
    programs: dict[str, Callable[[Path, Path], list[Path]]] = {
        "eyes": for_eyes, "error": least_error, "pngquant": pngquant
    }  # fmt: skip
    top, left = (max(0, (extent - side) // 2) for extent in picture.pixels.shape[:2])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source = folder / "source.png"
        Image.fromarray(picture.pixels[top : top + side, left : left + side]).save(source)
        curves = {one: curve(source, write(source, folder)) for one, write in programs.items()}
    return {
        "picture": picture.name,
        "eyes / pngquant": ratio(curves["pngquant"], curves["eyes"]),
        "error / pngquant": ratio(curves["pngquant"], curves["error"]),
        "score of eyes, least": float(curves["eyes"][0, 0]),
    }


def main() -> None:
    """Run the benchmark and print its table."""
    options = parser(__doc__)
    options.add_argument("--pictures", type=int, help="pictures of each set")
    options.add_argument("--side", type=int, default=384, help="side of the middle of each picture that is taken")
    given = options.parse_args()
    rows = []
    for name, pictures in picture_sets(given.data, 2 if given.quick else given.pictures).items():
        for picture in pictures:
            progress(f"{name}: {picture.name}")
            rows.append(measure(picture, given.side))
    names = ("eyes / pngquant", "error / pngquant")
    means = [f"{np.exp(np.nanmean([np.log(row[one]) for row in rows])):.3f}" for one in names]
    table = [[str(row["picture"]), *(f"{row[one]:.3f}" for one in names)] for row in rows]
    version = subprocess.run(["pngquant", "--version"], capture_output=True, text=True, check=True).stdout.split()[0]
    print(machine())
    print_table(f"Bytes at equal SSIMULACRA2, pngquant {version}", ["picture", *names], [*table, ["mean", *means]])
    write_results("looks", {"side": given.side, "pngquant": version}, rows)


if __name__ == "__main__":
    main()
