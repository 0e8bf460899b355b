"""Launcher in a checkout: ``python cli.py ARGS`` is ``cvtimg ARGS``."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
# Python puts the folder of a script first on its path. The folder cvtimg/ here has sources but no compiled kernels:
# it must not hide the package that is installed. (An editable install is found by a hook of its own.)
sys.path[:] = [entry for entry in sys.path if Path(entry).resolve() != HERE]

try:
    from cvtimg.cli.app import main
except ImportError as error:
    sys.exit(f"cli.py: cvtimg is not installed for {sys.executable} ({error}): run `make demo`, or `pip install .`")

if __name__ == "__main__":
    sys.exit(main())
