"""Read a command line by the records of `cvtimg.options`, import the one command that it names, and explain errors."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

from cvtimg.batch import WrongUsageError
from cvtimg.batch.report import complain, reason
from cvtimg.cli.overview import COMMANDS, help_of, help_on, overview, whole_help_of
from cvtimg.options import PANELS, options_of
from cvtimg.options.record import Given, collected
from cvtimg.options.settings import read_settings
from cvtimg.options.words import taken

_HELP = ("-h", "--help")


def command_of(given: list[str]) -> Callable[[], Any]:
    """Return what a command line asks for: a command with the values of its options, or a text of help."""
    verb, *words = given
    if verb in ("help", *_HELP):
        topic = words[0] if words else ""
        if topic.capitalize() in PANELS:
            return partial(print, help_on(topic.capitalize()), flush=True)
        return partial(print, whole_help_of(_named(topic)) if topic else overview(), flush=True)
    _named(verb)
    if set(_HELP).intersection(words):
        return partial(print, help_of(verb), flush=True)
    return partial(getattr(import_module(f"cvtimg.cli.{verb}_command"), verb), given_to(verb, words))


def _named(verb: str) -> str:
    """Check the name of a command."""
    if verb not in COMMANDS:
        from difflib import get_close_matches

        near = get_close_matches(verb, COMMANDS, 1)
        raise WrongUsageError(f"No such command {verb!r}" + "".join(f"; did you mean {name}?" for name in near))
    return verb


def given_to(verb: str, words: list[str]) -> Given:
    """Return the values of all options; words override settings, and settings the defaults."""
    found = taken(verb, words)
    if path := found.get("settings"):
        found = read_settings(path, verb) | found
    values = {}
    for option in options_of(verb):
        value = found.get(option.name)
        if option.required and not value:
            what = f"option {' / '.join(option.words)}" if option.words else f"argument {option.metavar}"
            raise WrongUsageError(f"Missing {what}")
        try:
            values[option.name] = option.parse(value)
        except ValueError as error:
            raise WrongUsageError(f"{option.flag}: {error}") from error
    given = collected(options_of(verb), values)
    given.command = shlex.join(["cvtimg", verb, *words])
    return given


def explain(error: Exception, given: list[str]) -> int:
    """Say in one line why a command line failed, and return the exit status."""
    if isinstance(error, WrongUsageError):
        complain(f"{error} (see cvtimg {given[0] if given[0] in COMMANDS else ''} --help)".replace("  ", " "))
        return 2
    # Its message begins with the file, or says what is not installed.
    named = isinstance(error, ImportError) or (isinstance(error, OSError) and error.errno is None)
    # Errors of the system that name no file are those of what is printed.
    unnamed = "standard output" if isinstance(error, OSError) else "unexpected"
    path = getattr(error, "filename", None) or unnamed
    complain(str(error) if named else f"{path}: {reason(path, error)}")
    return 1
