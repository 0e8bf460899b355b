"""The command line does what it says, names what fails in one line, and leaves with the right status."""

import csv
import json
import os
import re
import subprocess
import sys
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import reference
from commands import Run

import cvtimg
from cvtimg import read_image, write_image
from cvtimg._shared.budgets import MAX_COLORS
from cvtimg._shared.types import Array
from cvtimg.cli.overview import COMMANDS
from cvtimg.colors import SPACES
from cvtimg.elbow.rules import RULES
from cvtimg.labels.contours import EDGE_MODES
from cvtimg.options import PANELS, options_of
from cvtimg.options.record import Choice
from cvtimg.pictures import files as io
from cvtimg.quantization.dithering import DITHERS
from cvtimg.restoration import RENORMALIZATIONS
from cvtimg.tables.files import MISSING, read_table

pytestmark = pytest.mark.timeout(120)
ROOT = Path(__file__).parents[2]
RNG = np.random.default_rng(3)
RGB = RNG.integers(0, 256, (24, 32, 3), np.uint8)
GREY = RNG.integers(0, 256, (24, 32), np.uint8)
RGBA = RNG.integers(0, 256, (24, 32, 4), np.uint8)
DEEP = RNG.integers(0, 65536, (24, 32), np.uint16)
#: Seven colors, fewer than are asked for below.
FEW = RGB.reshape(-1, 3)[RNG.integers(0, 7, (24, 32))]

KEYS = ["input", "output", "width", "height", "channels", "left_out", "distinct_colors", "k", "elbow"]
KEYS += ["energy", "mse", "psnr", "n_iter", "converged", "input_bytes", "output_bytes", "seconds"]


@pytest.fixture
def here(here: Path) -> Path:
    """Work in an empty folder with pictures in pictures/."""
    (here / "pictures").mkdir()
    for name, image in {"rgb": RGB, "grey": GREY, "rgba": RGBA, "deep": DEEP, "few": FEW}.items():
        write_image(here / f"pictures/{name}.png", image)
    return here


