"""Quantize or segment a picture of a gigapixel, and show the time and the memory that it takes.

The picture is made here: photographs of the sample images side by side, each tile with a light and a noise of its own,
in a tiled BigTIFF, compressed. Each size runs in a process of its own, whose peak memory the system tells.

    python benchmarks/gigapixel.py                        # 16384 x 16384 and 32768 x 32768: 3 GB of disk
    python benchmarks/gigapixel.py --sides 8192 16384
    python benchmarks/gigapixel.py --segment auto -k 4    # with edge weight; 0 for none
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import common
import numpy as np
import tifffile
from numpy.typing import NDArray

TILE = 512


def tiles(side: int, photographs: list[NDArray[np.uint8]]) -> Iterator[NDArray[np.uint8]]:
    """Give tiles of a large picture that is nowhere as a whole."""
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 2, (TILE, TILE, 3)).astype(np.float32)
    for number in range((side // TILE) ** 2):
        photograph = photographs[number % len(photographs)]
        top, left = (int(rng.integers(0, max(1, size - TILE + 1))) for size in photograph.shape[:2])
        part = photograph[top : top + TILE, left : left + TILE].astype(np.float32)
        light = rng.uniform(0.6, 1.15, 3).astype(np.float32)
        full = np.pad(part, ((0, TILE - part.shape[0]), (0, TILE - part.shape[1]), (0, 0)), "reflect")
        yield np.clip(full * light + noise, 0, 255).astype(np.uint8)


def make(path: Path, side: int) -> None:
    """Write the picture: of the sample images, so that it is the same everywhere."""
    (pictures,) = common.picture_sets(common.SAMPLES, None).values()
    photographs = [picture.pixels for picture in pictures]
    with tifffile.TiffWriter(path, bigtiff=True) as file:
        file.write(
            tiles(side, photographs),
            shape=(side, side, 3),
            dtype=np.uint8,
            tile=(TILE, TILE),
            photometric="rgb",
            compression="zstd",
            compressionargs={"level": 1},
        )


def measure(source: Path, target: Path, words: list[str]) -> str:
    """Run the command line to its end; return its row and what it cost."""
    command = [sys.executable, "-m", "cvtimg", words[0], source, "-o", target, "--json", *words[1:]]
    cost = common.run_process(command)
    if cost.failure:
        sys.exit(cost.failure)
    return f"{cost.wall:.0f} s, of processors {cost.cpu:.0f} s, peak memory {cost.peak / 2**10:.2f} GiB"


def main() -> None:
    """Print a line for each size."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--sides", type=int, nargs="+", default=[16384, 32768], metavar="N")
    options.add_argument("-k", type=int, default=64, metavar="N")
    options.add_argument("--segment", metavar="L", help="segment, with this edge weight")
    options.add_argument("--folder", type=Path, metavar="DIR", help="where there is room for the files")
    arguments = options.parse_args()
    print(common.machine())
    words = ["quantize"] if arguments.segment is None else ["segment", "--edge-weight", arguments.segment]
    words += ["-k", str(arguments.k)]
    for side in arguments.sides:
        with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
            source, target = Path(folder, "large.tif"), Path(folder, "small.tif")
            make(source, side)
            cost = measure(source, target, words)
            sizes = ", ".join(f"{path.stem} {path.stat().st_size / 1e6:.0f} MB" for path in (source, target))
            print(f"{side} x {side}, {' '.join(words)}: {cost}; {sizes}", flush=True)


if __name__ == "__main__":
    main()
