"""Measure all numbers of the README anew, one after the other, on this machine.

    python benchmarks/readme.py [--quick] [--data DIR] [--only palettes,meshes]

Seconds are worth something on an idle machine only, so the load is printed before each part; every part begins with the
name of the processor. All of them take about an hour.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

from common import DATA, machine

#: For each claim of the README the script and its arguments that repeat it.
PARTS: dict[str, list[str]] = {
    "files": ["looks.py", "--pictures", "6"],
    "palettes": ["quantization.py"],
    "processes": ["whole_process.py"],
    "regions": ["hierarchy.py", "--parts", "regions"],
    "restoration": ["restoration.py", "--photographs", "{data}/kodak"],
    "meshes": ["meshes.py", "--only", "ocean"],
}


def main() -> None:
    """Run the parts."""
    read = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    read.add_argument("--quick", action="store_true", help="less of each")
    read.add_argument("--data", type=Path, default=DATA, metavar="DIR", help="folder of the images")
    read.add_argument("--only", default=",".join(PARTS), help=f"parts to run, of {','.join(PARTS)}")
    given = read.parse_args()
    print(f"# {machine()}", flush=True)
    failed = []
    for part in given.only.split(","):
        script, *words = (word.format(data=given.data) for word in PARTS[part])
        print(f"\n## {part}: {' '.join([script, *words])} (load {os.getloadavg()[0]:.1f})\n", flush=True)
        options = ["--data", str(given.data), *["--quick"] * given.quick]
        done = subprocess.run([sys.executable, Path(__file__).with_name(script), *words, *options])
        failed += [part] * (done.returncode != 0)
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main()
