"""Completion by shells, with argcomplete, which asks a parser of argparse what may come next."""

from __future__ import annotations

from argparse import SUPPRESS, ArgumentParser
from pathlib import Path

import argcomplete

from cvtimg.batch import WrongUsageError
from cvtimg.cli.overview import COMMANDS
from cvtimg.options import options_of
from cvtimg.options.record import Choice, Pair, Switch

#: Where each shell looks for what it is to do at its start.
_STARTS = {"bash": ".bashrc", "zsh": ".zshrc", "fish": ".config/fish/completions/cvtimg.fish"}


def complete() -> None:
    """Print what may come next on the command line of the shell that asks, and exit."""
    parser = ArgumentParser("cvtimg", add_help=False)
    commands = parser.add_subparsers()
    for verb, about in COMMANDS.items():
        command = commands.add_parser(verb, help=about, add_help=False)
        for option in options_of(verb):
            ways = [way for word in option.words for way in word.split("/")]
            if isinstance(option.kind, Switch):
                command.add_argument(*ways, action="store_true", help=option.help)
            else:
                count = 2 if isinstance(option.kind, Pair) else None if ways else "*"
                names = option.kind.names if isinstance(option.kind, Choice) else None
                command.add_argument(*(ways or [option.name]), nargs=count, choices=names, help=option.help)
        command.add_argument("--help", action="store_true", help=SUPPRESS)
    argcomplete.autocomplete(parser)


def script_for(shell: str) -> str:
    """Return the script that tells a shell how to complete."""
    if shell not in _STARTS:
        raise WrongUsageError(f"completion is for {', '.join(_STARTS)}, and not for {shell!r}")
    return str(argcomplete.shellcode(["cvtimg"], shell=shell))


def install_for(shell: str) -> str:
    """Let a shell complete from its next start on, and return what was done."""
    script = script_for(shell)
    path = Path.home() / _STARTS[shell]
    path.parent.mkdir(parents=True, exist_ok=True)
    line = f'eval "$(cvtimg --show-completion {shell})"\n'
    if shell == "fish":
        path.write_text(script)
    elif not path.exists() or line not in path.read_text():
        with path.open("a") as file:
            file.write(("autoload -U compinit && compinit\n" if shell == "zsh" else "") + line)
    return f"completion is in {path}; start a new {shell}"
