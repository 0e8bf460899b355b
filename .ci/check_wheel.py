"""Check the contents of a wheel: ``python .ci/check_wheel.py WHEEL``."""

import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
#: Files of the package that build the wheel and do not go into it.
NOT_INSTALLED = {".build", ".h", ".pyx"}


def main(wheel: str) -> None:
    """Compare the files of the wheel with the package, and its extension modules with their sources."""
    # auditwheel lists folders, too.
    names = {name for name in zipfile.ZipFile(wheel).namelist() if not name.endswith("/")}
    wanted = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "cvtimg").rglob("*")
        if path.is_file() and path.suffix not in NOT_INSTALLED and "__pycache__" not in path.parts
    }
    in_package = {name for name in names if name.startswith("cvtimg/")}
    compiled = {name for name in in_package if name.endswith((".so", ".pyd"))}
    modules = {path.relative_to(ROOT).with_suffix("").as_posix() for path in (ROOT / "cvtimg").rglob("*.pyx")}
    built = {name.partition(".")[0] for name in compiled}
    others = {name for name in names - in_package if ".dist-info/" not in name}
    problems = [f"missing: {name}" for name in sorted(wanted - in_package)]
    problems += [f"unexpected: {name}" for name in sorted((in_package - wanted - compiled) | others)]
    problems += [f"not compiled: {name}" for name in sorted(modules - built)]
    problems += [f"compiled from nothing: {name}" for name in sorted(built - modules)]
    print(f"{Path(wheel).name}: {len(names)} files", *problems, sep="\n")
    sys.exit(bool(problems))


if __name__ == "__main__":
    main(sys.argv[1])
