"""Check what a wheel holds: ``python .ci/check_wheel.py WHEEL``."""

import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
#: Of the package folder, what builds the wheel and does not go into it.
NOT_INSTALLED = {".build", ".h", ".pyx"}


def main(wheel: str) -> None:
    """Compare the wheel's files with the package folder, and its top level with what may be installed."""
    names = set(zipfile.ZipFile(wheel).namelist())
    wanted = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "cvtimg").rglob("*")
        if path.is_file() and path.suffix not in NOT_INSTALLED and "__pycache__" not in path.parts
    }
    in_package = {name for name in names if name.startswith("cvtimg/")}
    compiled = {name for name in in_package if name.endswith((".so", ".pyd"))}
    modules = sorted(path.stem for path in (ROOT / "cvtimg").rglob("*.pyx"))
    others = {name for name in names - in_package if ".dist-info/" not in name}
    problems = [f"missing: {name}" for name in sorted(wanted - in_package)]
    problems += [f"unexpected: {name}" for name in sorted((in_package - wanted - compiled) | others)]
    if sorted(Path(name).name.partition(".")[0] for name in compiled) != modules:
        problems.append(f"compiled modules: {sorted(compiled)}, not one for each of {modules}")
    print(f"{Path(wheel).name}: {len(names)} files", *problems, sep="\n")
    sys.exit(bool(problems))


if __name__ == "__main__":
    main(sys.argv[1])
