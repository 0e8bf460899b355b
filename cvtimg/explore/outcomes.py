"""Results of a tab: the lines of Python that make them, what the page shows of them, and the files that it offers."""

import json
import os
import re
import shlex
import tempfile
import threading
from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, is_dataclass
from functools import cache, partial
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image, features

import cvtimg
from cvtimg._shared.choices import Json, Options
from cvtimg._shared.types import Array, Bytes
from cvtimg.explore.controls import Control, controls_of
from cvtimg.explore.layers import Layer, Window
from cvtimg.looks.similarity import Qualities

#: Temporary files and folders begin so, and go on with the number of the process.
FOLDERS = "cvtimg-explore-"
#: Lossy formats of Pillow by the ends of their names; it may be built without some.
_FORMATS = {"jpg": "JPEG", "webp": "WEBP", "avif": "AVIF"}
LOSSY = [end for end, name in _FORMATS.items() if features.check({"JPEG": "jpg"}.get(name, name.lower()))]
#: Pixels, in the middle of the image, on which the setting of a format is searched.
_SEARCHED = 1 << 19
#: The quality that is wanted; its option is that of `cvtimg quantize`.
WANTED: Control = controls_of("quantize", "quality")[0]


class Code(str):
    """An expression of Python: lines write it as it is, and all other values as literals."""

    __slots__ = ()


class Line(NamedTuple):
    """A line of Python, an expression that gets a name; `value` is what it stands for where that is at hand."""

    name: str
    code: Code
    value: Any = None


def call(function: str, *arguments: Any, **keywords: Any) -> Code:
    """Write the call of a function, such as ``"cvtimg.quantize"``."""
    words = [*map(literal, arguments), *(f"{name}={literal(value)}" for name, value in keywords.items())]
    return Code(f"{function}({', '.join(words)})")


def run(lines: Iterable[Line], values: Options | None = None) -> Json:
    """Run lines one after the other, and return the values of all names."""
    named = dict(values or {})
    for line in lines:
        named[line.name] = evaluated(line.code, named) if line.value is None else line.value
    return named


def evaluated(code: Code, values: Options) -> Any:
    """Return what an expression stands for: tabs write it, and what a person chose is in it as literals alone."""
    return eval(code, {"cvtimg": cvtimg, "numpy": np, **values})


def as_python(lines: Sequence[Line], last: Code) -> str:
    """Write lines in Python, and a call after them."""
    written = [*(f"{line.name} = {line.code}" for line in lines), last]
    modules = [name for name in ("cvtimg", "numpy", "PIL.Image") if any(f"{name}." in line for line in written)]
    return "\n".join([*(f"import {name}" for name in modules), "", *written])


def literal(value: object) -> str:
    """Write a value in Python."""
    if isinstance(value, str):
        return value if isinstance(value, Code) else json.dumps(value, ensure_ascii=False)
    if isinstance(value, np.ndarray):
        return repr(value.tolist())
    if isinstance(value, list) and value and is_dataclass(value[0]):
        return f"[{', '.join(map(literal, value))}]"
    if is_dataclass(value):  # all that are passed have a public name in the package of their subject
        package = ".".join(type(value).__module__.split(".")[:2])
        return f"{package}.{value!r}".replace("'", '"')
    return repr(value)


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
        make: Callable[[], bytes]
        if output:
            name = output.pattern.format(self.stem)
            make = partial(written_as, name, lambda path: evaluated(output.writing(path), self.values))
        elif quality.isdigit() and end in fitting(self.image):
            name, make = f"{self.stem}-{quality}.{end}", partial(lossy, self.image, end, int(quality))
        else:
            return None
        with self._lock:
            if key not in self._files:
                self._files[key] = make()
            return name, self._files[key]


def written_as(name: str, write: Callable[[Path], None]) -> bytes:
    """Return the bytes that `write` writes to a file of this name."""
    with tempfile.TemporaryDirectory(prefix=own_prefix()) as folder:
        path = Path(folder, name)
        write(path)
        return path.read_bytes()


def fitting(image: Array | None) -> list[str]:
    """Return the ends of names of the lossy formats that hold an image; nothing for none."""
    if image is None or image.dtype != np.uint8 or image.shape[2:] not in ((), (3,), (4,)):
        return []
    return [end for end in LOSSY if end != "jpg" or image.shape[2:] != (4,)]


def lossy(image: Any, end: str, quality: float) -> bytes:
    """Return the file of the least setting of Pillow that reaches a quality in the middle, or else of the highest."""
    step = max(1.0, (image.shape[0] * image.shape[1] / _SEARCHED) ** 0.5)
    sides = [int(side / step) for side in image.shape[:2]]
    down, right = ((whole - side) // 2 for whole, side in zip(image.shape, sides, strict=False))
    middle = np.ascontiguousarray(image[down : down + sides[0], right : right + sides[1]])
    measure = Qualities(middle).content
    reached = cache(lambda setting: measure(_decoded(_encoded(middle, end, setting), middle)))
    return _encoded(image, end, 1 + bisect_left(range(1, 100), quality, key=reached))


def seen_quality(image: Any, content: bytes) -> float:
    """Return how alike to an image the content of a file looks, as `content_quality`."""
    return Qualities(image).content(_decoded(content, image))


def _encoded(image: Array, end: str, setting: int) -> bytes:
    stream = BytesIO()
    Image.fromarray(image).save(stream, _FORMATS[end], quality=setting)
    return stream.getvalue()


def _decoded(content: bytes, image: Array) -> Bytes:
    """Return the pixels of a file, with as many bands as an image."""
    mode = "L" if image.ndim == 2 else {3: "RGB", 4: "RGBA"}[image.shape[2]]
    return np.asarray(Image.open(BytesIO(content)).convert(mode))
