"""The reference of the command line, written from the commands: pages of the site, and manual pages.

``python docs/_extensions/command_line.py FOLDER`` writes the manual pages, ``FOLDER/cvtimg-quantize.1`` and so on.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from api_pages import write_changed

import cvtimg
from cvtimg.cli.overview import COMMANDS, Described, described, recorded

STATUS = [
    ("0", "All inputs are done."),
    ("1", "Some inputs failed, and are named on standard error; the others are done."),
    ("2", "The command line is wrong."),
    ("130", "The run was interrupted."),
]


def as_markdown(command: Described) -> str:
    """Return the page of a command."""
    parts = [f"# cvtimg {command.name}", *map(_escaped, command.paragraphs), f"```text\n{command.usage}\n```"]
    for heading, options in (("Arguments", command.inputs), *command.panels.items()):
        records = recorded(options).items()
        if records:
            parts += [f"## {heading}", *(f"`{names}`\n: {_escaped(text) or '-'}" for names, text in records)]
    parts += ["## Examples", "```sh\n" + "\n".join(map(str.strip, command.examples)) + "\n```"]
    return "\n\n".join(parts) + "\n"


def _escaped(text: str) -> str:
    """Return text whose options are code, so that no line breaks within them."""
    return re.sub(r"(?<![\w'`-])(--?[a-z][a-z-]*)", r"`\1`", re.sub(r"([\\*_<>|^\[\]])", r"\\\1", text))


def as_manual(command: Described) -> str:
    """Return the manual page of a command, in the macros of man(7)."""
    lines = [
        f'.TH CVTIMG-{command.name.upper()} 1 "" "cvtimg {cvtimg.__version__}" "User Commands"',
        ".SH NAME",
        f"cvtimg-{command.name} \\- {_roff(command.paragraphs[0][:-1])}",
        ".SH SYNOPSIS",
        f".B {_roff(command.usage)}",
        ".SH DESCRIPTION",
    ]
    for paragraph in command.paragraphs:
        lines += [".PP", _roff(paragraph)]
    panels = [(title.upper(), recorded(options).items()) for title, options in command.panels.items()]
    for heading, records in (("ARGUMENTS", recorded(command.inputs).items()), *panels, ("EXIT STATUS", STATUS)):
        lines.append(f".SH {heading}")
        for names, text in records:
            lines += [".TP", f".B {_roff(names)}", _roff(text) or "\\&"]
    lines += [".SH EXAMPLES", ".nf", *(_roff(line.strip()) for line in command.examples), ".fi"]
    lines += [".SH SEE ALSO", *(f".BR cvtimg-{other} (1)," for other in COMMANDS if other != command.name)]
    return "\n".join(lines).rstrip(",") + "\n"


def _roff(text: str) -> str:
    escaped = text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq")
    return f"\\&{escaped}" if escaped.startswith(".") else escaped


def write_pages(app: Any, config: Any) -> None:
    """Write ``generated/commands/NAME.md`` for each command, and the page that lists them."""
    folder = Path(app.srcdir) / "generated" / "commands"
    folder.mkdir(parents=True, exist_ok=True)
    for command in map(described, COMMANDS):
        write_changed(folder / f"{command.name}.md", as_markdown(command))
    index = Path(__file__).with_name("commands.md.in").read_text()
    names = "\n".join(f"commands/{name}" for name in COMMANDS)
    lines = "\n".join(f"| [cvtimg {name}](commands/{name}.md) | {_escaped(text)} |" for name, text in COMMANDS.items())
    write_changed(folder.parent / "commands.md", index.replace("@COMMANDS@", names).replace("@LINES@", lines))


def setup(app: Any) -> dict[str, bool]:
    """Write the pages before Sphinx looks for them."""
    app.connect("config-inited", write_pages)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.mkdir(parents=True, exist_ok=True)
    for each in map(described, COMMANDS):
        (target / f"cvtimg-{each.name}.1").write_text(as_manual(each))
