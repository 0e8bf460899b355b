"""Change the package at random in small ways, and count the changes that the tests find.

Each mutation turns a comparison, an operator, a number, ``and`` or ``not`` into another one, returns None or leaves a
statement out. The tests that reach the changed line, known from one run under ``coverage``, are run until one fails:
first near and quick ones, then all others for as long as a mutation may take. A mutation that ends in an error or takes
longer counts as found. Mutations of lines that no test reaches in its own process survive.

    python .ci/mutations.py                     # 300 mutations, about an hour on one core
    python .ci/mutations.py --before OLD/tests  # and the same with another suite, to see that none is weaker
    python .ci/mutations.py --count 100 --jobs 2            # a quarter of an hour on two cores
    python .ci/mutations.py --only cvtimg/files --suite tests/files tests/batch  # of one package, by these tests alone
    python .ci/mutations.py --numbers --count 60            # of numbers alone: each is halved or doubled

Numbers are those of kernels and headers, too, which are compiled in a copy. The package must be installed; copies of
the checkout are made below ``build/mutations``, which keeps what is known from coverage between runs (``--again``
forgets it).
"""

from __future__ import annotations

import argparse
import ast
import importlib.util
import io
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parent.parent
#: What tests need beside the package and themselves.
BESIDE = (
    "sample_images",
    "pyproject.toml",
    "cli.py",
    "README.md",
    "CONTRIBUTING.md",
    "docs",
    "examples",
    "meson.build",
)
#: Imported once, before mutations are tried in copies of this process.
HEAVY = ("scipy.ndimage", "scipy.spatial", "scipy.stats", "skimage.measure", "PIL.Image", "tifffile", "typer")
#: Seconds of tests that are run first.
FIRST = 15.0

COMPARED = {
    "<": "<=",
    "<=": "<",
    ">": ">=",
    ">=": ">",
    "==": "!=",
    "!=": "==",
    "is": "is not",
    "is not": "is",
    "in": "not in",
}
COMPUTED = {
    "+": "-",
    "-": "+",
    "*": "/",
    "/": "*",
    "//": "/",
    "%": "*",
    "**": "*",
    "&": "|",
    "|": "&",
    "<<": ">>",
    ">>": "<<",
}


class Mutation(NamedTuple):
    """A part of a file and what replaces it; `start` and `stop` count bytes."""

    path: str
    line: int
    last: int
    start: int
    stop: int
    text: str

    def applied(self, source: bytes) -> bytes:
        """Return a file with the mutation."""
        return source[: self.start] + self.text.encode() + source[self.stop :]


class Suite(NamedTuple):
    """Tests in a copy of the checkout; which of them reach a line, and how long each takes."""

    root: Path
    reaching: dict[str, dict[int, list[int]]]
    seconds: dict[str, float]


def mutations(path: str, source: bytes) -> Iterator[Mutation]:
    """Yield all mutations of a module."""
    starts = [0]
    for text in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(text))

    def span(node: Any) -> tuple[int, int]:
        return starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset

    def made(node: Any, start: int, stop: int, text: str) -> Mutation:
        return Mutation(path, node.lineno, node.end_lineno, start, stop, text)

    def between(node: Any, left: Any, right: Any, turned: dict[str, str]) -> Iterator[Mutation]:
        start, stop = span(left)[1], span(right)[0]
        found = re.search(
            rb"(?<=[\s\w)\]])(is not|not in|is|in|and|or|[-+*/%&|<>=!]+)(?=[\s\w(\[])", source[start:stop]
        )
        if found and found[1].decode() in turned:
            yield made(node, start + found.start(), start + found.end(), turned[found[1].decode()])

    ignored: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if id(node) in ignored:
            continue
        # Types and constants of the interface are no behavior.
        for part in (getattr(node, "annotation", None), getattr(node, "returns", None)):
            ignored |= {id(child) for child in ast.walk(part)} if part else set()
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            ignored |= {id(child) for child in ast.walk(node)}
        elif isinstance(node, ast.Compare) and len(node.ops) == 1:
            yield from between(node, node.left, node.comparators[0], COMPARED)
        elif isinstance(node, ast.BinOp) and not any(
            isinstance(side, ast.JoinedStr) for side in (node.left, node.right)
        ):
            yield from between(node, node.left, node.right, COMPUTED)
        elif isinstance(node, ast.BoolOp):
            yield from between(node, *node.values[:2], {"and": "or", "or": "and"})
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            yield made(node, span(node)[0], span(node.operand)[0], "")
        elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            text = str(not node.value) if isinstance(node.value, bool) else f"{node.value + 1!r}"
            yield made(node, *span(node), text)
        elif isinstance(node, ast.Return) and node.value and not isinstance(node.value, ast.Constant):
            yield made(node, *span(node.value), "None")
        elif (isinstance(node, ast.Expr) and not isinstance(node.value, ast.Constant)) or isinstance(
            node, ast.AugAssign | ast.Raise
        ):
            yield made(node, *span(node), "pass")


