"""What users of color quantizers get: a PNG in, a picture of few colors out, plain and dithered, by whole programs.

Prints for each number of colors the mean over the pictures of: PSNR and CIEDE2000 without dithering; both after a
Gaussian blur of one pixel, which stands for an eye at some distance, with Floyd-Steinberg dithering; the bytes of the
files; and the median of the processor seconds of the whole process. Programs take turns on each picture.

    python benchmarks/dithering.py [--quick] [--k 16 64 256] [--pictures 4] [--rivals cvtimg pngquant]
"""

import argparse
import importlib.util
import shutil
import statistics
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from common import Picture, Rows, group, parser, picture_sets, progress, read_rgb, run, run_process
from numpy.typing import NDArray
from PIL import Image
from rivals import ImageMagick, Pngquant
from scipy.ndimage import gaussian_filter
from skimage.color import deltaE_ciede2000, rgb2lab
from whole_process import Spelling, find_cvtimg, spell_cvtimg, spell_magick, spell_pngquant

import cvtimg

#: It reads only GIF, and gets one of 256 colors made by cvtimg; its file is a GIF.
GIFSICLE = "gifsicle, from 256 colors"
#: Standard deviation of the blur, in pixels.
BLUR = 1.0
#: CIEDE2000 is taken at every so many pixels, in rows and in columns.
EACH = 2

#: Libraries of Python are run as a user would who writes a script of a few lines.
PILLOW = """
import sys
from PIL import Image
before, after, k, dithered = sys.argv[1:]
image = Image.open(before).convert("RGB")
few = image.quantize(int(k))
if dithered == "1":
    few = image.quantize(palette=few, dither=Image.Dither.FLOYDSTEINBERG)
few.save(after)
"""
IMAGEQUANT = """
import sys
import imagequant
from PIL import Image
before, after, k, dithered = sys.argv[1:]
imagequant.quantize_pil_image(
    Image.open(before).convert("RGBA"), dithering_level=float(dithered), max_colors=int(k), max_quality=100
).save(after)
"""


def programs(words: Sequence[str] | None) -> dict[str, Spelling]:
    """List the programs that run here, by name, and print why others are left out."""
    path, reason = find_cvtimg(None)
    pngquant, magick = Pngquant(), ImageMagick()
    known: dict[str, tuple[str, Spelling]] = {"cvtimg": (reason, spell_cvtimg(path))}
    known |= {f"cvtimg --space {space}": (reason, spell_cvtimg(path, "--space", space)) for space in ("lab", "oklab")}
    known["cvtimg --dither blue-noise"] = (reason, spell_cvtimg(path, method="blue-noise"))
    known["pngquant"] = (pngquant.missing(), spell_pngquant(pngquant.program))
    known["ImageMagick"] = (magick.missing(), spell_magick(magick.program))
    no_imagequant = "" if importlib.util.find_spec("imagequant") else "imagequant cannot be imported"
    gifsicle = shutil.which("gifsicle") or ""
    known[GIFSICLE] = ("" if gifsicle else "no program gifsicle on this machine", _gifsicle(gifsicle))
    known["imagequant and Pillow"] = (no_imagequant, _script(IMAGEQUANT))
    known["Pillow"] = ("", _script(PILLOW))
    chosen = {name: of for name, of in known.items() if words is None or any(word in name for word in words)}
    for name, (why, _) in chosen.items():
        print(f"- {name}{': left out: ' + why if why else ''}")
    return {name: spelling for name, (why, spelling) in chosen.items() if not why}


def _gifsicle(path: str) -> Spelling:
    return lambda before, after, k, dithered: [
        path, "--colors", str(k), *(["--dither=floyd-steinberg"] if dithered else []), "--output", after,
        before.with_suffix(".gif"),
    ]  # fmt: skip


def _script(code: str) -> Spelling:
    return lambda before, after, k, dithered: [sys.executable, "-c", code, before, after, str(k), str(int(dithered))]


def blurred(pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Blur in the values of the file, as the squared error is measured in them."""
    return np.asarray(gaussian_filter(pixels.astype(np.float32), (BLUR, BLUR, 0), mode="nearest"))


def psnr(before: NDArray[np.float32], after: NDArray[np.float32]) -> float:
    """Peak signal-to-noise ratio in dB."""
    return float(10 * np.log10(255**2 / np.square(before - after).mean(dtype=np.float64)))


def difference(before: NDArray[np.float32], after: NDArray[np.float32]) -> float:
    """Mean CIEDE2000."""
    lab, other = (rgb2lab(np.clip(pixels[::EACH, ::EACH] / 255, 0, 1)) for pixels in (before, after))
    return float(deltaE_ciede2000(lab, other).mean())


def measure(name: str, picture: Picture, k: int, commands: dict[str, Spelling], folder: Path) -> Rows:
    """Run every program on a picture, plain and dithered, and look at what it wrote."""
    before, after = folder / "before.png", folder / "after.png"
    Image.fromarray(picture.pixels).save(before)
    few = cvtimg.quantize(picture.pixels, 256)
    cvtimg.write_image(before.with_suffix(".gif"), few.indices, palette=few.palette, overwrite=True)
    originals = {False: picture.pixels.astype(np.float32), True: blurred(picture.pixels)}
    records = []
    for program, command in commands.items():
        for dithered, original in originals.items():
            if (not dithered and "--dither" in program) or (k >= 256 and program == GIFSICLE):
                continue
            progress(f"{name} {picture.name} k={k} {program}{' dithered' if dithered else ''}")
            cost = run_process(command(before, after, k, dithered))
            if cost.failure:
                sys.exit(f"{program} failed on {picture.name}: {cost.failure}")
            pixels = read_rgb(after)
            shown = blurred(pixels) if dithered else pixels.astype(np.float32)
            quality, seen = psnr(original, shown), difference(original, shown)
            n_bytes = after.stat().st_size
            case = {"set": name, "picture": picture.name, "k": k, "program": program, "dithered": dithered}
            found = {"psnr": quality, "difference": seen, "n_bytes": n_bytes, "seconds": cost.cpu}
            records.append({**case, **found})
    return records


def mean_of(own: Rows) -> dict[str, float]:
    """Return means of quality and bytes, and the median of seconds."""
    means = {key: statistics.fmean(row[key] for row in own) for key in ("psnr", "difference", "n_bytes")}
    return {**means, "seconds": statistics.median(row["seconds"] for row in own)}


def dithering(given: argparse.Namespace) -> tuple[Rows, Rows]:
    """Compare files, plain and dithered; the dithered after a blur."""
    commands = programs(given.rivals)
    sets = picture_sets(given.data, given.pictures or (1 if given.quick else None))
    rows: Rows = []
    with tempfile.TemporaryDirectory() as folder:
        for k in given.k or ([16, 256] if given.quick else [16, 64, 256]):
            for name, pictures in sets.items():
                for picture in pictures:
                    rows += measure(name, picture, k, commands, Path(folder))
    keys = ("k", "dithered", "program")
    cases = group(rows, lambda row: tuple(row[key] for key in keys))
    return rows, [{**dict(zip(keys, case, strict=True)), **mean_of(own)} for case, own in sorted(cases.items())]


if __name__ == "__main__":
    read = parser(__doc__)
    read.add_argument("--k", type=int, nargs="+", metavar="K", help="numbers of colors (default: 16 64 256)")
    read.add_argument("--pictures", type=int, metavar="N", help="at most N pictures of each set (default: all)")
    read.add_argument("--rivals", nargs="+", metavar="WORD", help="only programs whose name has one of these words")
    run(read, dithering)
