"""What every benchmark needs: pictures, one number of threads, clocks, tables and files of results."""

import argparse
import csv
import hashlib
import importlib.util
import json
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT.parent / "shared" / "data"
SAMPLES = ROOT / "sample_images"
OUT = ROOT / "out" / "benchmarks"

#: Folders of small photographs, in the order of the tables.
SETS = ("cq100", "kodak")
#: Width and height of the large picture: 12.3 megapixels.
LARGE = (4096, 3000)

#: What a part of a benchmark measures: a value for each column.
Rows = list[dict[str, Any]]
T = TypeVar("T")
S = TypeVar("S")


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A picture that was read: its name and (H, W, 3) uint8 pixels."""

    name: str
    pixels: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Process:
    """What a process cost: seconds on the clock and of processors, memory in MiB, and how it failed, if it did."""

    wall: float
    cpu: float
    failure: str
    peak: float


def read_rgb(path: Path) -> NDArray[np.uint8]:
    """Read the pixels of a picture as they are in the file: no rival is given a color profile to handle."""
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def picture_sets(data: Path | None, n_pictures: int | None) -> dict[str, list[Picture]]:
    """Read the sets that are in the folder `data`, or the folder itself as one set, or the sample images.

    With `n_pictures` a set is cut to as many of its pictures, evenly spaced.
    """
    root = data or DATA
    folders = [root / name for name in SETS if (root / name).is_dir()]
    if not folders:
        folders = [data or SAMPLES]
    sets = {folder.name: spread(_photographs(folder), n_pictures) for folder in folders}
    if not all(sets.values()):
        sys.exit(f"no photograph in {', '.join(str(folder) for folder in folders)}")
    return {name: [Picture(path.stem, read_rgb(path)) for path in paths] for name, paths in sets.items()}


def _photographs(folder: Path) -> list[Path]:
    """List the RGB pictures with more colors than a palette holds: the others need no quantization."""
    found = []
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
            continue
        with Image.open(path) as image:
            if image.mode == "RGB" and image.getcolors(256) is None:
                found.append(path)
    return found


def spread(items: Sequence[T], n_items: int | None) -> list[T]:
    """Take `n_items` evenly spaced items, or all."""
    n = len(items) if n_items is None else min(n_items, len(items))
    return [items[(2 * i + 1) * len(items) // (2 * n)] for i in range(n)]


def large_pictures(data: Path | None = None) -> list[Path]:
    """Make the 12-megapixel PNG files, once: a small photograph enlarged, and a large one reduced if there is one."""
    root = data or DATA
    small = [*sorted((root / "kodak").glob("*.png"))[1:2], *sorted(SAMPLES.glob("coffee.png"))]
    if not small:
        sys.exit(f"no photograph to enlarge in {root / 'kodak'} or {SAMPLES}")
    large = sorted((root / "large").glob("*.jpg"))
    return [_large(small[0], noise=2.0), *(_large(path, noise=0.0) for path in large[:1])]


def _large(source: Path, noise: float) -> Path:
    """Bring a picture to LARGE; noise gives an enlarged one as many colors as a camera would."""
    made = OUT / f"12mp_{source.stem.lower()}.png"
    if made.exists():
        return made
    with Image.open(source) as image:
        pixels = np.asarray(ImageOps.fit(image.convert("RGB"), LARGE, Image.Resampling.BICUBIC))
    if noise:
        steps = np.random.default_rng(0).standard_normal(pixels.shape, np.float32) * np.float32(noise)
        pixels = np.clip(np.rint(pixels + steps), 0, 255).astype(np.uint8)
    made.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(made)
    return made


def squared_error(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> float:
    """Compute the mean over the pixels of the squared error, summed over R, G and B; a block of rows at a time."""
    total = 0
    for top in range(0, len(before), 256):
        steps = before[top : top + 256].astype(np.int32) - after[top : top + 256]
        total += int(np.square(steps).sum(dtype=np.int64))  # a product of int32 arrays would be summed in int32
    return total / before[:, :, 0].size


def pin_threads(n_threads: int) -> None:
    """Give every library and process `n_threads` threads, or leave it to each with 0.

    Libraries read these variables when they are loaded, and NumPy is loaded by now: the script starts again. Python
    keeps its bytecode, or each process would compile the package.
    """
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    names = [f"{library}_NUM_THREADS" for library in ("OMP", "OPENBLAS", "MKL", "NUMEXPR")]
    names += ["MAGICK_THREAD_LIMIT", "CVTIMG_THREADS"]
    wanted = dict.fromkeys(names, str(n_threads))
    if n_threads and not wanted.items() <= os.environ.items():
        os.environ.update(wanted)
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])


def timed(call: Callable[[], T], clock: Callable[[], float] = time.perf_counter) -> tuple[T, float]:
    """Return what `call` returns, and its seconds by a clock."""
    start = clock()
    result = call()
    return result, clock() - start


def cpu_seconds(call: Callable[[], object], repeats: int = 1) -> list[float]:
    """Return the processor seconds of each of some calls."""
    return [timed(call, time.process_time)[1] for _ in range(repeats)]


def run_process(command: Sequence[str | Path]) -> Process:
    """Run a command to its end, from before it is started until after it is reaped."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    assert process.stderr is not None
    with process.stderr as stream:
        messages = stream.read().decode(errors="replace").strip().splitlines()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    failure = ""
    if process.returncode:
        failure = messages[-1] if messages else f"exit status {process.returncode}"
    return Process(wall, usage.ru_utime + usage.ru_stime, failure, usage.ru_maxrss / 1024)


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Lay out a Markdown table: the first column to the left, the others to the right."""
    widths = [max(len(row[column]) for row in [header, *rows]) for column in range(len(header))]

    def line(cells: Sequence[str]) -> str:
        aligned = [cell.rjust(width) for cell, width in zip(cells, widths, strict=True)]
        return "| " + " | ".join([cells[0].ljust(widths[0]), *aligned[1:]]) + " |"

    rule = ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])]
    return "\n".join([line(header), line(rule), *map(line, rows)])


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table under its title, as soon as it is known."""
    print(f"\n**{title}**\n\n{markdown_table(header, rows)}", flush=True)


