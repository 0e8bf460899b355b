"""The reference of the command line, written from the commands: pages of the site, and manual pages.

``python docs/_extensions/command_line.py FOLDER`` writes the manual pages, ``FOLDER/cvtimg-quantize.1`` and so on.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer
from api_pages import write_changed

import cvtimg
from cvtimg.cli.commands import app as application

STATUS = [
    ("0", "All inputs are done."),
    ("1", "Some inputs failed, and are named on standard error; the others are done."),
    ("2", "The command line is wrong."),
    ("130", "The run was interrupted."),
]


@dataclass(frozen=True)
class Command:
    """What a command says about itself."""

    name: str
    usage: str
    paragraphs: list[str]
    arguments: list[tuple[str, str]]
    options: dict[str, list[tuple[str, str]]]
    examples: list[str]

    @property
    def summary(self) -> str:
        """The first sentence, without its full stop."""
        return self.paragraphs[0].rstrip(".")


def commands() -> list[Command]:
    """Return the commands in the order of ``cvtimg --help``."""
    group: Any = typer.main.get_command(application)
    context = typer.Context(group, info_name="cvtimg")
    return [_described(group.get_command(context, name), name) for name in group.list_commands(context)]


def _described(command: Any, name: str) -> Command:
    context = typer.Context(command, info_name=f"cvtimg {name}")
    arguments = [one for one in command.get_params(context) if one.param_type_name == "argument"]
    options = {title: _records(some, context) for title, some in command.panels(context).items()}
    paragraphs = [" ".join(part.split()) for part in re.split(r"\n\s*\n", command.help or "")]
    examples = re.findall(r"^\s+(cvtimg .*|\S.* \| cvtimg .*)$", command.epilog or "", flags=re.MULTILINE)
    usage = " ".join(["cvtimg", name, *command.collect_usage_pieces(context)])
    usage = re.sub(r"\{(\w+)\.*\}\.\.\.", r"\1...", usage)
    return Command(name, usage, paragraphs, _records(arguments, context), options, examples)


def _records(parameters: list[Any], context: Any) -> list[tuple[str, str]]:
    """Return how parameters are written and what they do, without the type of an argument that can be repeated."""
    found = filter(None, (one.get_help_record(context) for one in parameters))
    return [(names.removesuffix(" <list[str]>"), " ".join(text.split())) for names, text in found]


def as_markdown(command: Command) -> str:
    """Return the page of a command."""
    parts = [f"# cvtimg {command.name}", *map(_escaped, command.paragraphs), f"```text\n{command.usage}\n```"]
    for heading, records in (("Arguments", command.arguments), *command.options.items()):
        if records:
            parts += [f"## {heading}", *(f"`{names}`\n: {_escaped(text) or '-'}" for names, text in records)]
    if command.examples:
        parts += ["## Examples", "```sh\n" + "\n".join(command.examples) + "\n```"]
    return "\n\n".join(parts) + "\n"


def _escaped(text: str) -> str:
    """Return text whose options are code, so that no line breaks within them."""
    return re.sub(r"(?<![\w'`-])(--?[a-z][a-z-]*)", r"`\1`", re.sub(r"([\\*_<>|^\[\]])", r"\\\1", text))


def as_manual(command: Command) -> str:
    """Return the manual page of a command, in the macros of man(7)."""
    lines = [
        f'.TH CVTIMG-{command.name.upper()} 1 "" "cvtimg {cvtimg.__version__}" "User Commands"',
        ".SH NAME",
        f"cvtimg-{command.name} \\- {_roff(command.summary)}",
        ".SH SYNOPSIS",
        f".B {_roff(command.usage)}",
        ".SH DESCRIPTION",
    ]
    for paragraph in command.paragraphs:
        lines += [".PP", _roff(paragraph)]
    panels = [(title.upper(), records) for title, records in command.options.items()]
    for heading, records in (("ARGUMENTS", command.arguments), *panels, ("EXIT STATUS", STATUS)):
        lines.append(f".SH {heading}")
        for names, text in records:
            lines += [".TP", f".B {_roff(names)}", _roff(text) or "\\&"]
    if command.examples:
        lines += [".SH EXAMPLES", ".nf", *map(_roff, command.examples), ".fi"]
    others = [other.name for other in commands() if other.name != command.name]
    lines += [".SH SEE ALSO", *(f".BR cvtimg-{other} (1)," for other in others)]
    return "\n".join(lines).rstrip(",") + "\n"


def _roff(text: str) -> str:
    escaped = text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq")
    return f"\\&{escaped}" if escaped.startswith(".") else escaped


def write_pages(app: Any, config: Any) -> None:
    """Write ``generated/commands/NAME.md`` for each command, and the page that lists them."""
    folder = Path(app.srcdir) / "generated" / "commands"
    folder.mkdir(parents=True, exist_ok=True)
    for command in commands():
        write_changed(folder / f"{command.name}.md", as_markdown(command))
    index = Path(__file__).with_name("commands.md.in").read_text()
    names = "\n".join(f"commands/{command.name}" for command in commands())
    write_changed(folder.parent / "commands.md", index.replace("@COMMANDS@", names))


def setup(app: Any) -> dict[str, bool]:
    """Write the pages before Sphinx looks for them."""
    app.connect("config-inited", write_pages)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.mkdir(parents=True, exist_ok=True)
    for each in commands():
        (target / f"cvtimg-{each.name}.1").write_text(as_manual(each))
