"""The Typer application: imports each command only when it is run, and prints errors in one line."""

from __future__ import annotations

import os
from importlib import import_module
from typing import Annotated, Any, Literal

import typer
from typer import Option
from typer.core import TyperArgument, TyperCommand, TyperGroup

from cvtimg.batch import WrongUsageError
from cvtimg.batch.report import complain, reason
from cvtimg.cli.frame import with_groups
from cvtimg.cli.overview import COMMANDS, overview
from cvtimg.cli.overview import version as version_text
from cvtimg.cli.plain_values import convert_plainly

__all__ = ["app", "run"]

_NAMES = {"help_option_names": ["-h", "--help"]}


class _Command(TyperCommand):
    """A command whose help shows arguments as INPUT..., not as {INPUT...}... <list[str]>."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        return [self.options_metavar or "", *(argument.display_name_raw for argument in self._arguments())]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        if arguments := self._arguments():
            with formatter.section("Arguments"):
                formatter.write_dl([(argument.display_name_raw, argument.help or "") for argument in arguments])
        options = [one for one in self.get_params(ctx) if not isinstance(one, TyperArgument)]
        with formatter.section("Options"):
            formatter.write_dl([record for one in options if (record := one.get_help_record(ctx))])

    def _arguments(self) -> list[TyperArgument]:
        return [one for one in self.params if isinstance(one, TyperArgument)]


class _Commands(TyperGroup):
    """Imports a command when it is needed."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in COMMANDS:
            return None
        if cmd_name not in self.commands:
            module = import_module(f"cvtimg.cli.{cmd_name}_command")
            alone = typer.Typer(add_completion=False, rich_markup_mode=None)
            command = with_groups(getattr(module, cmd_name))
            alone.command(cmd_name, cls=_Command, epilog=module.EXAMPLES, context_settings=_NAMES)(command)
            self.commands[cmd_name] = convert_plainly(typer.main.get_command(alone))
        return self.commands[cmd_name]

    def get_help(self, ctx: Any) -> str:
        return overview()


def _show_version(wanted: bool) -> None:
    if wanted:
        print(version_text(), flush=True)
        raise typer.Exit


def _install_completion(ctx: typer.Context, param: typer.CallbackParam, shell: str | None) -> None:
    from typer.completion import install_callback

    install_callback(ctx, param, shell)


def _show_completion(ctx: typer.Context, param: typer.CallbackParam, shell: str | None) -> None:
    from typer.completion import show_callback

    show_callback(ctx, param, shell)


# Typer's boxed help takes 0.1 s longer and breaks lines that users copy. Its completion options guess the shell from
# the parent process, which fails if that is not a shell.
app = typer.Typer(
    cls=_Commands,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings=_NAMES,
)
_Shell = Literal["bash", "zsh", "fish"]


@app.callback()
def _cvtimg(
    version: Annotated[bool, Option("--version", callback=_show_version, is_eager=True)] = False,
    install: Annotated[
        _Shell | None, Option("--install-completion", callback=_install_completion, is_eager=True)
    ] = None,
    show: Annotated[_Shell | None, Option("--show-completion", callback=_show_completion, is_eager=True)] = None,
) -> None:
    """See `overview`."""


def run(given: list[str]) -> int:
    """Run a command line and return the exit status."""
    if "_CVTIMG_COMPLETE" in os.environ:
        from typer.completion import get_completion_inspect_parameters

        get_completion_inspect_parameters()  # registers the shells
    try:
        command = convert_plainly(typer.main.get_command(app))
        code = int(command.main(args=given, prog_name="cvtimg", standalone_mode=False) or 0)
    except (KeyboardInterrupt, typer.Abort):
        complain("interrupted")
        return 130
    except WrongUsageError as error:
        complain(f"{error} (see cvtimg {given[0]} --help)")
        return 2
    except typer.TyperException as error:
        command_line = getattr(getattr(error, "ctx", None), "command_path", f"cvtimg {given[0]}")
        complain(f"{error.format_message().rstrip('.')} (see {command_line} --help)")
        return error.exit_code
    except Exception as error:  # no traceback reaches a user
        named = isinstance(error, OSError) and error.errno is None  # its message begins with the file
        # Errors of the system that name no file are those of what is printed.
        unnamed = "standard output" if isinstance(error, OSError) else "unexpected"
        path = getattr(error, "filename", None) or unnamed
        complain(str(error) if named else f"{path}: {reason(path, error)}")
        return 1
    return code
