"""Plan a run: find the inputs that arguments name, name the outputs, and refuse conflicts before any work is done."""

import glob
import os
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import TypeAlias

from cvtimg.batch.pipes import STANDARD, is_pipe, is_standard, read_all, stem_of
from cvtimg.batch.tasks import Missing, Task, WrongUsageError
from cvtimg.files.finding import find_images
from cvtimg.files.remote import IS_ONE, check_name, elsewhere, is_remote, url_of

#: How an output is named: a pattern such as ``"{}-labels.png"``, in which ``{}`` is the name of the input without its
#: suffix, or a function that returns the pattern for an input.
Pattern: TypeAlias = str | Callable[[Path], str]
#: Files to write, by option: a path, a pattern, or None for an option that is not given. The main output is ``"-o"``.
Outputs: TypeAlias = Mapping[str, Path | Pattern | None]


@dataclass(slots=True)
class Plan:
    """Tasks of a run."""

    tasks: list[Task]  # Inputs with their outputs
    missing: Missing = field(default_factory=list)  # Arguments that name no readable input, with the error
    out_dir: Path | None = None  # Folder for outputs, created if missing
    also_read: Sequence[Path] = ()  # Other files that are read, such as masks. No output may replace them.
    joint: Mapping[str, Path] = field(default_factory=dict)  # Files written once for all inputs together, by option
    names: Sequence[str] = ()  # The arguments, and in place of lists what they list
    # Names of tasks that a joint file knows from an earlier run; None where no such file decides what is done.
    known: Collection[str] | None = None


def plan_each(
    inputs: Iterable[str],
    outputs: Outputs | None = None,
    *,
    out_dir: Path | None = None,
    expand: Callable[[str], list[Path]] = find_images,
    also_read: Iterable[Path | None] = (),
    joint: Mapping[str, Path | None] | None = None,
    beside: bool = False,
) -> Plan:
    """Plan a task for each input, with the outputs that its options name; see `find` for the inputs."""
    # The output of a pipe, such as standard input, goes to standard output unless it is named. Joint outputs are
    # written once for all inputs; `beside` allows outputs of several inputs without `out_dir`, beside them.
    wanted = {option: path for option, path in (outputs or {}).items() if path is not None}
    sources, missing, names = find(inputs, expand, out_dir)
    _check_outputs(len(sources) + len(missing), out_dir, wanted, beside)
    stems = Counter((source.parent, stem_of(source)) for source in sources)
    tasks = []
    for source, folder in sources.items():
        alone = stems[source.parent, stem_of(source)] == 1
        outputs_of = {option: _output(path, source, folder, alone) for option, path in wanted.items()}
        main = wanted.get("-o")
        if main and not isinstance(main, Path) and is_pipe(source) and not out_dir:
            outputs_of["-o"] = Path(STANDARD + outputs_of["-o"].suffix)
        tasks.append(Task((source,), outputs_of))
    named = {option: path for option, path in (joint or {}).items() if path}
    return Plan(tasks, missing, out_dir, [path for path in also_read if path], named, names)


def plan_one(
    inputs: Iterable[str], outputs: Mapping[str, Path | None], *, also_read: Iterable[Path | None] = ()
) -> Plan:
    """Plan a single task for all inputs, of which there may be none; the parameters are those of `plan_each`."""
    sources, missing, _ = find(inputs)
    named = {option: path for option, path in outputs.items() if path}
    return Plan([] if missing else [Task(tuple(sources), named)], missing, None, [path for path in also_read if path])


def _output(path: Path | Pattern, source: Path, folder: Path, alone: bool) -> Path:
    """Name an output; of inputs that differ only in their suffixes, a.webp becomes a.webp.png beside a.png."""
    if isinstance(path, Path):
        return path
    pattern = path if isinstance(path, str) else path(source)
    output = folder / pattern.format(stem_of(source))
    return output if alone or output.suffix == source.suffix else output.with_name(pattern.format(source.name))


def find(
    inputs: Iterable[str], expand: Callable[[str], list[Path]] = find_images, out_dir: Path | None = None
) -> tuple[dict[Path, Path], Missing, list[str]]:
    """Find the files that arguments name, each with the folder for its outputs, and the arguments that name none.

    Also return the names that were given, themselves or in lists. WrongUsageError refuses empty arguments, as a shell
    makes them of variables that are not set.
    """
    # Arguments are files, folders and patterns; "-" is standard input, "@FILE" a file that lists names, one per line or
    # separated by zero bytes, and "@-" such a list on standard input. Outputs go to the folder of the file, or to the
    # one in `out_dir` that mirrors its place below what named it. Files in an `out_dir` inside an input folder come
    # from an earlier run, and are no inputs.
    sources: dict[Path, Path] = {}
    missing: Missing = []
    names: list[str] = []
    outside = Path(os.path.realpath(out_dir)) if out_dir else None
    for text, root in _listed(inputs, missing):
        names.append(text)
        try:
            paths = [Path(text)] if is_pipe(Path(text)) else expand(text)
        except OSError as error:
            missing.append((text, error))
            continue
        if outside and Path(os.path.realpath(text)) in outside.parents:
            paths = [path for path in paths if outside not in Path(os.path.realpath(path)).parents]
        for path in paths:
            sources.setdefault(path, out_dir / _below(path, root) if out_dir else path.parent)
    return sources, missing, names


def searched(plan: Plan) -> list[str]:
    """Return the folders of which all files are inputs, as they were given or match a pattern."""
    folders = []
    for text in plan.names:
        if is_remote(text):
            folders += [] if Path(text).suffix or glob.has_magic(text) else [text]
            continue
        by_pattern = glob.has_magic(text) and not Path(text).exists()
        named = glob.glob(text, recursive=True) if by_pattern else [text]  # noqa: PTH207
        folders += [name for name in named if Path(name).is_dir() and not IS_ONE.fullmatch(name)]
    return folders