def process(*arguments: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own."""
    command = [sys.executable, "-P", "-m", "cvtimg", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, **options)


# What comes out


@pytest.mark.parametrize(
    ("name", "n_colors"),
    [*((name, 16) for name in ("rgb", "grey", "rgba", "deep", "few")), *(("rgb", k) for k in (2, 4, 256))],
)
def test_figures_agree_with_the_files(run: Run, here: Path, name: str, n_colors: int) -> None:
    source = Path(f"pictures/{name}.png")
    outcome = run("quantize", source, "-k", str(n_colors), "-o", "out.png", "--json")
    assert (outcome.status, outcome.err) == (0, "")
    (row,) = outcome.rows
    before, after = read_image(source), read_image("out.png")
    if before.ndim == 2 and after.ndim == 3:
        after = after[..., 0]
    energy = reference.seen_energy(before, after)
    assert row["energy"] == pytest.approx(energy)
    assert row["mse"] == pytest.approx(energy / before[..., :3].size if before.ndim == 3 else energy / before.size)
    if row["energy"]:
        assert row["psnr"] == pytest.approx(10 * np.log10(float(np.iinfo(before.dtype).max) ** 2 / row["mse"]))
    else:
        assert row["psnr"] is None
    assert row["k"] == n_distinct(after) <= n_colors
    assert row["distinct_colors"] == n_distinct(before)
    assert (row["height"], row["width"]) == before.shape[:2]
    assert row["channels"] == (before.shape[2] if before.ndim == 3 else 1)


def n_distinct(image: Array) -> int:
    return len(np.unique(image.reshape(image.shape[0] * image.shape[1], -1), axis=0))


def test_json_has_the_keys_that_are_documented_in_order(run: Run, here: Path) -> None:
    (row,) = run("quantize", "pictures/rgb.png", "-k", "4", "--json").rows
    assert list(row) == KEYS
    assert list(row["seconds"]) == ["read", "cluster", "write"]
    assert all(seconds >= 0 for seconds in row["seconds"].values())
    assert (row["input"], row["output"]) == ("pictures/rgb.png", "pictures/rgb-quantized.png")
    assert row["converged"] is True
    assert row["n_iter"] > 0


def test_a_second_run_does_not_take_the_output_of_the_first_for_input(run: Run, here: Path) -> None:
    arguments = ["quantize", "pictures", "-k", "4", "--out-dir", "pictures/out", "--overwrite", "--json"]
    first, second = run(*arguments), run(*arguments)
    assert first.status == second.status == 0
    assert [row["input"] for row in first.rows] == [row["input"] for row in second.rows]


def test_the_saved_palette_is_that_of_the_output(run: Run, here: Path) -> None:
    assert run("quantize", "pictures/rgba.png", "-k", "5", "-o", "out.png", "--save-palette", "p.json").status == 0
    colors = json.loads(Path("p.json").read_text())["colors"]
    pixels = [tuple(pixel) for pixel in read_image("out.png").reshape(-1, 4).tolist()]
    assert {(*color["rgb"], color["alpha"]): color["share"] for color in colors} == {
        pixel: pixels.count(pixel) / len(pixels) for pixel in set(pixels)
    }


def test_a_person_reads_a_table(run: Run, here: Path) -> None:
    outcome = run("quantize", "pictures/rgb.png", "pictures/few.png", "-k", "7", "--out-dir", "out")
    head, first, second = (line.split() for line in outcome.out.splitlines())
    assert head == ["input", "colors", "k", "energy", "psnr", "before", "after", "seconds", "output"]
    assert (first[0], first[2], first[-1]) == ("pictures/rgb.png", "7", "out/rgb.png")
    assert second[:5] == ["pictures/few.png", "7", "7", "0", "exact"]


@pytest.mark.skipif(sys.platform != "linux", reason="file names of any bytes")
@pytest.mark.parametrize("options", [pytest.param([], marks=pytest.mark.slow), ["--json"]])
def test_a_name_that_is_no_text_is_no_obstacle(here: Path, options: list[str]) -> None:
    Path("pictures/few.png").rename(os.fsdecode(b"a\xff.png"))
    done = process("info", os.fsdecode(b"a\xff.png"), *options, env={**os.environ, "PYTHONIOENCODING": "utf-8:strict"})
    assert (done.returncode, done.stderr) == (0, "")
    assert " 7 " in done.stdout if not options else json.loads(done.stdout)["input"] == "a\udcff.png"


@pytest.mark.skipif(os.name == "nt", reason="POSIX shell")
@pytest.mark.slow
def test_without_stdout_the_work_is_done_all_the_same(here: Path) -> None:
    command = '"$0" -m cvtimg quantize pictures -k 4 --out-dir out >&- 2>&-'
    subprocess.run(["sh", "-c", command, sys.executable], cwd=here, check=True, timeout=60)
    assert len(list(Path("out").iterdir())) == 5


def test_quiet_prints_nothing_but_errors(run: Run, here: Path) -> None:
    outcome = run("quantize", "pictures/rgb.png", "missing.png", "-k", "4", "--out-dir", "out", "--quiet")
    assert (outcome.status, outcome.out) == (1, "")
    assert re.fullmatch(r"cvtimg: .*missing\.png[^\n]+\n", outcome.err)


def test_info_tells_what_is_in_the_file(run: Run, here: Path) -> None:
    rows = {Path(row["input"]).stem: row for row in run("info", "pictures", "--json").rows}
    assert rows["rgba"] == {
        "input": "pictures/rgba.png",
        "width": 32,
        "height": 24,
        "format": "PNG",
        "mode": "RGBA",
        "bands": ["R", "G", "B", "A"],
        "bits": 8,
        "frames": 1,
        "icc": None,
        "geo_transform": None,
        "epsg": None,
        "nodata": None,
        "alpha": True,
        "distinct_colors": n_distinct(RGBA * (RGBA[..., 3:] > 0)),  # what is hidden is one color
        "input_bytes": Path("pictures/rgba.png").stat().st_size,
        "axes": "YX",
        "shape": [],
        "channels": None,
        "pixel_size": None,
    }
    assert (rows["deep"]["bits"], rows["deep"]["bands"]) == (16, ["I"])
    assert rows["few"]["distinct_colors"] == 7


# Bad files


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (RuntimeError("two\nlines"), "RuntimeError: two"),
        (MemoryError(), "needs more memory than there is"),
        (KeyError(), "KeyError"),
        (RecursionError("too deep"), "RecursionError: too deep"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_the_unexpected_is_one_line_too(
    run: Run, here: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, reason: str
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("cvtimg.quantization.quantize_file", fail)
    outcome = run("quantize", "pictures/rgb.png", "-k", "4")
    assert outcome.status == 1
    assert outcome.err == f"cvtimg: pictures/rgb.png: {reason}\n"


# Wrong usage

PICTURE = "pictures/rgb.png"


def test_what_other_programs_call_things_is_understood(run: Run, here: Path) -> None:
    assert run("help") == run("--help")
    for letter in "kn":
        assert run("quantize", PICTURE, f"-{letter}", "4", "-o", f"{letter}.png").status == 0
    assert (here / "k.png").read_bytes() == (here / "n.png").read_bytes()


def test_each_option_is_in_one_panel_of_the_help_and_its_number_has_a_long_name(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    options = [option for verb in COMMANDS for option in options_of(verb)]
    named = " ".join(PANELS.values()).split()
    assert len(named) == len(set(named))
    assert {*named} <= {option.name for option in options}
    assert all(len(option.words) == 2 for option in options if {"-k", "-n"} & {*option.words})
    for verb in ("segment", "sphere"):
        text = run("help", verb).out
        outputs = text.split("\nOutput:\n")[1].split("\n\n")[0]
        for option in options_of(verb):
            if option.words:
                shown = rf"^  (-\S+, )?{option.words[0]}(?![-\w])(?! [a-z]).*"  # no line of the description
                assert len(re.findall(shown, text, re.MULTILINE)) == 1
                assert bool(re.search(shown, outputs, re.MULTILINE)) == (option.name in PANELS["Output"].split())


# Help


@pytest.mark.parametrize(
    "arguments", [[], ["--help"], ["quantize", "--help"], ["cluster", "--help"], ["info", "--help"]]
)
@pytest.mark.parametrize("width", [80, 120])
def test_help_fits_the_terminal(run: Run, monkeypatch: pytest.MonkeyPatch, arguments: list[str], width: int) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    outcome = run(*arguments)
    assert (outcome.status, outcome.err) == (0, "")
    assert max(map(len, outcome.out.splitlines())) <= width


@pytest.mark.parametrize(
    ("choices", "registry"),
    [
        ("quantize effort", cvtimg.engine.EFFORTS),
        ("restore effort", ["auto", *cvtimg.engine.EFFORTS]),
        ("quantize method", cvtimg.engine.METHODS),
        ("quantize init", cvtimg.engine.SEEDINGS),
        ("quantize space", SPACES),
        ("quantize dither", ["none", *DITHERS, "compact"]),
        ("segment edge_mode", EDGE_MODES),
        ("elbow rule", RULES),
        ("restore renormalize", RENORMALIZATIONS),
        ("cluster missing", MISSING),
    ],
)
def test_choices_are_those_of_the_registries(choices: str, registry: Collection[str]) -> None:
    verb, name = choices.split()
    option = next(option for option in options_of(verb) if option.name == name)
    assert isinstance(option.kind, Choice)
    assert sorted(option.kind.names) == sorted(registry)


def test_help_says_what_can_be_written(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    text = " ".join(run("help", "quantize").out.split())
    assert f"at most {MAX_COLORS}" in text
    suffixes = re.findall(r"\.[a-z]+", text.split("can also end in")[1].split("The same seed")[0])
    assert {*suffixes, ".png", ".tiff"} == set(io.lossless_suffixes())


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_h_is_help_and_arguments_read_as_they_are_typed(run: Run, command: str) -> None:
    short, long = (run(*filter(None, [command, flag])) for flag in ("-h", "--help"))
    assert short == long
    assert short.status == 0
    usage = short.out.splitlines()[0]
    arguments = r" [A-Z|]+(\.\.\.)?| \[[A-Z]+\.\.\.\]| COMMAND \[ARGS\]\.\.\."
    assert re.fullmatch(rf"Usage: cvtimg ?{command} \[OPTIONS\]({arguments})?", usage)


@pytest.mark.parametrize("verb", COMMANDS)
def test_help_is_two_screens_that_begin_with_the_usual_calls_and_name_each_option(
    run: Run, monkeypatch: pytest.MonkeyPatch, verb: str
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    text, reading = run(verb, "--help").out, run("help", "reading").out
    assert len(text.splitlines()) <= 48
    calls = re.findall(rf"^  cvtimg {verb} .*", text, re.MULTILINE)
    assert len(calls) == 3 or calls == run("help", verb).out.split("Examples:\n")[1].split("\n\n")[0].splitlines()
    assert text.index(calls[-1]) < min(text.find(f"\n{title}:") % len(text) for title in ("Arguments", "What to get"))
    for option in options_of(verb):
        shared = option.name in PANELS["Reading"].split()
        named = [word.partition("/")[0] in (reading if shared else text) for word in option.words[:1]]
        assert all(named), option.name


def test_the_list_of_commands_cuts_no_summary(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    text = " ".join(run("--help").out.split())
    for name, summary in COMMANDS.items():
        assert f" {name} {summary}" in text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shell", "given", "found"),
    [
        ("bash", {"COMP_WORDS": "cvtimg quantize --dither f", "COMP_CWORD": "3"}, "floyd-steinberg"),
        ("zsh", {"_TYPER_COMPLETE_ARGS": "cvtimg quantize --dither f"}, "floyd-steinberg"),
        ("fish", {"_TYPER_COMPLETE_ARGS": "cvtimg seg", "_TYPER_COMPLETE_FISH_ACTION": "get-args"}, "segment"),
    ],
)
def test_shells_complete_commands_options_and_choices(shell: str, given: dict[str, str], found: str) -> None:
    script = process("--show-completion", shell).stdout
    assert f"_CVTIMG_COMPLETE=complete_{shell}" in script
    completed = process(env={**os.environ, **given, "_CVTIMG_COMPLETE": f"complete_{shell}"})
    assert found in completed.stdout
    assert completed.stderr == ""


def test_completion_is_installed_for_the_shell_that_is_named(tmp_path: Path) -> None:
    done = process("--install-completion", "fish", env={**os.environ, "HOME": str(tmp_path)})
    assert done.returncode == 0
    assert "_CVTIMG_COMPLETE" in (tmp_path / ".config/fish/completions/cvtimg.fish").read_text()


# The process

HEAVY = {"pydantic", "numpy", "PIL", "rich", "cvtimg.pictures.files", "cvtimg.engine.tessellation"}


def modules_of(*arguments: str, cwd: Path) -> set[str]:
    """Return the modules that are imported once a command line is done."""
    script = "import sys; from cvtimg.cli.app import main; status = main(sys.argv[1:])"
    script += "; print(*sys.modules, file=sys.stderr); sys.exit(status)"
    command = [sys.executable, "-P", "-c", script, *arguments]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=True, timeout=60)
    return set(done.stderr.split())


@pytest.mark.parametrize("arguments", [["--help"], ["cluster", "--help"]])
def test_help_imports_nothing_heavy(here: Path, arguments: list[str]) -> None:
    needs_command = len(arguments) > 1
    assert not modules_of(*arguments, cwd=here) & (HEAVY if needs_command else {*HEAVY, "typer", "cvtimg.batch"})


def test_quantize_imports_no_more_than_it_needs(here: Path) -> None:
    modules = modules_of("quantize", PICTURE, "-k", "4", "--quiet", cwd=here)
    assert "numpy" in modules
    foreign = {"rich", "pydantic", "scipy", "sklearn", "skimage", "matplotlib", "html"}
    own = {"plotting.sheets", "cli.segment_command", "engine.all_counts", "engine.block_descent", "palettes.files"}
    assert not modules & {*foreign, *(f"cvtimg.{name}" for name in own)}


def test_no_garbage_is_sought_in_what_was_imported(here: Path) -> None:
    script = "import gc; from cvtimg.cli.app import main; main(); print(gc.isenabled(), gc.get_freeze_count() > 10_000)"
    command = [sys.executable, "-P", "-c", script, "quantize", PICTURE, "-k", "4", "--quiet"]
    assert subprocess.run(command, cwd=here, capture_output=True, text=True, check=True).stdout == "True True\n"


@pytest.mark.skipif(os.name == "nt", reason="POSIX pipes")
@pytest.mark.parametrize(
    "arguments",
    [["--help"], pytest.param(["quantize", "pictures/rgb.png", "-k", "4", "-o", "-"], marks=pytest.mark.slow)],
)
def test_a_reader_that_leaves_early_is_no_reason_to_complain(here: Path, arguments: list[str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-P", "-m", "cvtimg", *arguments]
    with os.fdopen(writer, "w") as out:
        done = subprocess.run(command, cwd=here, stdout=out, stderr=subprocess.PIPE, text=True, check=False, timeout=60)
    assert done.stderr == ""
    assert done.returncode == 1


@pytest.mark.skipif(os.name == "nt", reason="POSIX terminals")
@pytest.mark.parametrize(
    ("patience", "named"),
    [(0, "pictures"), pytest.param(0, "pictures/rgb.png", marks=pytest.mark.slow), (600, "pictures")],
)
def test_a_bar_is_drawn_on_a_terminal_once_it_takes_long_and_json_stays_clean(
    patience: int, named: str, here: Path
) -> None:
    import pty

    terminal, stderr = pty.openpty()
    script = f"from cvtimg.batch import report; report._LONG = {patience}; from cvtimg.cli.app import main; main()"
    command = [sys.executable, "-P", "-c", script, "quantize", named, "-k", "4", "--out-dir", "out", "--json"]
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "80"}
    done = subprocess.run(
        command, cwd=here, stdout=subprocess.PIPE, stderr=stderr, text=True, check=True, timeout=60, env=environment
    )
    os.close(stderr)
    drawn = b""
    with suppress(OSError):  # the end of a terminal
        while part := os.read(terminal, 1 << 16):
            drawn += part
    os.close(terminal)
    assert (b"100%" in drawn) == (patience == 0)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [[name for name in row if name != "warning"] for row in rows] == [KEYS] * (5 if named == "pictures" else 1)


# Tables

TABLE_KEYS = ["input", "output", "rows", "left_out", "columns", "k", "elbow", "energy", "explained", "n_iter"]
TABLE_KEYS += ["converged", "input_bytes", "output_bytes", "seconds"]
#: Three groups far from each other, in two columns of which one is a thousand times the other.
ROWS = np.array([[0, 0], [0, 2000], [90, 0]])[RNG.integers(0, 3, 40)] + RNG.normal(size=(40, 2)) * [1, 20]
COUNTS = RNG.integers(1, 5, 40)


@pytest.fixture
def table(here: Path) -> Path:
    """Write a table with names, texts and counts; work in its folder."""
    lines = [f"S{n},{x!r},{y!r},{count}" for n, ((x, y), count) in enumerate(zip(ROWS.tolist(), COUNTS, strict=True))]
    Path("trees.csv").write_text("\n".join(["site,height,girth,count", *lines, ""]))
    return Path("trees.csv")


def labels_of(path: str | Path) -> list[int]:
    with Path(path).open(newline="") as file:
        return [int(list(row.values())[-1]) for row in csv.DictReader(file)]


def test_cluster_writes_what_tessellate_finds(run: Run, table: Path) -> None:
    options = ["--columns", "height,girth", "--weight", "count", "--generators", "means.csv", "--json"]
    outcome = run("cluster", table, "-k", "3", *options)
    assert (outcome.status, outcome.err) == (0, "")
    (row,) = outcome.rows
    assert list(row) == TABLE_KEYS
    expected = cvtimg.tessellate(ROWS, 3, density=COUNTS)
    assert labels_of("trees-clusters.csv") == expected.labels.tolist()
    kept = [line.rpartition(",")[0] for line in Path("trees-clusters.csv").read_text().splitlines()]
    assert kept == table.read_text().splitlines()
    means = read_table("means.csv")
    assert means.names == ("height", "girth", "mass", "share")
    shares = np.column_stack([expected.masses, expected.masses / COUNTS.sum()])
    np.testing.assert_array_equal(means.rows, np.column_stack([expected.generators, shares]))
    assert (row["input"], row["output"], row["columns"]) == ("trees.csv", "trees-clusters.csv", ["height", "girth"])
    assert (row["rows"], row["left_out"], row["k"], row["converged"]) == (40, 0, 3, True)
    assert row["energy"] == pytest.approx(expected.energy)
    total = cvtimg.tessellate(ROWS, 1, density=COUNTS).energy
    assert row["explained"] == pytest.approx(1 - expected.energy / total)
    assert list(row["seconds"]) == ["read", "cluster", "write"]


def test_standardized_columns_count_alike_and_generators_keep_their_units(run: Run, table: Path) -> None:
    options = ["-k", "3", "--columns", "height,girth", "--weight", "count", "--generators", "means.csv"]
    assert run("cluster", table, *options, "--standardize").status == 0
    labels, means = np.array(labels_of("trees-clusters.csv")), read_table("means.csv").rows
    groups = (ROWS[:, 0] > 45) * 2 + (ROWS[:, 1] > 1000)  # as they were made; without --standardize girth alone counts
    assert len(set(zip(labels, groups, strict=True))) == 3
    for label in range(3):
        mean = np.average(ROWS[labels == label], axis=0, weights=COUNTS[labels == label])
        np.testing.assert_allclose(means[label, :2], mean, rtol=1e-5, atol=1e-3)


def test_dropped_rows_keep_their_columns_and_labels_can_stand_alone(run: Run, here: Path) -> None:
    Path("a.csv").write_text('who;"a; b";cluster\nA;1;7\nB;;8\nC;9;9\n')
    given = ["--columns", "a; b", "--missing", "drop", "--standardize", "--quiet"]
    assert run("cluster", "a.csv", "-k", "2", *given).status == 0
    head, *rows = csv.reader(Path("a-clusters.csv").read_text().splitlines())
    assert head == ["who", "a; b", "cluster", "cell_cluster"]
    assert [row[:3] for row in rows] == [["A", "1", "7"], ["B", "", "8"], ["C", "9", "9"]]
    assert ([row[3] == "" for row in rows], {rows[0][3], rows[2][3]}) == ([False, True, False], {"0", "1"})
    assert run("cluster", "a.csv", "-k", "2", *given, "--labels-only").status == 0
    assert Path("a-labels.csv").read_text().splitlines() == ["label", rows[0][3], '""', rows[2][3]]
    np.save("b.npy", [[1, 2.5], [3, 4]])
    assert run("cluster", "b.npy", "-k", "1", "--quiet").status == 0
    assert Path("b-clusters.csv").read_text().splitlines() == ["col0,col1,cluster", "1.0,2.5,0", "3.0,4.0,0"]


@pytest.mark.parametrize("columns", ["height", "height,girth,count"])
def test_clusters_are_drawn_on_the_first_two_principal_axes(run: Run, table: Path, columns: str) -> None:
    pytest.importorskip("matplotlib")
    assert run("cluster", table, "-k", "3", "--columns", columns, "--plot", "a.svg").status == 0
    assert re.search(r"first principal axis, \d+% of the variance", Path("a.svg").read_text())


def test_a_column_whose_name_has_a_comma_is_named_in_quotes(run: Run, here: Path) -> None:
    Path("a.csv").write_text('"x, m",y\n1,2\n3,4\n')
    (row,) = run("cluster", "a.csv", "-k", "1", "--columns", '"x, m"', "--json").rows
    assert row["columns"] == ["x, m"]


def test_equal_rows_are_all_explained_by_one_generator(run: Run, here: Path) -> None:
    Path("a.csv").write_text("1,2\n1,2\n")
    (row,) = run("cluster", "a.csv", "-k", "1", "--standardize", "--json").rows
    assert (row["energy"], row["explained"]) == (0, 1)


def test_cluster_imports_nothing_for_pictures(table: Path) -> None:
    modules = modules_of("cluster", "trees.csv", "-k", "3", "--columns", "height", "--quiet", cwd=Path.cwd())
    assert "numpy" in modules
    assert not modules & {"PIL", "rich", "scipy", "sklearn", "pandas", "cvtimg.pictures.files"}


# The launcher in a checkout


@pytest.mark.skipif(not (ROOT / "cli.py").exists(), reason="not in a checkout")
def test_the_launcher_uses_the_installed_package_from_anywhere(here: Path) -> None:
    for folder in (here, ROOT):
        command = [sys.executable, str(ROOT / "cli.py"), "--version"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=60)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.startswith("cvtimg ")


@pytest.mark.skipif(not (ROOT / "cli.py").exists(), reason="not in a checkout")
def test_the_launcher_says_how_to_install_in_one_line(here: Path) -> None:
    command = [sys.executable, "-S", str(ROOT / "cli.py"), "--version"]  # -S: no installed packages
    done = subprocess.run(command, cwd=here, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 1
    assert re.fullmatch(r"cli\.py: cvtimg is not installed .*pip install \.`\n", done.stderr)
