"""Whole programs side by side: a PNG in, a PNG of 256 colors out, at 768 x 512 and at 12 megapixels.

Prints for each program the median seconds on the clock and of processors, the medians of their ratios to cvtimg in the
same round, the size of the file and the squared error per pixel. Programs take turns, in one order and then in the
other. Everything counts: starting, decoding, clustering, encoding. With --dither all do, by Floyd-Steinberg; otherwise
none does.

Name a cvtimg that was installed from a wheel by --cvtimg: one installed in place looks for changed sources first.

    python benchmarks/whole_process.py [--quick] [--rounds 5] [--k 256] [--dither] [--cvtimg PATH]
"""

import argparse
import shutil
import statistics
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from common import (
    DATA,
    Process,
    Rows,
    large_pictures,
    parser,
    progress,
    read_rgb,
    run,
    run_process,
    spread,
    squared_error,
)
from numpy.typing import NDArray
from rivals import ImageMagick, Pngquant

#: The program that the others are compared with.
MEASURE = "cvtimg quantize"

#: From input, output, k and whether to dither to a command.
Spelling = Callable[[Path, Path, int, bool], list[str | Path]]


def programs(cvtimg: str | None) -> dict[str, Spelling]:
    """List the programs that run here, by name, and print why others are left out."""
    pngquant, magick = Pngquant(), ImageMagick()
    known: dict[str, tuple[str, str, Spelling]] = {}
    path, reason = find_cvtimg(cvtimg)
    for words in ("", "--effort fast", "--goal eyes"):
        known[f"{MEASURE} {words}".strip()] = (reason, path, spell_cvtimg(path, *words.split()))
    for speed in ("", "11"):
        name = f"pngquant --speed {speed}" if speed else "pngquant"
        known[name] = (pngquant.missing(), pngquant.program, spell_pngquant(pngquant.program, speed))
    known["ImageMagick"] = (magick.missing(), magick.program, spell_magick(magick.program))
    versions = {"pngquant": pngquant, "ImageMagick": magick}
    for name, (why, _, _) in known.items():
        rival = versions.get(name.partition(" ")[0])
        print(f"- {name}: {'left out: ' + why if why else rival.version() if rival else path}")
    return {name: spelling for name, (why, _, spelling) in known.items() if not why}


def find_cvtimg(given: str | None) -> tuple[str, str]:
    """Return the command that is given, belongs to this Python or is on the path; and why it cannot be used, if so."""
    path = given or shutil.which("cvtimg", path=str(Path(sys.executable).parent)) or shutil.which("cvtimg")
    if not path:
        return "", "no command cvtimg beside this Python or on the path"
    return path, run_process([path, "quantize", "--help"]).failure


def spell_cvtimg(path: str, *extra: str, method: str = "floyd-steinberg") -> Spelling:
    """Spell `cvtimg quantize`."""
    return lambda before, after, k, dithered: [
        path, "quantize", before, "-k", str(k), "-o", after, "--overwrite", "--quiet", *extra,
        *(["--dither", method] if dithered else []),
    ]  # fmt: skip


def spell_pngquant(path: str, speed: str = "") -> Spelling:
    """Spell pngquant, which dithers unless it is told not to."""
    extra = ["--speed", speed] if speed else []
    return lambda before, after, k, dithered: [
        path, *([] if dithered else ["--nofs"]), *extra, "--force", "--output", after, str(k), "--", before
    ]  # fmt: skip


def spell_magick(path: str) -> Spelling:
    """Spell ImageMagick."""
    return lambda before, after, k, dithered: [
        path, before, *(["-dither", "FloydSteinberg"] if dithered else ["+dither"]), "-colors", str(k), f"png8:{after}"
    ]  # fmt: skip


def take_turns(
    picture: Path, folder: Path, commands: dict[str, Spelling], given: argparse.Namespace
) -> dict[str, list[Process]]:
    """Run every program once a round, in one order and then in the other; after a round that is not counted."""
    runs: dict[str, list[Process]] = {name: [] for name in commands}
    for turn in range(given.rounds + 1):
        for name in list(runs)[:: 1 if turn % 2 else -1]:
            progress(f"{picture.stem} round {turn} of {given.rounds}: {name}")
            cost = run_process(commands[name](picture, output(folder, name), given.k, given.dither))
            if cost.failure:
                print(f"- {name} is left out: it failed on {picture.name}: {cost.failure}")
                del runs[name]
            elif turn:
                runs[name].append(cost)
    progress("")
    return runs


def output(folder: Path, name: str) -> Path:
    """Name the file that a program writes."""
    return folder / f"{name.replace(' ', '_')}.png"


def summarize(picture: Path, pixels: NDArray[np.uint8], folder: Path, runs: dict[str, list[Process]]) -> Rows:
    """Take medians, and measure what was written."""
    base = runs.get(MEASURE)
    return [
        {
            "picture": picture.stem,
            "program": name,
            "seconds": statistics.median(cost.wall for cost in costs),
            "ratio": _median_ratio([cost.wall for cost in costs], [cost.wall for cost in base or ()]),
            "cpu_seconds": statistics.median(cost.cpu for cost in costs),
            "cpu_ratio": _median_ratio([cost.cpu for cost in costs], [cost.cpu for cost in base or ()]),
            "file_mib": output(folder, name).stat().st_size / 2**20,
            "error": squared_error(pixels, read_rgb(output(folder, name))),
        }
        for name, costs in runs.items()
    ]


def _median_ratio(costs: Sequence[float], base: Sequence[float]) -> float | None:
    """Take the median of the ratio to cvtimg, round by round: what slows a round slows both."""
    if not base:
        return None
    return round(statistics.median(cost / other for cost, other in zip(costs, base, strict=True)), 3)


def pictures(given: argparse.Namespace) -> list[Path]:
    """List the pictures: photographs of 768 x 512, where there are any, then those of 12 megapixels."""
    small = sorted(((given.data or DATA) / "kodak").glob("*.png"))
    return [*spread(small, 1 if given.quick else 3), *large_pictures(given.data)[: 1 if given.quick else None]]


def processes(given: argparse.Namespace) -> Rows:
    """Time whole processes from PNG to PNG: medians of rounds."""
    given.rounds = given.rounds or (2 if given.quick else 5)
    commands = programs(given.cvtimg)
    rows: Rows = []
    for picture in pictures(given):
        with tempfile.TemporaryDirectory() as folder:
            runs = take_turns(picture, Path(folder), commands, given)
            rows += summarize(picture, read_rgb(picture), Path(folder), runs)
    return rows


if __name__ == "__main__":
    read = parser(__doc__)
    read.add_argument("--k", type=int, default=256, metavar="K", help="number of colors (256)")
    read.add_argument("--rounds", type=int, metavar="N", help="times of which to take the median (5; quick: 2)")
    read.add_argument("--cvtimg", metavar="PATH", help="the command to measure (default: that beside this Python)")
    read.add_argument("--dither", action="store_true", help="with Floyd-Steinberg dithering")
    run(read, processes)
