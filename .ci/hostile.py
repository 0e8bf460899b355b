"""Make all damaged and harmful files of tests/hostile.py, and count what cvtimg makes of them.

python .ci/hostile.py            # all of them, some minutes
python .ci/hostile.py --quick    # fewer damages of each file
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from PIL import Image, features

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from hostile import damaged, judge, made, measured, pictures, seeds


def corpus(n_cuts: int, n_flips: int) -> Iterator[tuple[str, str, bytes]]:
    """Yield (kind, name, content) of all files; those of kind "pipe" are to come through standard input."""
    for kind, files in (("pictures", pictures()), ("measurements", measured())):
        for name, content in damaged(files, n_cuts, n_flips):
            yield kind, name, content
    for name, content in made():
        yield "lies", name, content
    for name, content in chain(damaged(seeds(), n_cuts // 3, 0), made()):
        yield "pipe", f"pipe-{name}", content


def main() -> None:
    """Print what became of the files."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--quick", action="store_true", help="fewer damages of each file")
    options.add_argument("--keep", type=Path, metavar="DIR", help="keep the files that went wrong here")
    arguments = options.parse_args()
    n_cuts, n_flips = (1, 1) if arguments.quick else (8, 14)
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    slowest = (0.0, "")
    with tempfile.TemporaryDirectory() as folder:
        tempfile.tempdir = folder  # files left over are seen
        for kind, name, content in corpus(n_cuts, n_flips):
            path = Path(folder, name)
            path.write_bytes(content)
            start = time.perf_counter()
            verdict = judge(path, piped=kind == "pipe")
            slowest = max(slowest, (time.perf_counter() - start, name))
            counts[kind][verdict if verdict in ("right", "error") else "wrong"] += 1
            if verdict not in ("right", "error"):
                print(f"{name}: {verdict}", flush=True)
                if arguments.keep:
                    arguments.keep.mkdir(parents=True, exist_ok=True)
                    (arguments.keep / name).write_bytes(content)
            path.unlink()
    counts["in all"] = sum(counts.values(), Counter())
    for kind, count in counts.items():
        print(
            f"{kind}: {count.total()} files: {count['right']} right results, {count['error']} errors of one line, "
            f"{count['wrong']} of anything else"
        )
    print(
        f"the slowest took {slowest[0]:.1f} s ({slowest[1]}); "
        f"Pillow {Image.__version__}, libtiff {features.version('libtiff')}"
    )
    sys.exit(1 if counts["in all"]["wrong"] else 0)


if __name__ == "__main__":
    main()
