"""The console script ``cvtimg``.

``--help`` and ``--version`` are answered by `cvtimg.cli.overview`, which imports next to nothing; what is to be done is
in `cvtimg.cli.commands`.
"""

import atexit
import gc
import os
import sys
from collections.abc import Sequence
from contextlib import suppress

from cvtimg.cli.overview import overview, version


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, ``sys.argv`` by default, and return the exit status; the console script ``cvtimg``."""
    # Starting OpenBLAS threads takes as long as importing NumPy, and our kernels have their own threads.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if arguments is None:
        _silence_libraries()
        with suppress(AttributeError):  # names that a terminal cannot show have escapes
            sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
        # Nothing that modules hold is garbage: not while they are imported, and not at the end.
        gc.disable()
        atexit.register(gc.freeze)
    given = list(sys.argv[1:] if arguments is None else arguments)
    if sys.stdout is None or sys.stderr is None:  # nobody listens
        from io import StringIO

        sys.stdout, sys.stderr = sys.stdout or StringIO(), sys.stderr or StringIO()
    try:
        if given in ([], ["-h"], ["--help"], ["help"], ["--version"], ["-V"]) and "_CVTIMG_COMPLETE" not in os.environ:
            print(version() if given in (["--version"], ["-V"]) else overview(), flush=True)
            return 0
        from cvtimg.cli.commands import command_of

        todo = command_of(given)(standalone_mode=False)
        if arguments is None:
            gc.freeze()
            gc.enable()
        status = int((todo() if callable(todo) else todo) or 0)
        sys.stdout.flush()
        return status
    except BrokenPipeError:  # the reader has what it wanted
        _end_output()
        return 1
    except KeyboardInterrupt:
        print("cvtimg: interrupted", file=sys.stderr)
        return 130
    except Exception as error:  # no traceback reaches a user
        from cvtimg.cli.commands import explain

        status = explain(error, given)
        _end_output()
        return status


def _end_output() -> None:
    """Let go what is printed if nobody can have it, or Python complains of it at the end."""
    try:
        sys.stdout.flush()
    except OSError:
        with suppress(OSError), open(os.devnull, "w") as nowhere:  # noqa: PTH123
            os.dup2(nowhere.fileno(), sys.stdout.fileno())


def _silence_libraries() -> None:
    """Hide what C libraries print to stderr about damaged files, in addition to the error that they return."""
    with suppress(OSError, ValueError, AttributeError):  # nobody listens to stderr
        ours = os.fdopen(os.dup(2), "w", 1, sys.stderr.encoding, sys.stderr.errors)
        with open(os.devnull, "w") as nowhere:  # noqa: PTH123
            os.dup2(nowhere.fileno(), 2)
        sys.stderr = ours


if __name__ == "__main__":
    sys.exit(main())
