"""Files of equal looks, of whole sets of whole pictures: cvtimg for eyes beside other programs.

Each program makes files of 256 and of 48 colors, dithered; what SSIMULACRA2 says of them is what `cvtimg quantize
--quality` is asked for. Without dithering, programs are compared with `cvtimg quantize -k`. Bytes, those after oxipng,
and squared errors of cvtimg are multiples of theirs, with geometric means over pictures. "Quality" is by how much it is
better by SSIMULACRA2, less than 0 where it was out of reach, and "second" by how many dB of a measure that nothing was
tuned for: the blurred difference in Oklab, masked by texture. Seconds are those of processors, of whole processes.

The part drawn has thirty drawings of `drawings.py` without a target; the part gif has files of pngquant's colors by
gifsicle, also lossy ones; the part sheet writes parts of the pictures three times as large: as they are, in pngquant's
256 colors, and by cvtimg at the same score.

    python benchmarks/looks.py [--quick] [--parts png] [--k 48 256] [--pictures 4] [--rivals pngquant Pillow]
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import oxipng
from common import OUT, Picture, Rows, group, parser, picture_sets, progress, read_rgb, run, run_process, squared_error
from dithering import programs
from drawings import drawings
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter
from whole_process import Spelling, find_cvtimg, spell_cvtimg

from cvtimg.colors.spaces import to_space
from cvtimg.looks import VisualQuality, content_quality
from cvtimg.looks.rate import visibility

#: Side of the parts that are shown, and where their middles are, down and right.
SHOWN, PLACE = 80, 0.3
#: Standard deviations of the blurs of the second measure, and how much each counts.
BLURS = {0.7: 1, 1.5: 2, 3.0: 4}
#: How lossy gifsicle may be.
LOSSY = (0, 20, 80)
GIF = """
import subprocess, sys
from PIL import Image
lossy, before, after, k = sys.argv[1:]
subprocess.run(["pngquant", "--force", "--output", after, k, "--", before], check=True)
with Image.open(after) as image:
    image.save(after, "gif")
