"""Options that say which argument of the Python function they are arrive there as it takes them."""

import re
from dataclasses import fields, is_dataclass
from inspect import signature
from pkgutil import resolve_name
from typing import Any

import numpy as np
import pytest
from commands import Run

from cvtimg import write_image
from cvtimg.batch.tasks import WrongUsageError
from cvtimg.cli.overview import COMMANDS
from cvtimg.options import options_of
from cvtimg.options.record import Choice, Option, Pair, Real, Switch, Whole, collected

#: The function behind each command, or both of them, and what the command needs beside the option.
BEHIND = {
    "quantize": ("cvtimg.quantization.quantize_file", "in.png -o out.png"),
    "segment": ("cvtimg.segment", "in.png -k 3 -o out.png"),
    "stipple": ("cvtimg.stipple", "in.png -n 9 -o out.svg"),
    "mosaic": ("cvtimg.mosaic", "in.png -n 9 -o out.png"),
    "cluster": ("cvtimg.tessellate", "rows.npy -k 3 -o out.csv"),
    "elbow": ("cvtimg.energy_curve", "in.png"),
    "basis": ("cvtimg.reduced_basis", "rows.npy -n 2 -o out.npz"),
    "restore": (
        "cvtimg.restoration.reconstruction.restore cvtimg.restoration.reconstruction.denoise",
        "in.png -o out.png",
    ),
}
#: Where the defaults of other commands are, and those of records; the last that has an argument is right.
USUAL = {verb: names for verb, (names, _) in BEHIND.items()} | {
    "quantize": "cvtimg.tessellate cvtimg.quantization.Writing cvtimg.quantization.Reading cvtimg.quantize_frames",
    "segment": "cvtimg.tessellate cvtimg.superpixels cvtimg.segment_hierarchy cvtimg.segment",
    "restore": "cvtimg.denoise cvtimg.restore",
    **{"palette": "cvtimg.find_palette", "mesh": "cvtimg.mesh_region", "surface": "cvtimg.surface_points"},
    **{"sphere": "cvtimg.sphere_grid", "design": "cvtimg.design"},
}
#: Choices that the command makes by other options.
CHOSEN = {("restore", "effort"), ("design", "latin")}
#: What some options need before they can be given, and values of those that are texts.
WITH = {
    "dither_strength": "-k 3 --dither blue-noise",
    "per_frame": "-k 3",
    "ramp": "--palette game-boy",
    "radius_range": "--dots sized",
    "tones": "--layers cmyk",
}


def values(option: Option) -> list[str]:
    """Return words for a value of an option that is not its default."""
    kind = option.kind
    if isinstance(kind, Choice):
        return ["none", *(name for name in kind.names if name not in (option.default, "none", "auto"))][-1:]
    if isinstance(kind, Whole):
        return [str(kind.low + 4)]
    if isinstance(kind, Real):
        return [str(min(max(kind.low, kind.above, 0) + 0.25, kind.high))]
    return ["1", "2"] if isinstance(kind, Pair) else []


def known() -> list[tuple[str, Option]]:
    kinds = (Choice, Whole, Real, Pair, Switch)
    behind = ((verb, one) for verb in BEHIND for one in options_of(verb))
    return [(verb, one) for verb, one in behind if one.keyword and isinstance(one.kind, kinds)]


@pytest.mark.parametrize("verb", USUAL)
def test_an_option_that_is_not_given_is_what_the_function_does_by_itself(verb: str) -> None:
    usual: dict[str, Any] = {}
    for name in USUAL[verb].split():
        usual |= {name: one.default for name, one in signature(resolve_name(name)).parameters.items()}
    for option in options_of(verb):
        value = option.parse(None)
        if option.keyword and value is not None and (verb, option.name) not in CHOSEN:
            assert (option.to(value) if option.to else value) == usual[option.keyword], option.name


@pytest.mark.parametrize(("verb", "option"), known(), ids=lambda one: getattr(one, "name", one))
def test_an_option_arrives_as_an_argument(verb: str, option: Option, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    write_image("in.png", np.random.default_rng(0).integers(0, 256, (12, 16, 3), np.uint8))
    np.save("rows.npy", np.random.default_rng(0).normal(size=(20, 3)))
    arrived: dict[int | str, Any] = {}

    def take(name: int | str, value: Any) -> None:
        inner = {field.name: getattr(value, field.name) for field in fields(value)} if is_dataclass(value) else value
        for each in inner.items() if isinstance(inner, dict) else ():
            take(*each)
        arrived[name] = value

    def function(*given: Any, **named: Any) -> None:
        for one in (*enumerate(given), *named.items()):
            take(*one)
        raise ValueError("is far enough")

    names, words = BEHIND[verb]
    for name in names.split():
        monkeypatch.setattr(name, function)
    value = values(option)
    needed = WITH.get(option.keyword, "").split()
    if verb == "quantize" and not needed and option.name not in ("number", "psnr", "quality", "max_bytes"):
        needed = ["-k", "3"]
    if verb == "restore" and option.name != "number":
        needed = ["-k", "3"] if "detail" in option.excludes else ["--detail"]
    outcome = run(verb, *words.split(), *needed, option.flag, *value)
    assert "is far enough" in outcome.err
    expected = option.parse(value if isinstance(option.kind, Pair) else value[0] if value else True)
    assert arrived[option.keyword] == expected != option.default


def given(option: Option, value: str = "") -> Any:
    """Return a value of an option that is not its default."""
    if isinstance(option.kind, Choice):
        return value or next(name for name in option.kind.names if name != option.default)
    return not option.default if isinstance(option.kind, Switch) else value or 0.125


@pytest.mark.parametrize("verb", COMMANDS)
def test_options_name_what_they_need_and_what_they_exclude(verb: str) -> None:
    options = {option.name: option for option in options_of(verb)}
    plain = {name: option.parse(None) for name, option in options.items()}
    for name, option in options.items():
        one = {**plain, name: given(option)}
        if option.needs:
            needed, _, value = option.needs[0].partition("=")
            with pytest.raises(WrongUsageError, match=re.escape(f"{option.flag} needs {options[needed].flag}")):
                collected(options.values(), one)
            one[needed] = given(options[needed], value)
        for other, _, value in (excluded.partition("=") for excluded in option.excludes):
            if other in options:
                both = {**one, other: given(options[other], value)}
                with pytest.raises(WrongUsageError, match=" exclude each other"):
                    collected(options.values(), both)
