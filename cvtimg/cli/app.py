"""The console script ``cvtimg``: the list of commands, and the exit status of each run.

What answers without a command (``--help``, ``--version``) is said here without importing Typer, which takes longer than
all the rest. The commands themselves are in `cvtimg.cli.commands`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress

__all__ = ["COMMANDS", "main", "overview", "version"]

#: The commands in the order of ``--help``, each with its line there.
COMMANDS = {
    "quantize": "Reduce images to a palette of N colors.",
    "palette": "Print the palette of images and the share of the pixels that has each color.",
    "segment": "Divide images into N segments of similar color.",
    "restore": "Restore one image from several noisy or incomplete versions of it.",
    "cluster": "Cluster the rows of tables into N groups.",
    "elbow": "Suggest how many colors or clusters images and tables need.",
    "info": "Show the size, format, bands, bit depth and number of distinct colors of images.",
}
_OPTIONS = {
    "--version": "Show the version and exit.",
    "--install-completion SHELL": "Install completion for bash, zsh or fish.",
    "--show-completion SHELL": "Show the completion script for bash, zsh or fish.",
    "-h, --help": "Show this message and exit. Each command has its own: cvtimg COMMAND --help.",
}
_ABOUT = "Centroidal Voronoi tessellations of images and tables: palettes, segments, restored images, clusters."
_STATUS = "Exit status: 0 all inputs done; 1 some input failed, the others are done; 2 wrong usage; 130 interrupted."


def overview() -> str:
    """Return the text of ``cvtimg --help``."""
    width = _width()
    lines = ["Usage: cvtimg [OPTIONS] COMMAND [ARGS]...", "", *_wrapped(_ABOUT, "  ", width)]
    for title, entries in (("Options:", _OPTIONS), ("Commands:", COMMANDS)):
        lines += ["", title]
        margin = 4 + max(map(len, entries))
        for name, text in entries.items():
            first, *others = _wrapped(text, " " * margin, width)
            lines += [f"  {name}".ljust(margin) + first.lstrip(), *others]
    return "\n".join([*lines, "", *_wrapped(_STATUS, "  ", width)])


def _width() -> int:
    """Columns of the terminal, at most 100."""
    with suppress(ValueError, OSError, AttributeError):
        return min(max(int(os.environ.get("COLUMNS") or os.get_terminal_size().columns), 50), 100)
    return 80


def _wrapped(text: str, indent: str, width: int) -> list[str]:
    """Break a text into lines; `textwrap` would take longer to import than all of this."""
    lines = [indent]
    for word in text.split():
        if len(lines[-1]) + 1 + len(word) > width and lines[-1] != indent:
            lines.append(indent)
        lines[-1] += word if lines[-1] == indent else f" {word}"
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, ``sys.argv`` by default, and return the exit status; the console script ``cvtimg``."""
    # Its threads take as long to start as NumPy to import, and the kernels have threads of their own.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if arguments is None:
        _silence_libraries()
    given = list(sys.argv[1:] if arguments is None else arguments)
    if sys.stdout is None or sys.stderr is None:  # nobody listens
        from io import StringIO

        sys.stdout, sys.stderr = sys.stdout or StringIO(), sys.stderr or StringIO()
    if given in ([], ["-h"], ["--help"], ["--version"]) and "_CVTIMG_COMPLETE" not in os.environ:
        return _tell(version() if given == ["--version"] else overview())
    from cvtimg.cli.commands import run

    return run(given)


def version() -> str:
    """Return the text of ``cvtimg --version``."""
    import cvtimg

    return f"cvtimg {cvtimg.__version__}"


def _tell(text: str) -> int:
    try:
        print(text, flush=True)
    except OSError:  # a reader that left early
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115
        return 1
    return 0


def _silence_libraries() -> None:
    """Keep what C libraries print of damaged files, besides the error that they give, out of our stderr."""
    with suppress(OSError, ValueError, AttributeError):  # nobody listens to stderr
        ours = os.fdopen(os.dup(2), "w", 1, sys.stderr.encoding, sys.stderr.errors)
        with open(os.devnull, "w") as nowhere:  # noqa: PTH123
            os.dup2(nowhere.fileno(), 2)
        sys.stderr = ours


if __name__ == "__main__":
    sys.exit(main())
