"""Results of a tab: what the page shows of them, and the files that it offers."""

from __future__ import annotations

import os
import re
import shlex
import tempfile
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cvtimg._shared.choices import Options
from cvtimg._shared.types import Array
from cvtimg.explore.alternatives import fitting, lossy
from cvtimg.explore.calls import Code, Line, as_python, call, evaluated
from cvtimg.explore.layers import Layer, Window

#: Temporary files and folders begin so, and go on with the number of the process.
FOLDERS = "cvtimg-explore-"


def own_prefix() -> str:
    """Return what temporary files and folders of this process begin with; a later server removes what is left."""
    return f"{FOLDERS}{os.getpid()}-"


@dataclass(frozen=True, slots=True, eq=False)
class Output:
    """A file that a result can be saved as."""

    label: str  # Its name on the page
    option: str  # Option of the command that names it
    pattern: str  # Name of the file, with ``{}`` for the name of the picture without suffix
    # The function that writes it: given the file, and then these arguments. By default a result saves itself.
    function: str = "result.save"
    arguments: tuple[Any, ...] = ()
    keywords: Options = field(default_factory=dict)
    read: bool = False  # Whether the command reads the file, which was made on the page

    @property
    def key(self) -> str:
        """The name of the output in addresses: option and end of its name."""
        return f"{self.option.strip('-')}.{self.pattern.partition('.')[2]}"

    def writing(self, file: Path | str) -> Code:
        return call(self.function, str(file), *self.arguments, **self.keywords)


@dataclass(frozen=True, slots=True, eq=False)
class Recipe:
    """The command and the lines of Python that give the same file as the page."""

    words: Sequence[str]  # Command line up to its options, without the names of the outputs
    lines: Sequence[Line]  # Lines of Python up to the result
    before: str = ""  # Command to be run before, if any
    made: str = ""  # Lines of Python that make the picture before, if any
    for_many: bool = True  # Whether the command takes a folder, too
    # Name of the file that the command writes in any case, with ``{}`` for the name of the picture; "" for none.
    always: str = ""

    def shown(self, output: Output, stem: str) -> dict[str, str]:
        name = output.pattern.format(stem)
        also = ["-o", safe_name(self.always.format(stem))] if self.always and output.option != "-o" else []
        command = shlex.join([*self.words, *also, output.option, safe_name(name)])
        python = as_python(self.lines, output.writing(name))
        making = shlex.join(["python", "-c", re.sub("\n+", "; ", self.made)]) if self.made else ""
        commands = [line for line in (making, self.before, command) if line]
        python = "\n\n".join(lines for lines in (self.made, python) if lines)
        shown = {"command": "\n".join(commands), "python": python, "file": name}
        if self.for_many and output.option == "-o" and not self.made:
            shown["folder"] = shlex.join([*self.words[:2], "FOLDER", *self.words[3:], "--out-dir", "OUT"])
        return shown


def safe_name(name: str) -> str:
    """Return the name of a file as the command line takes it: not for an option, nor for a list of names."""
    return f"./{name}" if name.startswith(("-", "@")) else name


@dataclass(slots=True, eq=False, weakref_slot=True)
class Outcome:
    """What settings make of a picture."""

    layer: Layer  # What is seen of the result
    facts: Options  # Numbers that the page shows
    values: Options = field(default_factory=dict)  # What lines of Python call by names, to write files
    outputs: Sequence[Output] = ()  # The files that it can be saved as, the main one first
    stem: str = ""  # Name of the picture without suffix
    drawn: Window | None = None  # The part of the picture that the layer shows; by default all of it
    # Layer and facts of each frame of an animation.
    frames: Sequence[tuple[Layer, Options]] = ()
    image: Array | None = None  # What lossy files hold, and others are compared with, where there are some
    _files: dict[str, bytes] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def file(self, key: str) -> tuple[str, bytes] | None:
        """Return name and content of an output, or None if there is no such output; made once."""
        output = next((candidate for candidate in self.outputs if candidate.key == key), None)
        quality, _, end = key.partition(".")
        if output:
            name = output.pattern.format(self.stem)
        elif quality.isdigit() and end in fitting(self.image):
            name = f"{self.stem}-{quality}.{end}"
        else:
            return None
        with self._lock:
            if key not in self._files:
                self._files[key] = (
                    written_as(name, lambda path: evaluated(output.writing(path), self.values))
                    if output
                    else lossy(self.image, end, int(quality))
                )
            return name, self._files[key]


def written_as(name: str, write: Callable[[Path], None]) -> bytes:
    """Return the bytes that `write` writes to a file of this name."""
    with tempfile.TemporaryDirectory(prefix=own_prefix()) as folder:
        path = Path(folder, name)
        write(path)
        return path.read_bytes()
