"""Kill a batch of small pictures at random moments, and see that nothing is half written and every run goes on.

Each round starts ``cvtimg quantize`` on a folder with ``--skip-existing``, kills it (the whole program, its main
process alone, or one of its workers) after a random time, and looks at the files: originals must have the bytes that
they had, and each output those of an undisturbed run. A folder that is done is emptied, and the next batch begins. At
the end one run goes through, and must leave all outputs and nothing else.

    python .ci/kills.py            # 1000 kills, some ten minutes
    python .ci/kills.py --kills 50 # as .ci/run does
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
from PIL import Image

N_PICTURES = 24
SIZE = 96


def make_pictures(folder: Path) -> None:
    """Write pictures in two folders."""
    rng = np.random.default_rng(5)
    for number in range(N_PICTURES):
        path = folder / f"{number % 2}" / f"{number}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(rng.integers(0, 256, (SIZE, SIZE, 3), np.uint8)).save(path)


def contents(folder: Path) -> dict[str, bytes]:
    """Read all files below a folder, but those that are recognizably unfinished."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files if not path.name.startswith(".cvtimg-")}


def start(source: Path, out: Path, jobs: int) -> subprocess.Popen[bytes]:
    """Begin or go on with the batch, in a group of processes of its own."""
    command = [sys.executable, "-m", "cvtimg", "quantize", source, "-k", "16", "--out-dir", out, "--quiet"]
    options = ["--skip-existing", "--jobs", str(jobs)]
    return subprocess.Popen([*command, *options], cwd=source.parent, start_new_session=True, stderr=subprocess.DEVNULL)


def statuses() -> Iterator[tuple[Path, list[str]]]:
    """Yield the folder of each process below /proc, and its state, parent, group and so on from the file ``stat``."""
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            yield path.parent, path.read_text().rpartition(")")[2].split()


def workers(process: subprocess.Popen[bytes]) -> list[int]:
    """List the processes of a run, without its first and the one that counts resources."""
    found = []
    for folder, (_, _, group, *_) in statuses():
        with suppress(OSError):
            if int(group) == process.pid and b"resource_tracker" not in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
    return [pid for pid in found if pid != process.pid]


def kill(process: subprocess.Popen[bytes], how: str) -> None:
    """Kill at once, without a chance to clean up."""
    if how == "worker" and (pids := workers(process)):
        os.kill(random.choice(pids), signal.SIGKILL)
        process.wait()
    elif how == "main":
        process.kill()  # its workers end by themselves
    else:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def wait_for_group(process: subprocess.Popen[bytes]) -> None:
    """Wait until no process of a run is left, but those that have ended and that the system has yet to take away."""
    for _ in range(1000):
        if not any(state != "Z" and int(group) == process.pid for _, (state, _, group, *_) in statuses()):
            return
        time.sleep(0.02)
    sys.exit("FAILED: processes are left 20 seconds after their main process was killed")


def check(folder: Path, expected: dict[str, bytes], what: str) -> None:
    """Compare files with what they should be; some may be missing."""
    for name, content in contents(folder).items():
        if expected.get(name) != content:
            sys.exit(f"FAILED: {what} {name} is not what it should be")


def main() -> None:
    """Print what was killed and what was found."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--kills", type=int, default=1000, metavar="N")
    options.add_argument("--seed", type=int, default=0, metavar="N")
    arguments = options.parse_args()
    random.seed(arguments.seed)
    with tempfile.TemporaryDirectory() as folder:
        source, out = Path(folder, "in"), Path(folder, "out")
        make_pictures(source)
        originals = contents(source)
        begin = time.perf_counter()
        if start(source, out, 1).wait():
            sys.exit("FAILED: the undisturbed run")
        whole, expected = time.perf_counter() - begin, contents(out)
        n_killed, n_batches, n_unfinished = 0, 0, 0
        while n_killed < arguments.kills:
            if len(contents(out)) == N_PICTURES:
                n_batches += 1
                for path in out.rglob("*.png"):
                    path.unlink()
            process = start(source, out, random.choice([1, 2]))
            time.sleep(random.uniform(0.1, 1.2) * whole)
            n_killed += process.poll() is None
            kill(process, random.choice(["group", "main", "worker"]))
            wait_for_group(process)
            n_unfinished += sum(1 for _ in out.rglob(".cvtimg-*"))
            check(source, originals, "original")
            check(out, expected, "output")
        if start(source, out, 2).wait():
            sys.exit("FAILED: the last run")
        left = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
        if contents(source) != originals or left != set(expected) or contents(out) != expected:
            sys.exit("FAILED: what the last run left")
        print(
            f"{n_killed} kills in {n_batches} batches of {N_PICTURES} pictures: every original intact, no output half "
            f"written ({n_unfinished} unfinished files, hidden and taken away later), each batch completed"
        )


if __name__ == "__main__":
    main()