def halved_or_doubled(path: str, source: bytes) -> Iterator[Mutation]:
    """Yield a mutation of each number of a module: of its constants, and of records of settings and their defaults."""
    starts = [0]
    for text in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(text))
    numbers = numbers_of_kernel(source, starts) if not path.endswith(".py") else numbers_of_module(source, starts)
    for line, start, stop, value in numbers:
        halve = value != 1 and random.Random(f"{path}:{start}").random() < 0.5
        half = value // 2 if isinstance(value, int) else value / 2
        yield Mutation(path, line, line, start, stop, repr(half if halve else 2 * value))


def numbers_of_module(source: bytes, starts: list[int]) -> Iterator[tuple[int, int, int, float]]:
    """Yield line, start, stop and value of each number that a module or a class assigns."""
    module = ast.parse(source)
    bodies = [module.body, *(node.body for node in module.body if isinstance(node, ast.ClassDef))]
    values = [node.value for body in bodies for node in body if isinstance(node, ast.Assign | ast.AnnAssign)]
    for value in filter(None, values):
        for node in ast.walk(value):
            if isinstance(node, ast.Constant) and type(node.value) in (int, float) and node.value:
                start = starts[node.lineno - 1]
                yield node.lineno, start + node.col_offset, start + (node.end_col_offset or 0), node.value


def numbers_of_kernel(source: bytes, starts: list[int]) -> Iterator[tuple[int, int, int, float]]:
    """Yield the same of each number of a kernel or header that has a name or, being a threshold, an exponent."""
    in_text = False
    for line, text in enumerate(source.splitlines(keepends=True), 1):
        was_in_text, in_text = in_text, in_text ^ (text.count(b'"""') == 1)
        code = b"" if was_in_text else re.split(rb'/\*|//|#(?!define)|"""|^\s\*', text)[0]
        is_named = re.match(rb"\s*(enum \{|#define \w+ |static const \w+ )", code)
        for number in re.finditer(rb"(?<![\w.])\d+(\.\d*)?(e[-+]?\d+)?(?=f?\b|$)", code):
            value = float(number[0]) if number[1] or number[2] else int(number[0])
            if value and (is_named or number[2]):
                yield line, starts[line - 1] + number.start(), starts[line - 1] + number.end(), value


