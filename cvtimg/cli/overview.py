"""The texts of help and ``cvtimg --version``.

``cvtimg COMMAND --help`` has the most usual calls and options on two screens, and names the others;
``cvtimg help COMMAND`` has all, and ``cvtimg help reading`` the options of one panel of all commands.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from cvtimg.options.record import Option

#: The commands in the order of ``--help``, each with its line there.
COMMANDS = {
    "quantize": "Reduce images to a palette of N colors.",
    "explore": "Try settings and see their results at once, in the browser.",
    "palette": "Print the palette of images and the share of the pixels of each color.",
    "segment": "Divide images into N segments of similar color.",
    "restore": "Restore one image from several noisy or incomplete versions of it.",
    "stipple": "Reproduce the tones of images by N dots, for pen plotters and print.",
    "mosaic": "Turn images into mosaics of N convex, single-colored tiles.",
    "mesh": "Divide masks, label images and polygons into triangles.",
    "surface": "Place N points evenly on surfaces, and join them by triangles.",
    "sphere": "Place N points on the globe as the cells of a grid for ocean and atmosphere models.",
    "cluster": "Cluster the rows of tables into N groups.",
    "elbow": "Suggest how many colors or clusters images and tables need.",
    "design": "Place N points for experiments evenly in a box.",
    "basis": "Find N modes that nearly contain all frames of an animation or rows of an array.",
    "info": "Show the size, format, bands, bit depth and number of distinct colors of images.",
}
_OPTIONS = {
    "--version": "Show the version and exit.",
    "--install-completion SHELL": "Install completion for bash, zsh or fish.",
    "--show-completion SHELL": "Show the completion script for bash, zsh or fish.",
    "-h, --help": "Show this message and exit. cvtimg COMMAND --help: the usual options of a command.",
}
_HELP = {
    "cvtimg help COMMAND": "All options of a command, and more examples.",
    "cvtimg help reading": "How images and tables are read: pages, channels, planes, masks.",
}
_ABOUT = (
    "Palettes, segments, restored images, drawings in dots, meshes, grids of the globe, designs of experiments and "
    "clusters, by centroidal Voronoi tessellations."
)
_STATUS = "Exit status: 0 all inputs done; 1 some input failed, the others are done; 2 wrong usage; 130 interrupted."
#: The panel that all commands share, and options of the panel Output that the short help has.
_SHARED, _OUTPUTS = "Reading", ("output", "out_dir")


def overview() -> str:
    """Return the text of ``cvtimg --help``."""
    width = _width()
    lines = ["Usage: cvtimg [OPTIONS] COMMAND [ARGS]...", "", *_wrapped(_ABOUT, "  ", width)]
    for title, entries in (("Options", _OPTIONS), ("Commands", COMMANDS), ("More help", _HELP)):
        lines += _section(title, entries, width)
    return "\n".join([*lines, "", *_wrapped(_STATUS, "  ", width)])


class Described(NamedTuple):
    """What a command says about itself."""

    name: str
    usage: str  # How it is called
    paragraphs: list[str]
    examples: list[str]
    inputs: list[Option]
    panels: dict[str, list[Option]]


def described(verb: str) -> Described:
    """Return what a command says about itself, from its function and the records of its options."""
    from importlib import import_module

    from cvtimg.options import options_of, panel_of

    module = import_module(f"cvtimg.cli.{verb}_command")
    paragraphs = [" ".join(part.split()) for part in re.split(r"\n\s*\n", getattr(module, verb).__doc__)]
    panels: dict[str, list[Option]] = {}
    for option in options_of(verb):
        panels.setdefault(panel_of(option.name) if option.words else "", []).append(option)
    inputs = panels.pop("", [])
    usage = " ".join(["cvtimg", verb, "[OPTIONS]", *(option.metavar for option in inputs)])
    return Described(verb, usage, paragraphs, module.EXAMPLES.rstrip().splitlines(), inputs, panels)


def recorded(options: Iterable[Option]) -> dict[str, str]:
    """Return how options are written, and what they do."""
    records = {}
    for option in options:
        ways = ", ".join(sorted(option.words, key=len)).replace("/", " / ") if option.words else option.metavar
        shown = f" {option.placeholder}" if option.words and option.placeholder else ""
        value = option.name if option.default is True else option.default
        value = f"{value:g}" if isinstance(value, float) else value
        default = "" if value is None or value is False else f"[default: {value}]"
        needed = "[required]" if option.required and option.words else ""
        records[ways + shown] = " ".join(filter(None, (option.help, default, needed)))
    return records


def help_of(verb: str) -> str:
    """Return the text of ``cvtimg COMMAND --help``: the usual options in full, the names of the others."""
    command, width = described(verb), _width()
    lines = [f"Usage: {command.usage}", "", *_wrapped(command.paragraphs[0], "  ", width), "", *command.examples[:3]]
    few, rest = dict[str, "list[Option]"](), dict[str, str]()
    for title, options in command.panels.items():
        usual = [option for option in options if title == "What to get" or option.name in _OUTPUTS]
        few |= {title: usual} if usual else {}
        if title != _SHARED and len(options) > len(usual):
            others = (option.words[0].partition("/")[0] for option in options if option not in usual)
            rest[f"{title}:"] = ", ".join(others)
    for title, options in (("Arguments", command.inputs), *few.items()):
        lines += _section(title, recorded(options), width)
    if _SHARED in command.panels:
        rest[f"{_SHARED}:"] = "see cvtimg help reading"
    return "\n".join([*lines, *_section(f"More options, explained by cvtimg help {verb}", rest, width)])


def whole_help_of(verb: str) -> str:
    """Return the text of ``cvtimg help COMMAND``, with all options."""
    command, width = described(verb), _width()
    lines = [f"Usage: {command.usage}"]
    for paragraph in command.paragraphs:
        lines += ["", *_wrapped(paragraph, "  ", width)]
    lines += ["", "Examples:", *command.examples]
    for title, options in (("Arguments", command.inputs), *command.panels.items()):
        lines += _section(title, recorded(options), width)
    return "\n".join(lines)


def help_on(title: str) -> str:
    """Return the text of ``cvtimg help reading`` and its like: the options of a panel in all commands."""
    commands: dict[tuple[str, str], list[str]] = {}
    for verb in COMMANDS:
        for record in recorded(described(verb).panels.get(title, [])).items():
            commands.setdefault(record, []).append(verb)
    width, lines = _width(), [f"{title}: options of several commands"]
    for verbs in dict.fromkeys(map(tuple, commands.values())):
        records = dict(record for record, others in commands.items() if tuple(others) == verbs)
        lines += _section(", ".join(verbs), records, width)
    return "\n".join(lines)


def _section(title: str, entries: Mapping[str, str], width: int) -> list[str]:
    """Write a heading and, in two columns, what there is; a long entry has a line of its own."""
    if not entries:
        return []
    widest = width // 3 - 4
    margin = 4 + max((len(name) for name in entries if len(name) <= widest), default=widest)
    lines = ["", *_wrapped(f"{title}:", "", width)]
    for name, text in entries.items():
        first, *others = _wrapped(text, " " * margin, width)
        beside = len(name) + 4 <= margin
        lines += [f"  {name}".ljust(margin) + first.lstrip()] if beside else [f"  {name}", first]
        lines += others
    return lines


def _width() -> int:
    """Columns of the terminal, at most 100."""
    with suppress(ValueError, OSError, AttributeError):
        return min(max(int(os.environ.get("COLUMNS") or os.get_terminal_size().columns), 50), 100)
    return 80


def _wrapped(text: str, indent: str, width: int) -> list[str]:
    """Break a text into lines between words, which users copy."""
    from textwrap import TextWrapper  # for help alone

    return TextWrapper(width, indent, indent, break_long_words=False, break_on_hyphens=False).wrap(text) or [indent]


def version() -> str:
    """Return the text of ``cvtimg --version``."""
    import cvtimg

    return f"cvtimg {cvtimg.__version__}"
