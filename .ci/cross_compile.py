"""Compile the C sources of a build for other systems with zig's clang; warnings are errors.

    python .ci/cross_compile.py BUILD

BUILD is the folder of a build, which has what Cython wrote. Needs ziglang. Nothing is linked, and the headers of Python
are those of this one, with a configuration for Windows where that is the target.
"""

from __future__ import annotations

import json
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

TARGETS = ("x86_64-linux-musl", "aarch64-linux-musl", "aarch64-linux-gnu", "aarch64-macos", "x86_64-macos",
           "x86_64-windows-gnu", "aarch64-windows-gnu")  # fmt: skip
#: Cython's own helpers and names are not ours to change.
WARNINGS = ("-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-Wno-unused-parameter", "-Wno-cast-function-type",
            "-Wno-missing-field-initializers")  # fmt: skip
#: What the headers of Python ask of a compiler for Windows; and windows.h, whose macros C code meets there.
PYCONFIG = """#define MS_WIN64
#define MS_WINDOWS
#define MS_COREDLL
#define Py_ENABLE_SHARED 1
#define HAVE_DECLSPEC_DLL
#define NT_THREADS
#define SIZEOF_SHORT 2
#define SIZEOF_INT 4
#define SIZEOF_LONG 4
#define SIZEOF_LONG_LONG 8
#define SIZEOF_VOID_P 8
#define SIZEOF_SIZE_T 8
#define SIZEOF_TIME_T 8
#define SIZEOF_WCHAR_T 2
#define SIZEOF_OFF_T 4
#define ALIGNOF_MAX_ALIGN_T 16
#define HAVE_SSIZE_T 1
#define STDC_HEADERS 1
#define WITH_DOC_STRINGS 1
#include <io.h>
#include <windows.h>
"""


def commands(build: Path) -> list[list[str]]:
    """Return the arguments of each compilation of a build that matter elsewhere: its source, its folders and flags."""
    kept = []
    for step in json.loads((build / "compile_commands.json").read_text()):
        if not step["file"].endswith(".c"):  # what Cython reads
            continue
        words = shlex.split(step["command"])
        flags = [
            word
            for word in words
            if word.startswith(("-f", "-O", "-std")) and word not in ("-fdiagnostics-color=always", "-fPIC")
        ]
        folders = [
            str((build / word[2:]).resolve()) for word in words if word.startswith("-I") and "python" not in word
        ]
        kept.append([*flags, *(f"-I{folder}" for folder in folders), str((build / step["file"]).resolve())])
    return kept


def main(build: Path) -> int:
    """Compile for all targets; return how many sources failed."""
    failed = 0
    headers = Path(sysconfig.get_path("include"))
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        for_windows = shutil.copytree(headers, Path(folder, "windows"))
        (for_windows / "pyconfig.h").write_text(PYCONFIG)
        for target in TARGETS:
            python = for_windows if "windows" in target else headers

            def compile_one(words: list[str], target: str = target, python: Path = python) -> str:
                run = [sys.executable, "-m", "ziglang", "cc", "-target", target, *WARNINGS, *words[:-1]]
                run += [
                    f"-isystem{python}",
                    "-c",
                    words[-1],
                    "-o",
                    str(Path(folder, f"{Path(words[-1]).stem}-{target}.o")),
                ]
                return subprocess.run(run, capture_output=True, text=True).stderr

            sources = commands(build)
            errors = [error for error in pool.map(compile_one, sources) if error]
            failed += len(errors)
            print(f"{target}: {len(sources) - len(errors)} of {len(sources)} sources", *errors, sep="\n", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(min(main(Path(sys.argv[1])), 1))
