"""The Typer application: imports each command only when it is run, and prints errors in one line.

A command is a function of the values that its options have; its docstring is the help. Three things differ from what
Typer does by itself:

- Parameters are made from the records of `cvtimg.options`, which the page uses, too.
- Values are converted by these records: Typer's own conversion imports pydantic and builds an adapter for each option,
  which takes longer than importing NumPy, half of what it takes to quantize a small image.
- Help comes from `cvtimg.cli.overview`: the usual calls and options on two screens.
"""

import os
import shlex
from collections.abc import Callable
from difflib import get_close_matches
from functools import cache, partial
from importlib import import_module
from inspect import Parameter, Signature
from typing import Annotated, Any, Literal, cast

import typer
from typer.completion import get_completion_inspect_parameters, install_callback, show_callback
from typer.core import TyperCommand, TyperGroup, TyperOption

from cvtimg.batch.report import complain, reason
from cvtimg.batch.tasks import WrongUsageError
from cvtimg.cli.overview import COMMANDS, help_of, help_on, overview, whole_help_of
from cvtimg.cli.running import Todo
from cvtimg.options import PANELS, options_of
from cvtimg.options.record import Choice, Option, Pair, Switch, collected

#: What others call commands.
_CALLED = {"denoise": ["restore"]}
_NAMES = {"help_option_names": ["-h", "--help"]}


class _Command(TyperCommand):
    """A command whose parameters are made from records."""

    options: dict[str, Option]
    function: Callable[[Any], Todo | int]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Convert values by the records; Typer sees to --help, and to arguments that are missing."""
        ctx.meta["words"] = list(args)
        known = {word for option in self.options.values() for word in option.words}
        same = {"-n": "-k", "-k": "-n"}  # either letter stands for the number, where a command has but one of them
        args = [same[word] if word in same and word not in known else word for word in args]
        given, rest, _ = self.make_parser(ctx).parse_args(args=list(args))
        for param in sorted(self.get_params(ctx), key=lambda param: not param.is_eager):
            option, value = self.options.get(param.name or ""), given.get(param.name)
            if option is None or (option.required and value in (None, [], ())):
                if option or value:
                    param.handle_parse_result(ctx, given, rest)
                continue
            try:
                ctx.params[option.name] = option.parse(value)
            except ValueError as error:
                if not ctx.resilient_parsing:  # a command line that is being completed
                    raise typer.BadParameter(str(error), ctx=ctx, param=cast("TyperOption", param)) from None
        if rest and not ctx.resilient_parsing:
            ctx.fail(f"Got unexpected extra argument(s) ({' '.join(rest)})")
        return rest

    def invoke(self, ctx: Any) -> Todo | int:
        given = collected(self.options.values(), ctx.params)
        given.command = f"{ctx.command_path} {shlex.join(ctx.meta['words'])}"
        return self.function(given)

    def get_help(self, ctx: object) -> str:
        return help_of(str(self.name))


def _parameter(option: Option) -> Parameter:
    annotation: Any = str
    if isinstance(option.kind, Switch):
        annotation = bool
    elif isinstance(option.kind, Choice):
        annotation = Literal[tuple(option.kind.names)]  # completed by shells
    elif isinstance(option.kind, Pair):
        annotation = tuple[float, float]
    annotation = list[annotation] if option.many else annotation
    make = typer.Option if option.words else typer.Argument
    about = make(*option.words, metavar=option.placeholder, help=option.help)
    default = Parameter.empty if option.required else option.default
    return Parameter(option.name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[annotation, about])


@cache  # the page parses many command lines, and so do tests
def _made(verb: str) -> Any:
    module, options = import_module(f"cvtimg.cli.{verb}_command"), options_of(verb)

    def described(**values: Any) -> None:
        """See the function of the verb; `_Command.invoke` calls it."""

    described.__dict__["__signature__"] = Signature([_parameter(option) for option in options])
    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(verb, cls=_Command, context_settings=_NAMES)(described)
    command: Any = typer.main.get_command(alone)
    command.options = {option.name: option for option in options}
    command.function = getattr(module, verb)
    return command


class _Commands(TyperGroup):
    """Imports a command when it is needed."""

    def list_commands(self, ctx: object) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: object, cmd_name: str) -> Any:
        return _made(cmd_name) if cmd_name in COMMANDS else None

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if not ctx.resilient_parsing and args[0] not in COMMANDS:
            near = _CALLED.get(args[0], get_close_matches(args[0], COMMANDS, 1))
            ctx.fail(f"No such command {args[0]!r}" + "".join(f"; did you mean {name}?" for name in near))
        return super().resolve_command(ctx, args)

    def get_help(self, ctx: object) -> str:
        return overview()


# Typer's boxed help takes 0.1 s longer and breaks lines that users copy. Its completion options guess the shell from
# the parent process, which fails if that is not a shell.
app = typer.Typer(
    cls=_Commands, add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False, context_settings=_NAMES
)
_Shell = Literal["bash", "zsh", "fish"]
_INSTALL = typer.Option("--install-completion", callback=install_callback, is_eager=True)
_SHOW = typer.Option("--show-completion", callback=show_callback, is_eager=True)


@app.callback()
def _cvtimg(install: Annotated[_Shell | None, _INSTALL] = None, show: Annotated[_Shell | None, _SHOW] = None) -> None:
    """See `overview`."""


def command_of(given: list[str]) -> Callable[..., Any]:
    """Return the main function of the command that a command line names, with its arguments."""
    if "_CVTIMG_COMPLETE" in os.environ:
        get_completion_inspect_parameters()  # registers the shells
    if given[:1] == ["help"] and given[1:]:
        title = given[1].capitalize()
        if title in PANELS or given[1] in COMMANDS:
            text = help_on(title) if title in PANELS else whole_help_of(given[1])
            return lambda **_: print(text, flush=True)
        given = given[1:]
    # A command that is named needs no group, whose own options Typer would convert.
    if given and given[0] in COMMANDS and "_CVTIMG_COMPLETE" not in os.environ:
        return partial(_made(given[0]).main, args=given[1:], prog_name=f"cvtimg {given[0]}")
    return partial(typer.main.get_command(app).main, args=given, prog_name="cvtimg")


def explain(error: Exception, given: list[str]) -> int:
    """Say in one line why a command line failed, and return the exit status."""
    if isinstance(error, typer.Abort):
        complain("interrupted")
        return 130
    if isinstance(error, WrongUsageError):
        complain(f"{error} (see cvtimg {given[0]} --help)")
        return 2
    if isinstance(error, typer.TyperException):
        command_line = getattr(getattr(error, "ctx", None), "command_path", f"cvtimg {given[0]}")
        complain(f"{error.format_message().rstrip('.')} (see {command_line} --help)")
        return error.exit_code
    # Its message begins with the file, or says what is not installed.
    named = isinstance(error, ImportError) or (isinstance(error, OSError) and error.errno is None)
    # Errors of the system that name no file are those of what is printed.
    unnamed = "standard output" if isinstance(error, OSError) else "unexpected"
    path = getattr(error, "filename", None) or unnamed
    complain(str(error) if named else f"{path}: {reason(path, error)}")
    return 1