subprocess.run(["gifsicle", "-O3", f"--lossy={lossy}", "--output", after, after], check=True)
"""
#: Figures of which cvtimg has a multiple, and those by which it is better.
RATIOS, DIFFERENCES = ("bytes", "oxipng", "error"), ("quality", "second")

Pixels = NDArray[np.uint8]
Figures = dict[str, float]


class Measures:
    """What files are measured by, against an original."""

    def __init__(self, original: Pixels) -> None:
        self._original, self._quality, self._places = original, VisualQuality(original), placed(original)
        self._seen = visibility(self._places[:, :, 0])[:, :, None]

    def __call__(self, path: Path) -> Figures:
        """Return the figures of a file."""
        pixels, file = read_rgb(path), path.read_bytes()
        error = placed(pixels) - self._places
        blurred = [factor * gaussian_filter(error, (sigma, sigma, 0)) ** 2 for sigma, factor in BLURS.items()]
        second = -10 * np.log10((self._seen * sum(blurred)).mean())
        smaller = oxipng.optimize_from_memory(file) if path.suffix == ".png" else file
        figures = len(file), len(smaller), squared_error(self._original, pixels), self._quality(pixels), second
        return dict(zip([*RATIOS, *DIFFERENCES], figures, strict=True))


def placed(image: Pixels) -> NDArray[np.float64]:
    """Return pixels in Oklab, in levels of 8 bits."""
    return to_space(image.reshape(-1, 3), "oklab").reshape(image.shape) * [255, 127.5, 127.5]


def made(command: list[str | Path]) -> float:
    """Run a program, and return its processor seconds."""
    cost = run_process(command)
    if cost.failure:
        sys.exit(f"{command}: {cost.failure}")
    return cost.cpu


def measure(path: str, picture: Picture, k: int, rivals: dict[str, Spelling], suffix: str, dithered: bool) -> Rows:
    """Compare each program with cvtimg: dithered ones at equal quality, others with as many colors."""
    rows, measures = Rows(), Measures(picture.pixels)
    before, theirs, ours = (OUT / f"looks_{name}" for name in ("before.png", f"theirs{suffix}", f"ours{suffix}"))
    Image.fromarray(picture.pixels).save(before, compress_level=1)
    for name, command in rivals.items():
        progress(f"{picture.name}, {k} colors: {name}")
        seconds, found = made(command(before, theirs, k, dithered)), measures(theirs)
        asked = ["--quality", f"{max(found['quality'], 0)}"] if dithered else []
        own_seconds = made(spell_cvtimg(path, *asked)(before, ours, 256 if dithered else k, False))
        own = measures(ours)
        row = {"program": name, "k": k, "dithered": dithered, "picture": picture.name}
        row |= {key: own[key] / found[key] for key in RATIOS} | {key: own[key] - found[key] for key in DIFFERENCES}
        rows.append(row | {"theirs": found["bytes"], "cvtimg_seconds": own_seconds, "seconds": seconds})
        print(*rows[-1].values(), sep=", ", flush=True)  # a set takes long
    return rows


def compare(given: argparse.Namespace, rivals: dict[str, Spelling], suffix: str, *ways: bool) -> tuple[Rows, Rows]:
    """Compare programs on all pictures, and return the rows and their means."""
    OUT.mkdir(parents=True, exist_ok=True)
    rows, table, path = Rows(), Rows(), find_cvtimg(given.cvtimg)[0]
    for some in picture_sets(given.data, given.pictures or (2 if given.quick else None)).values():
        for picture in some:
            for k in given.k:
                for way in ways:
                    rows += measure(path, picture, k, rivals, suffix, way)
    for case, own in sorted(group(rows, lambda row: (row["program"], row["k"], row["dithered"])).items()):
        line: dict[str, object] = dict(zip(("program", "k", "dithered"), case, strict=True)) | {"n": len(own)}
        for key in (*RATIOS, *DIFFERENCES, "cvtimg_seconds", "seconds"):
            values = np.array([row[key] for row in own])
            line[key] = float(np.exp(np.log(values).mean()) if key in RATIOS else values.mean())
            if not key.endswith("seconds"):
                line[f"worst {key}"] = float(values.max() if key in RATIOS else values.min())
        table.append(line)
    return rows, table


def png(given: argparse.Namespace) -> tuple[Rows, Rows]:
    """PNG files."""
    return compare(given, programs(given.rivals), ".png", True, False)


def gif(given: argparse.Namespace) -> tuple[Rows, Rows]:
    """GIF files."""

    def spelled(lossy: int) -> Spelling:
        return lambda before, after, k, dithered: [sys.executable, "-c", GIF, f"{lossy}", before, after, f"{k}"]

    return compare(given, {f"gifsicle --lossy={lossy}": spelled(lossy) for lossy in LOSSY}, ".gif", True)


def drawn(given: argparse.Namespace) -> tuple[Rows, Rows]:
    """Drawings: what `cvtimg quantize` makes without a target, beside pngquant's 256 colors."""
    OUT.mkdir(parents=True, exist_ok=True)
    rows, path, rival = Rows(), find_cvtimg(given.cvtimg)[0], programs(["pngquant"])
    before, theirs, ours = (OUT / f"drawn_{name}.png" for name in ("before", "theirs", "ours"))
    for name, pixels in drawings():
        Image.fromarray(pixels).save(before, optimize=True)
        made(next(iter(rival.values()))(before, theirs, 256, True))
        made([path, "quantize", before, "-o", ours, "--overwrite", "--quiet"])
        seen, one, other = (np.asarray(Image.open(file).convert("RGBA")) for file in (before, theirs, ours))
        sizes = {"before": before.stat().st_size, "pngquant": theirs.stat().st_size, "cvtimg": ours.stat().st_size}
        row = {
            "drawing": name,
            **sizes,
            "its content": content_quality(seen, one),
            "content": content_quality(seen, other),
        }
        rows.append(row)
    ratio = float(np.exp(np.mean([np.log(row["cvtimg"] / row["pngquant"]) for row in rows])))
    return rows, Rows([{"bytes": ratio, "least content": min(row["content"] for row in rows)}])


def sheet(given: argparse.Namespace) -> Rows:
    """Parts of pictures."""
    import matplotlib.pyplot as plt

    pictures = [one for some in picture_sets(given.data, given.pictures).values() for one in some]
    figure, axes = plt.subplots(len(pictures), 3, figsize=(7.5, 2.7 * len(pictures)), layout="tight", squeeze=False)
    for picture, row_axes in zip(pictures, axes, strict=True):
        row = measure(find_cvtimg(given.cvtimg)[0], picture, 256, programs(["pngquant"]), ".png", True)[0]
        top, left = (max(0, round(PLACE * n) - SHOWN // 2) for n in picture.pixels.shape[:2])
        images = picture.pixels, *(read_rgb(OUT / f"looks_{name}.png") for name in ("theirs", "ours"))
        sizes = f"{row['theirs'] / 1000:.0f} kB", f"{row['theirs'] * row['bytes'] / 1000:.0f} kB"
        titles = "original", f"pngquant, {sizes[0]}", f"cvtimg, {sizes[1]}"
        for image, title, axis in zip(images, titles, row_axes, strict=True):
            axis.imshow(image[top : top + SHOWN, left : left + SHOWN], interpolation="nearest")
            axis.set_title(title)
            axis.set_axis_off()
    figure.savefig(OUT / "looks.webp", dpi=100)
    return Rows()


if __name__ == "__main__":
    read = parser(__doc__)
    read.add_argument("--k", type=int, nargs="+", default=[48, 256], metavar="K", help="numbers of colors")
    read.add_argument("--pictures", type=int, metavar="N", help="at most N pictures of each set (default: all)")
    read.add_argument("--rivals", nargs="+", default=["pngquant"], metavar="WORD", help="programs with such a word")
    read.add_argument("--cvtimg", metavar="PATH", help="the command to measure (default: that beside this Python)")
    run(read, png, gif, drawn, sheet)
