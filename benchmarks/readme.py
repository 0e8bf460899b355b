"""Measure the numbers of the README anew, with the table of palettes in its guide, and print them claim by claim.

    python benchmarks/readme.py [--quick] [--data DIR] [--only palettes,meshes] [--cvtimg PATH]

Seconds are worth something on an idle machine only, so the load is printed with each part, and parts whose seconds
count run by themselves; the others run two at a time. On two idle cores, all of them take less than half an hour.
With --only '', the claims are those of the last runs. Name a command that was installed from a wheel by --cvtimg: one
installed in place looks for changed sources first.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from common import DATA, OUT, group, machine
from quantization import MEASURE

Rows = list[dict[str, Any]]
#: What the README says, and the figure that was measured.
Claims = Iterator[tuple[str, str]]


class Part(NamedTuple):
    """A script with its arguments, the results that it writes, and the claims that these repeat."""

    words: str
    results: str
    claims: Callable[[Rows], Claims]
    is_timed: bool = False


def mean(rows: Rows, key: str, **of: object) -> float:
    """Return the mean of a value over the rows that have these others."""
    return statistics.fmean(row[key] for row in rows if all(row[name] == value for name, value in of.items()))


def span(values: list[float], form: str = ".0f") -> str:
    """Write the least and the greatest of some values."""
    return f"{min(values):{form}} to {max(values):{form}}"


def files(rows: Rows) -> Claims:
    """Compare files of equal looks, and of as many colors without dithering."""
    for (k, dithered), own in sorted(group(rows, lambda row: (row["k"], row["dithered"])).items()):
        title = f"{'Smaller files' if dithered else 'Better palettes'}: {len(own)} images, {k} colors of pngquant"
        for key in ("bytes", "oxipng", "error"):
            values = np.array([row[key] for row in own])
            yield f"{title}: {key}, mean and worst", f"{np.exp(np.log(values).mean()):.3f}, {values.max():.3f}"
        yield f"{title}: seconds of both", f"{mean(own, 'cvtimg_seconds'):.2f}, {mean(own, 'seconds'):.2f}"


def palettes(rows: Rows) -> Claims:
    """Compare squared errors and times, and fill the table."""
    ks = sorted({row["k"] for row in rows})
    ours = {(row["picture"], row["k"]): row for row in rows if row["rival"] == MEASURE}
    names = list(dict.fromkeys(row["rival"] for row in rows))
    pngquant = next((name for name in names if name.startswith("pngquant")), None)
    if pngquant:
        less = [
            100 * (1 - mean(rows, "error", rival=MEASURE, k=k) / mean(rows, "error", rival=pngquant, k=k)) for k in ks
        ]
        yield f"Table: % less squared error than pngquant at {span(ks)} colors", span(less)
    for name in names:
        own = [row for row in rows if row["rival"] == name]
        cells = []
        for k in ks:
            some = [row for row in own if row["k"] == k]
            error = statistics.fmean(row["error"] for row in some)
            base = statistics.fmean(ours[row["picture"], k]["error"] for row in some)
            cells.append(f"{error:.1f}" if len(some) == len(ours) / len(ks) else f"x {error / base:.3f} ({len(some)})")
        last = [row["seconds"] / ours[row["picture"], ks[-1]]["seconds"] for row in own if row["k"] == ks[-1]]
        yield f"Table: {name}", " | ".join([*cells, f"{statistics.median(last):.2g}" if last else "-"])


def processes(rows: Rows) -> Claims:
    """Compare whole processes."""
    error = {(row["picture"], row["program"]): row["error"] for row in rows}
    for program in ("pngquant", "pngquant --speed 11"):
        for size, large in (("0.4", False), ("12", True)):
            own = [row for row in rows if row["program"] == program and row["picture"].startswith("12mp") == large]
            if own:
                ratio = statistics.fmean(
                    error[row["picture"], program] / error[row["picture"], "cvtimg quantize"] for row in own
                )
                times = statistics.fmean(row["cpu_ratio"] for row in own)
                yield f"{program}, {size} megapixels: processor time, error as multiples", f"{times:.2f}, {ratio:.2f}"


def regions(rows: Rows) -> Claims:
    """List Rand indices, each program with the one threshold that is best for all images."""
    for row in rows:
        default = f"; default {row['default'].split()[0]}" if row["default"] else ""
        yield f"Regions: Rand index, {row['rival']}", row["ods"].split()[0] + default


def restoration(rows: Rows) -> Claims:
    """Compare with BM3D."""
    names = sorted({row["rival"] for row in rows})
    for name in names:
        yield (
            f"Restoration: mean PSNR of {len({row['case'] for row in rows})} photographs, {name}",
            f"{mean(rows, 'psnr', rival=name):.2f} dB",
        )


def meshes(rows: Rows) -> Claims:
    """Compare with Gmsh, which makes a few vertices more."""
    for fast, ours, theirs in zip(rows[::3], rows[1::3], rows[2::3], strict=True):
        share = [f"{one['seconds'] / theirs['seconds']:.2f}" for one in (fast, ours)]
        yield f"Fast meshes: share of Gmsh's time, {ours['vertices']:,} vertices; effort fast", ", ".join(share[::-1])
        yield "Fast meshes: mean quality, cvtimg and Gmsh", f"{ours['mean q']}, {theirs['mean q']}"


#: For each claim of the README the script and its arguments that repeat it; of those not timed, the longest first.
PARTS = {
    "palettes": Part("quantization.py --data {data}/cq100", "quantization", palettes, is_timed=True),
    "processes": Part("whole_process.py --rounds 3 {cvtimg}", "whole_process", processes, is_timed=True),
    "meshes": Part("meshes.py --only ocean", "meshes", meshes, is_timed=True),
    "restoration": Part(
        "restoration.py --photographs {data}/kodak --damages 1 --rivals BM3D", "photographs", restoration
    ),
    "regions": Part("hierarchy.py --parts regions", "hierarchy_regions", regions),
    "files": Part("looks.py --parts png {cvtimg}", "looks_png", files),
}


def run(part: Part, given: argparse.Namespace) -> bool:
    """Run a part, print what it prints, and tell whether it failed."""
    cvtimg = f"--cvtimg {given.cvtimg}" if given.cvtimg else ""
    script, *words = part.words.format(data=given.data, cvtimg=cvtimg).split()
    words = ["--data", str(given.data), *words, *["--quick"] * given.quick]
    command = [sys.executable, str(Path(__file__).with_name(script)), *words]
    load, start = os.getloadavg()[0], time.perf_counter()
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    seconds = time.perf_counter() - start
    print(f"\n## {' '.join([script, *words])} (load {load:.1f}, {seconds:.0f} s)\n\n{done.stdout}", flush=True)
    return done.returncode != 0


def main() -> None:
    """Run the parts, and print the claims."""
    read = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    read.add_argument("--quick", action="store_true", help="less of each")
    read.add_argument("--data", type=Path, default=DATA, metavar="DIR", help="folder of the images")
    read.add_argument("--only", default=",".join(PARTS), help=f"parts to run, of {','.join(PARTS)}")
    read.add_argument("--cvtimg", metavar="PATH", help="the command whose processes are timed")
    given = read.parse_args()
    print(f"# {machine()}", flush=True)
    chosen = {name: PARTS[name] for name in PARTS if name in given.only.split(",")}
    failed = []
    for is_timed in (True, False):
        names = [name for name, part in chosen.items() if part.is_timed == is_timed]
        with ThreadPoolExecutor(1 if is_timed else 2) as pool:
            results = pool.map(lambda name: run(PARTS[name], given), names)
            failed += [name for name, is_bad in zip(names, results, strict=True) if is_bad]
    print("\n# Claims of the README\n")
    for part in PARTS.values():
        path = OUT / f"{part.results}.json"
        if path.exists():
            whole = json.loads(path.read_text())
            print(f"{part.results}, {whole['date']}")
            for claim, figure in part.claims(whole["rows"]):
                print(f"  {claim}: {figure}")
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main()
