"""The command line: the commands under one name, and what is common to all of them.

A command is a module ``NAME_command`` beside this one, imported only when it is asked for.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from io import StringIO
from typing import Annotated, Any

import typer
from typer import Option
from typer.core import TyperGroup

from cvtimg.batch import WrongUsageError, complain, reason
from cvtimg.cli.frame import with_groups
from cvtimg.cli.plain_values import convert_plainly

__all__ = ["app", "main"]

#: The commands in the order of ``--help``, each with its line there.
COMMANDS = {
    "quantize": "Reduce images to a palette of N colors.",
    "palette": "Print the palette of images, and the share of the pixels of each color.",
    "segment": "Divide images into N segments of similar color.",
    "restore": "Restore one image from noisy, incomplete versions of it.",
    "cluster": "Find the N generators that represent the rows of tables with the least error.",
    "elbow": "Suggest how many generators images and tables need.",
    "info": "Show the size, format, bands, depth and number of distinct colors of images.",
}


class _Commands(TyperGroup):
    """Imports a command when it is asked for."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in COMMANDS:
            return None
        if cmd_name not in self.commands:
            module = import_module(f"cvtimg.cli.{cmd_name}_command")
            alone = typer.Typer(add_completion=False, rich_markup_mode=None)
            alone.command(cmd_name, epilog=module.EXAMPLES)(with_groups(getattr(module, cmd_name)))
            self.commands[cmd_name] = convert_plainly(typer.main.get_command(alone))
        return self.commands[cmd_name]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"cvtimg {version('cvtimg')}", flush=True)
        raise typer.Exit


Version = Annotated[bool, Option("--version", callback=_show_version, is_eager=True, help="Print the version.")]

# Typer's boxed help takes 0.1 s more, and breaks lines that people would copy.
app = typer.Typer(
    cls=_Commands,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog="Exit status: 0 all done; 1 some input failed, the others are done; 2 wrong usage.",
)


@app.callback()
def _cvtimg(version: Version = False) -> None:
    """Centroidal Voronoi tessellations of images and tables: palettes, segments, restored images, clusters."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, ``sys.argv`` by default, and return the exit status; the console script ``cvtimg``."""
    # Its threads take as long to start as NumPy to import, and the kernels have threads of their own.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if arguments is None:
        _silence_libraries()
    given = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    sys.stdout, sys.stderr = sys.stdout or StringIO(), sys.stderr or StringIO()  # None where nobody listens
    try:
        command = convert_plainly(typer.main.get_command(app))
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