@cache
def kernels_of(root: Path) -> Path:
    """Make a folder beside a suite in which its kernels are compiled."""
    folder, checkout = (
        root.with_name(f"{root.name}-kernels"),
        Path(json.loads((root / "build.json").read_text())).parent,
    )
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(checkout / "cvtimg", folder / "cvtimg", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("meson.build", "meson.options"):
        shutil.copy2(checkout / name, folder)
    subprocess.run(["meson", "setup", "build", "-Dsimd=native"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return folder


def is_compiled(root: Path) -> bool:
    """Compile what has changed of the kernels of a suite; return whether that can be done."""
    build = kernels_of(root) / "build"
    done = subprocess.run(["ninja", "-C", build], check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for module in build.glob("cvtimg/*.so"):
        shutil.copy2(module, next(root.rglob(module.name)))
    return done.returncode == 0


def copy(tests: Path, package: Path, root: Path) -> None:
    """Make a folder with the tests and with the package as it is installed, compiled modules among its sources."""
    shutil.rmtree(root, ignore_errors=True)
    ignore = shutil.ignore_patterns("__pycache__", "*.pyx", "*.c", "*.h", "generated")
    shutil.copytree(package, root / "cvtimg", ignore=ignore)
    shutil.copytree(tests, root / "tests", ignore=ignore)
    for name in BESIDE:
        source = tests.parent / name
        if source.is_dir():
            shutil.copytree(source, root / name, ignore=ignore)
        elif source.exists():
            shutil.copy2(source, root / name)
    modules = [path.relative_to(package.parent).with_suffix("") for path in package.rglob("*.pyx")]
    for module in (*modules, Path("cvtimg/_cyutility")):
        found = importlib.util.find_spec(".".join(module.parts))
        if found and found.origin:
            shutil.copy2(found.origin, root / module.parent)
    (root / "build.json").write_text(json.dumps(str(package.parent / "build")))


def in_child(work: Callable[[], int | None], seconds: float) -> int | None:
    """Return what work in a copy of this process comes to; None if it takes longer. Nothing that it starts is left."""
    child = os.fork()
    if not child:
        status = 99
        try:
            os.setsid()
            signal.signal(signal.SIGINT, signal.default_int_handler)
            resource.setrlimit(resource.RLIMIT_AS, (16 << 30, 16 << 30))
            nothing = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(nothing, stream)
            status = work() or 0
        finally:
            os._exit(status)
    end, result = time.monotonic() + seconds, None
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            result = os.waitstatus_to_exitcode(status)
            break
        time.sleep(0.02)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    if result is None:
        os.waitpid(child, 0)
    return result


def run_tests(root: Path, plugin: object, arguments: list[str]) -> int:
    """Run tests with the package of a copy, in this process and those that it starts."""
    import pytest

    os.chdir(root)
    sys.path.insert(0, str(root))
    # An editable install would be found before the copy.
    os.environ |= {"PYTHONPATH": str(root), "MESONPY_EDITABLE_SKIP": json.loads((root / "build.json").read_text())}
    # Another suite may have tests of what the package no longer has.
    common = ["-q", "-p", "no:cacheprovider", "-p", "no:randomly", "--continue-on-collection-errors"]
    common += ["--rootdir", str(root), "-m", "not slow"]
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        return int(pytest.main([*common, *arguments], plugins=[plugin]))


def used() -> float:
    """Return the seconds that processors have worked for this process and those that it has started."""
    return sum(os.times()[:4])


class Recording:
    """Record which tests pass, how long they take, and with coverage which lines each reaches."""

    def __init__(self) -> None:
        import coverage

        self.coverage = coverage.Coverage(source_pkgs=["cvtimg"], data_file=None, branch=False)
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()
        self.began = 0.0

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Begin with a test."""
        self.coverage.switch_context(nodeid)
        self.began = used()

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """End with a test."""
        self.seconds[nodeid] = used() - self.began
        self.coverage.switch_context("")

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Note what does not pass."""
        if report.outcome != "passed":
            self.failed.add(report.nodeid)


def in_parallel(works: list[Callable[[], object]]) -> None:
    """Do some works side by side, each in a copy of this process; if one fails, so does this process."""
    children = []
    for work in works:
        sys.stdout.flush()
        children.append(os.fork())
        if not children[-1]:
            status = 1
            try:
                work()
                status = 0
            finally:
                sys.stdout.flush()
                os._exit(status)
    if sum(os.waitpid(child, 0)[1] != 0 for child in children):
        sys.exit("a part failed")


def record(root: Path, tests: list[str], file: Path) -> None:
    """Run some quick tests once under coverage, and keep what is known in a file."""
    plugin = Recording()
    plugin.coverage.start()
    run_tests(root, plugin, tests)
    plugin.coverage.stop()
    data = plugin.coverage.get_data()
    numbers = {test: number for number, test in enumerate(plugin.seconds) if test not in plugin.failed}
    reaching = {
        str(Path(name).relative_to(root)): {
            line: [numbers[test] for test in tests if test in numbers]
            for line, tests in data.contexts_by_lineno(name).items()
        }
        for name in data.measured_files()
    }
    content = {"reaching": reaching, "seconds": plugin.seconds, "failed": sorted(plugin.failed)}
    file.write_text(json.dumps(content))


def record_all(root: Path, suite: list[str], jobs: int) -> None:
    """Record all tests, in some processes, and keep what is known of them together."""
    files = [path for place in suite for path in sorted((root / place).rglob("test_*.py"))]
    parts = [[str(path.relative_to(root)) for path in files[part::jobs]] for part in range(jobs)]
    if suite == ["tests"]:
        parts[0] += ["--pyargs", "cvtimg"]
    names = [root / f"known{part}.json" for part in range(jobs)]
    works = [partial(record, root, tests, name) for tests, name in zip(parts, names, strict=True)]
    in_parallel([partial(in_child, work, 6 * 3600) for work in works])
    reaching: dict[str, dict[int, list[int]]] = {}
    seconds: dict[str, float] = {}
    failed: list[str] = []
    for name in names:
        part, shift = json.loads(name.read_text()), len(seconds)
        for path, lines in part["reaching"].items():
            for line, tests in lines.items():
                reaching.setdefault(path, {}).setdefault(line, []).extend(test + shift for test in tests)
        seconds |= part["seconds"]
        failed += part["failed"]
    (root / "known.json").write_text(json.dumps({"reaching": reaching, "seconds": seconds, "failed": failed}))


def known(tests: Path, package: Path, root: Path, given: argparse.Namespace) -> Suite:
    """Return a suite and what it reaches."""
    if given.again or not (root / "known.json").exists():
        # In another process, since this one must not import the package.
        if in_child(lambda: copy(tests, package, root), 6 * 3600) != 0:
            sys.exit(f"{root}: cannot be copied")
        record_all(root, given.suite, given.jobs)
    content = json.loads((root / "known.json").read_text())
    if not content["seconds"]:
        sys.exit(f"{root}: no test runs")
    print(f"{root.name}: {len(content['seconds'])} tests, {len(content['failed'])} of them do not count", flush=True)
    reaching = {
        path: {int(line): tests for line, tests in lines.items()} for path, lines in content["reaching"].items()
    }
    return Suite(root, reaching, content["seconds"])


def candidates(suite: Suite, mutation: Mutation, first: str | None) -> list[str]:
    """Return the tests that reach a mutation: one of a given name, then those of its package, the quickest first."""
    lines = suite.reaching.get(mutation.path, {})
    numbers = {test for line in range(mutation.line, mutation.last + 1) for test in lines.get(line, ())}
    tests = list(suite.seconds)
    subject = Path(mutation.path).parts[1].removesuffix(".py")
    is_near = {test: subject in test.partition("::")[0].split("/") for test in tests}
    if (
        not numbers
    ):  # a line that runs as the module is imported, so that a test may take what it makes and run no other
        numbers = {test for tests in lines.values() for test in tests}
        numbers |= {number for number, test in enumerate(tests) if is_near[test]}

    def order(test: str) -> tuple[bool, bool, float]:
        return name_of(test) != first, not is_near[test], suite.seconds[test]

    return sorted((tests[number] for number in numbers), key=order)


def name_of(test: str) -> str:
    """Return the name of a test without its parameters and its file."""
    return test.partition("[")[0].rpartition("::")[2]


class Selected:
    """Run some tests in their order, and tell which of them fails."""

    def __init__(self, tests: list[str], told: int) -> None:
        self.place, self.told = {test: place for place, test in enumerate(tests)}, told

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        """Leave the tests that are to run, in their order."""
        items[:] = sorted(
            (item for item in items if item.nodeid in self.place), key=lambda item: self.place[item.nodeid]
        )

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Tell what fails."""
        if report.failed:
            os.write(self.told, report.nodeid.encode())


def killer(suite: Suite, mutation: Mutation, limit: float, first: str | None = None) -> str | None:
    """Return the test that finds a mutation, or "an error" or "time"; None if none does."""
    tests = candidates(suite, mutation, first)
    is_kernel = not mutation.path.endswith(".py")
    path = (kernels_of(suite.root) if is_kernel else suite.root) / mutation.path
    source, times = path.read_bytes(), path.stat()
    near, spent = 0, 0.0
    while near < len(tests) and spent + suite.seconds[tests[near]] < FIRST:
        spent += suite.seconds[tests[near]]
        near += 1
    far, spent = near, 0.0
    while far < len(tests) and spent + suite.seconds[tests[far]] < limit:
        spent += suite.seconds[tests[far]]
        far += 1
    path.write_bytes(mutation.applied(source))
    try:
        if is_kernel and not is_compiled(suite.root):
            return "an error"
        for part in (tests[:near], tests[near:far]):
            if part:
                files = list(dict.fromkeys(test.partition("::")[0] for test in part))
                reading, told = os.pipe()
                plugin = Selected(part, told)
                arguments = ["-x", "--hypothesis-seed=0", *files]
                seconds = 30 + 8 * sum(suite.seconds[test] for test in part)
                status = in_child(partial(run_tests, suite.root, plugin, arguments), seconds)
                os.close(told)
                with os.fdopen(reading, "rb") as pipe:
                    failed = pipe.read().decode()
                if failed or status != 0:
                    return failed.split("\n")[0] or ("time" if status is None else "an error")
    finally:
        path.write_bytes(source)
        if is_kernel:
            is_compiled(suite.root)
        else:
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    return None


def main() -> None:
    """Try mutations, and print how many are found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tests", type=Path, default=ROOT / "tests")
    parser.add_argument("--before", type=Path, help="another suite for the same package")
    parser.add_argument(
        "--package", type=Path, default=ROOT / "cvtimg", help="sources of the package that is installed"
    )
    parser.add_argument("--limit", type=float, default=60, help="seconds of tests for one mutation")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "mutations")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--jobs", type=int, default=1, help="processes that work side by side")
    parser.add_argument("--suite", nargs="+", default=["tests"], help="folders of the tests")
    parser.add_argument("--only", nargs="+", default=[""], help="mutate files whose path contains one of these")
    parser.add_argument("--numbers", action="store_true", help="halve or double numbers, and change nothing else")
    given = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    folder = given.folder.resolve()
    package = given.package.resolve()
    suites = [known(given.tests.resolve(), package, folder / "tests", given)]
    if given.before:
        suites.append(known(given.before.resolve(), package, folder / "before", given))
    suffixes = (".py", ".pyx", ".c", ".h") if given.numbers else (".py",)
    files = [path for path in sorted(package.rglob("*")) if path.suffix in suffixes]
    sources = {str(path.relative_to(package.parent)): path.read_bytes() for path in files}
    sites = [
        mutation
        for path, source in sources.items()
        if any(one in path for one in given.only)
        for mutation in (halved_or_doubled if given.numbers else mutations)(path, source)
    ]
    chosen = random.Random(given.seed).sample(sites, min(given.count, len(sites)))
    for module in HEAVY:
        importlib.import_module(module)
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    sys.dont_write_bytecode = True
    told = [folder / f"found{part}.json" for part in range(given.jobs)]

    def try_some(part: int) -> None:
        own = [suite._replace(root=suite.root.with_name(f"{suite.root.name}{part}")) for suite in suites]
        for suite, copied in zip(suites, own, strict=True):
            shutil.rmtree(copied.root, ignore_errors=True)
            shutil.copytree(suite.root, copied.root)
        n_found = [0] * len(suites)
        for number, mutation in enumerate(chosen[part :: given.jobs], 1):
            found: list[str | None] = []
            for suite in own:
                found.append(killer(suite, mutation, given.limit, name_of(found[0]) if found and found[0] else None))
            n_found = [count + bool(test) for count, test in zip(n_found, found, strict=True)]
            text = sources[mutation.path][mutation.start : mutation.stop].decode().partition("\n")[0]
            shares = " ".join(f"{count}/{number}" for count in n_found)
            print(f"{shares} {mutation.path}:{mutation.line} {text!r} -> {mutation.text!r}: {found}", flush=True)
        told[part].write_text(json.dumps(n_found))

    in_parallel([partial(try_some, part) for part in range(given.jobs)])
    for suite, counts in zip(suites, zip(*(json.loads(one.read_text()) for one in told), strict=True), strict=True):
        print(f"{suite.root.name}: {sum(counts)} of {len(chosen)} mutations are found, {sum(counts) / len(chosen):.1%}")


if __name__ == "__main__":
    main()