def print_means(title: str, names: Sequence[str], found: Sequence[Mapping[str, float]], form: str) -> None:
    """Print the values that were found of each name, and their means."""
    means = {key: statistics.mean(one[key] for one in found) for key in found[0]}
    rows = [
        [name, *(f"{value:{form}}" for value in one.values())]
        for name, one in zip([*names, "mean"], [*found, means], strict=True)
    ]
    print_table(title, ("", *means), rows)


def progress(text: str) -> None:
    """Say on stderr what is being measured, if somebody looks: one line that is written over."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)


def group(items: Sequence[T], key: Callable[[T], S]) -> dict[S, list[T]]:
    """Group items by a key, in the order in which the keys are met."""
    groups: dict[S, list[T]] = {}
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return groups


def machine() -> str:
    """Describe the machine and the build of cvtimg, in one line."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    model = models[0] if models else platform.processor() or platform.machine()
    python = platform.python_version()
    return f"{model}, {os.cpu_count()} cores, {platform.system()}, Python {python}, cvtimg build {BUILD}"


def cvtimg_build() -> str:
    """Fingerprint the installed cvtimg: its version stays the same while its code changes."""
    spec = importlib.util.find_spec("cvtimg")
    if spec is None or spec.origin is None:
        return "none"
    files = sorted(path for path in Path(spec.origin).parent.rglob("*") if path.suffix in (".py", ".so", ".pyd"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:8]


BUILD = cvtimg_build()


def write_results(name: str, about: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a run to out/benchmarks as NAME.json with all about it, and its rows as NAME.csv."""
    OUT.mkdir(parents=True, exist_ok=True)
    whole = {
        "machine": machine(),
        "date": time.strftime("%Y-%m-%d %H:%M"),
        "cvtimg": BUILD,
        **about,
        "rows": list(rows),
    }
    (OUT / f"{name}.json").write_text(json.dumps(whole, indent=1, default=lambda scalar: scalar.item()) + "\n")
    with (OUT / f"{name}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(key for row in rows for key in row)))
        writer.writeheader()
        writer.writerows(rows)
    if cvtimg_build() != BUILD:
        print("\nWARNING: cvtimg was installed anew during this run: its figures are of two builds")
    print(f"\nwritten: {(OUT / name).relative_to(ROOT)}.json and .csv", flush=True)


def parser(description: str | None) -> argparse.ArgumentParser:
    """Make a parser with the options that all benchmarks share; the help is the first line of the docstring."""
    options = argparse.ArgumentParser(description=(description or "").partition("\n")[0])
    options.add_argument("--data", type=Path, metavar="DIR", help="folder of pictures (default: ../shared/data)")
    options.add_argument("--quick", action="store_true", help="a minute or two: fewer pictures and repeats")
    options.add_argument(
        "--threads", type=int, default=1, metavar="N", help="threads of every rival (default: 1; 0: its own choice)"
    )
    return options


def run(options: argparse.ArgumentParser, *parts: Callable[[argparse.Namespace], Rows | tuple[Rows, Rows]]) -> None:
    """Run the parts of a benchmark, or those that are asked for: print each as a table, and write its rows.

    A part is a function of the options. Its name is that of the part, and the first line of its docstring the title. It
    returns the rows that it measured, or these and other rows to print: means, or one for each rival.
    """
    by_name = {part.__name__: part for part in parts}
    if len(parts) > 1:
        options.add_argument("--parts", nargs="+", choices=by_name, default=[*by_name], help="only these")
    given = options.parse_args()
    pin_threads(given.threads)
    print(f"{machine()}. Threads: {given.threads or 'as each likes'}.")
    script = Path(sys.argv[0]).stem
    for name in by_name if len(parts) == 1 else given.parts:
        found = by_name[name](given)
        progress("")
        rows, shown = found if isinstance(found, tuple) else (found, found)
        if rows:
            show((by_name[name].__doc__ or name).partition("\n")[0], shown)
            about = {key: str(value) for key, value in vars(given).items()}
            write_results(script if len(parts) == 1 else f"{script}_{name}", about, rows)


def show(title: str, rows: Rows, digits: int = 4) -> None:
    """Print rows as a table with a column for each key; floats by so many digits."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    print_table(title, columns, [[cell(row.get(column), digits) for column in columns] for row in rows])


def cell(value: Any, digits: int = 4) -> str:
    """Write a value of a table."""
    if isinstance(value, float):
        return f"{value:.{digits}g}" if abs(value) < 10**digits else f"{value:.0f}"
    if value is None or isinstance(value, bool):
        return {None: "-", True: "yes", False: "no"}[value]
    return str(value)
