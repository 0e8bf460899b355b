"""The command line: the commands under one name, and what is common to all of them.

A command is a file in `cvtimg.commands`; it goes one way: plan inputs and outputs, run each input and catch what
fails, report.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from io import StringIO
from typing import Annotated

import typer
from typer import Option

from cvtimg.batch import WrongUsageError, complain, reason
from cvtimg.cli import cluster_command as cluster
from cvtimg.cli import elbow_command as elbow
from cvtimg.cli import info_command as info
from cvtimg.cli import palette_command as palette
from cvtimg.cli import quantize_command as quantize
from cvtimg.cli import restore_command as restore
from cvtimg.cli import segment_command as segment

__all__ = ["app", "main"]


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"cvtimg {version('cvtimg')}", flush=True)
        raise typer.Exit


Version = Annotated[bool, Option("--version", callback=_show_version, is_eager=True, help="Print the version.")]

# Typer's boxed help takes 0.1 s more, and breaks lines that people would copy.
app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog="Exit status: 0 all done; 1 some input failed, the others are done; 2 wrong usage.",
)


@app.callback()
def _cvtimg(version: Version = False) -> None:
    """Find the few colors that stand best for a picture: each is the mean of the pixels nearest to it."""


app.command(epilog=quantize.EXAMPLES)(quantize.quantize)
app.command(epilog=palette.EXAMPLES)(palette.palette)
app.command(epilog=segment.EXAMPLES)(segment.segment)
app.command(epilog=restore.EXAMPLES)(restore.restore)
app.command(epilog=cluster.EXAMPLES)(cluster.cluster)
app.command(epilog=elbow.EXAMPLES)(elbow.elbow)
app.command(epilog=info.EXAMPLES)(info.info)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, ``sys.argv`` by default, and return the exit status; the console script ``cvtimg``."""
    if arguments is None:
        _silence_libraries()
    given = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    sys.stdout, sys.stderr = sys.stdout or StringIO(), sys.stderr or StringIO()  # None where nobody listens
    try:
        command = typer.main.get_command(app)
        code = int(command.main(args=given, prog_name="cvtimg", standalone_mode=False) or 0)
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except WrongUsageError as error:
        complain(f"{error} (see cvtimg {given[0]} --help)")
        return 2
    except typer.TyperException as error:
        command_line = getattr(getattr(error, "ctx", None), "command_path", f"cvtimg {given[0]}")
        complain(f"{error.format_message().rstrip('.')} (see {command_line} --help)")
        return error.exit_code
    except Exception as error:  # no traceback reaches a user
        path = error.filename if isinstance(error, OSError) and error.filename else "unexpected"
        complain(f"{path}: {reason(path, error)}")
        return 1
    if code == 130:
        complain("interrupted")
    return code


def _silence_libraries() -> None:
    """Keep what C libraries print of damaged files, besides the error that they give, out of our stderr."""
    with suppress(OSError, ValueError, AttributeError):  # nobody listens to stderr
        ours = os.fdopen(os.dup(2), "w", 1, sys.stderr.encoding, sys.stderr.errors)
        with open(os.devnull, "w") as nowhere:  # noqa: PTH123
            os.dup2(nowhere.fileno(), 2)
        sys.stderr = ours


if __name__ == "__main__":
    sys.exit(main())