def _listed(inputs: Iterable[str], missing: Missing) -> Iterator[tuple[str, Path]]:
    """Yield each argument, those from lists included, with the folder to which its outputs are relative."""
    for text in inputs:
        try:
            check_name(text.removeprefix("@"))
        except ValueError as error:
            raise WrongUsageError(f"{text!r}: {error}") from error
        if not text.startswith("@") or Path(text).exists():
            yield text, _root(text)
            continue
        try:
            content = read_all(Path(text[1:]))
        except OSError as error:
            missing.append((text, error))
            continue
        names = content.split(b"\0") if b"\0" in content else content.splitlines()
        yield from ((os.fsdecode(name), Path()) for name in names if name)


def _root(text: str) -> Path:
    """Return the folder that an argument names or is in; for a pattern, the folder before the first wildcard."""
    path = Path(text)
    if path.is_dir() or (is_remote(text) and not path.suffix and not glob.has_magic(text)):
        return path
    if glob.has_magic(text) and not path.exists():
        return Path(*takewhile(lambda part: not glob.has_magic(part), path.parts))
    return path.parent


def _below(path: Path, root: Path) -> Path:
    with suppress(ValueError):
        below = path.relative_to(root).parent
        if ".." not in below.parts:  # outputs never leave their folder, whatever a list names
            return below
    return Path()


def check_suffix(option: str, path: Path | None, allowed: Iterable[str], *, folders: bool = False) -> None:
    """Raise WrongUsageError unless the suffix of a file is allowed; `folders` tells that there is --out-dir."""
    hint = "; for a folder there is --out-dir" if folders else ""
    if path and path.is_dir() and path.suffix.lower() != ".zarr":
        raise WrongUsageError(f"{option}: {path} is a folder, and must be a file{hint}")
    if path and path.suffix.lower() not in (suffixes := list(allowed)):
        hint = "" if path.suffix else hint
        raise WrongUsageError(f"{option}: {str(path)!r} must end in one of {', '.join(suffixes)}{hint}")


def _check_outputs(n_inputs: int, out_dir: Path | None, outputs: Mapping[str, Path | Pattern], beside: bool) -> None:
    """Refuse one output file for several inputs, and several inputs without a folder for their outputs."""
    named = [option for option, path in outputs.items() if isinstance(path, Path)]
    if "-o" in named and out_dir:
        raise WrongUsageError("-o and --out-dir exclude each other")
    if n_inputs > 1 and named:
        instead = ": use --out-dir DIR for several" if named[0] == "-o" else ""
        raise WrongUsageError(f"{named[0]} is for one input, and these are {n_inputs}{instead}")
    if n_inputs > 1 and outputs and not (out_dir or beside):
        raise WrongUsageError(f"{n_inputs} inputs need --out-dir DIR")


def check_no_clash(plan: Plan, report: Path | None = None, *, in_place: bool = False) -> None:
    """Refuse outputs that would replace a file that is read, or each other, or through a link a file elsewhere."""
    # With `in_place` an output may replace its own input.
    read = [*(path for task in plan.tasks for path in task.sources), *plan.also_read]
    folders = [_root(text) for text in plan.names if glob.has_magic(text) or Path(text).is_dir()]
    inputs = {_identity(path) for path in read}
    wanted = [(path, task.name, task.sources) for task in plan.tasks for path in task.outputs.values()]
    wanted += [(path, option, ()) for option, path in plan.joint.items()]
    wanted += [(report, "--report", ())] if report else []
    owners: dict[str, str] = {}
    for path, owner, sources in wanted:
        if is_standard(path):
            continue
        replaces = in_place and path in sources[:1]
        _check_link(path, folders, in_place=replaces)
        if not replaces and _identity(path) in inputs - {None}:
            raise WrongUsageError(f"{url_of(path)} is an input, which is never replaced; choose another output")
        place = os.path.normcase(os.path.realpath(path))
        if place in owners:
            who = f"two outputs of {owner}" if owners[place] == owner else f"{owners[place]} and {owner}"
            above = os.path.commonpath([owners[place], owner]) if plan.out_dir and not is_remote(owner) else ""
            hint = f"; give {above}, which has both, to keep their folders" if above and Path(above).is_dir() else ""
            raise WrongUsageError(f"{who} would both become {url_of(path)}{hint}")
        owners[place] = owner


def _check_link(path: Path, folders: Sequence[Path], *, in_place: bool) -> None:
    # In place, the file may be anywhere in the folder that is an input; otherwise it may be beside the link.
    given = [folder for folder in folders if folder in path.parents] if in_place else [path.parent]
    if is_remote(path) or not (path.is_symlink() or (in_place and given)):
        return
    real = Path(os.path.realpath(path))  # unlike `Path.resolve`, raises nothing for links in a circle
    if not any(Path(os.path.realpath(folder)) in real.parents for folder in given):
        raise WrongUsageError(f"{path} is a link to {real}, a file elsewhere, which is not replaced; name that file")


def _identity(path: Path) -> tuple[int, int] | str | None:
    """Return what is the same for all names of a file: device and inode, or the URL; None if there is no such file."""
    try:
        if is_remote(path):
            with elsewhere(path) as (files, place):  # the same for all ways to write a URL
                return str(files.unstrip_protocol(place))
        status = path.stat()
    except OSError:  # its own task reports the error
        return None
    return status.st_dev, status.st_ino
