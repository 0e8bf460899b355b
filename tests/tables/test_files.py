"""Tables are read as they are meant, and what is wrong in them is named with its place."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cvtimg._shared.types import Array
from cvtimg.blocks import Spread
from cvtimg.tables import Dialect, find_tables, read_table, write_generators, write_row_labels
from cvtimg.tables.files import Table

RNG = np.random.default_rng(5)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "table.csv"


def read(file: Path, text: str | bytes, **options: Any) -> Table:
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(file, **options)


# Text that is read


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ('"a"," b "\n"1","2"\n3,4\n', ("a", "b")),
        ('"a, or ""A""";b\n1;2\n3;4\n', ('a, or "A"', "b")),
        ('"a\nand more",b\n1,2\n3,4\n', ("a\nand more", "b")),
        ("\n\na,b\n\n1,2\n3,4\n\n", ("a", "b")),
        ("größe,b\n1e0,2.\n+3,4.0e+00\n", ("größe", "b")),
        (",b\n1,2\n3,4\n", ("col0", "b")),
        ("1,2\n3,4\n", ("col0", "col1")),
        ("1;2\n3;4\n", ("col0", "col1")),
        ("year,2000\n1,2\n3,4\n", ("year", "2000")),
        # Titles, units and sources.
        ("Trees of 2024\n\na,b\nm,kg\n1,2\n3,4\n\nSource: us\nand them\n", ("a", "b")),
        ("Trees of 2024,\na,b\n,kg\n1,2\n3,4\nSource: us,\n", ("a", "b")),
    ],
)
def test_text_is_read_with_any_delimiter_quotes_and_header(file: Path, text: str, names: tuple[str, ...]) -> None:
    table = read(file, text)
    assert table.names == names
    assert table.rows.tolist() == [[1, 2], [3, 4]]
    assert (table.weights, table.kept.tolist()) == (None, [True, True])


@pytest.mark.parametrize(
    ("text", "options", "names", "rows"),
    [
        ("a\n1\n2\n", {}, "a", [[1], [2]]),
        ('"a"\n"1"\n2', {}, "a", [[1], [2]]),
        ("1\n2\n", {}, "col0", [[1], [2]]),
        # A first row with a missing value is no header, but a name above one is.
        (",1\n2,3\n", {"missing": "drop"}, "col0 col1", [[2, 3]]),
        ("a,2000\n,1\n2,3\n", {"missing": "drop"}, "a 2000", [[2, 3]]),
        ("A,1\nB,2\n", {"columns": ["col1"]}, "col1", [[1], [2]]),
        ("id,a,b,c\nx,1,2,3\ny,4,5,6\n", {"columns": ["c", "a"]}, "c a", [[3, 1], [6, 4]]),
        ("1,2,3\n4,5,6\n", {"columns": ["2", "col0"]}, "col2 col0", [[3, 1], [6, 4]]),
    ],
)
def test_headers_and_columns_are_told(file: Path, text: str, options: Any, names: str, rows: list[Any]) -> None:
    table = read(file, text, **options)
    assert (table.names, table.rows.tolist()) == (tuple(names.split()), rows)


def test_long_tables_are_read_in_order_like_numpy_reads_them(file: Path) -> None:
    rows = RNG.normal(size=(5000, 3))
    np.savetxt(file, rows, delimiter=",", header="x,y,z")
    np.testing.assert_array_equal(read_table(file).rows, np.loadtxt(file, delimiter=","))


# Columns


def test_the_weight_is_no_coordinate(file: Path) -> None:
    table = read(file, "a,n,b\n1,2,3\n4,0,6\n", weight="n")
    assert (table.names, table.rows.tolist()) == (("a", "b"), [[1, 3], [4, 6]])
    assert table.weights is not None
    assert table.weights.tolist() == [2, 0]
    assert table.rows.flags.c_contiguous


# Missing values


@pytest.mark.parametrize("nothing", ["", " ", '""', "NA", "n/a", "#N/A", "NaN", "-nan", "null", "None"])
def test_missing_values_are_an_error_or_left_out(file: Path, nothing: str) -> None:
    text = f"a,b\n1,2\n3,{nothing}\n5,6\n"
    with pytest.raises(
        ValueError, match=r"table\.csv: line 3, column 'b': the value is missing; leave .*missing='drop'"
    ):
        read(file, text)
    table = read(file, text, missing="drop")
    assert table.rows.tolist() == [[1, 2], [5, 6]]
    assert table.kept.tolist() == [True, False, True]


def test_a_row_without_a_weight_is_left_out_and_one_that_lacks_what_is_not_read_is_not(file: Path) -> None:
    table = read(file, "a,b,n\n1,,2\n2,3,\n3,4,1\n", columns=["a"], weight="n", missing="drop")
    assert (table.rows.tolist(), table.kept.tolist()) == ([[1], [3]], [True, False, True])


# What is wrong is named


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("", {}, "is empty"),
        ("\n\n", {}, "is empty"),
        ("a,b\n", {}, "has no rows"),
        ("a,b\n1,2\n3\n", {}, "line 3 has 1 values, and the first line 2"),
        ("a,b\n1,2\n3,4,5\n", {}, "line 3 has 3 values, and the first line 2"),
        ("a,b\n1,2\nnote\n5,6\n", {}, "line 3 has 1 values, and the first line 2"),
        ("a,b\n1,2\n\n3,x\n", {}, "line 4, column 'b': 'x' is not a number$"),
        ('"a\n\n",b\n1,2\n3,x\n', {}, "line 5, column 'b': 'x' is not a number$"),
        ("1,2\n3,x\n", {}, "line 2, column 'col1': 'x' is not a number$"),
        ("a,b\n1,2\n" + "3,4\n" * 3000 + "5,x\n", {}, "line 3003, column 'b': 'x' is not a number$"),
        ("id,a,b\nx,1,2\n", {"columns": ["id"]}, r"line 2, column 'id': 'x' is not a number$"),
        ("id,day\nx,2024-01-02\n", {}, r"has no column of numbers \(id: text; day: dates\)$"),
        ("a;b\n1.5;2\n1,5;2\n", {"dialect": Dialect(decimal=".")}, "line 3, column 'a': '1,5' is not a number$"),
        ("a\n1\n" + "x" * 99, {}, "line 3, column 'a': 'x{36}...' is not a number"),
        ("a,b\n1,2\ninf,4\n", {}, "line 3, column 'a': the value is infinite"),
        ("a,n\n1,2\n3,-4\n", {"weight": "n"}, "line 3, column 'n': the value is a weight and must be >= 0"),
        ("a,n\n1,0\n3,0\n", {"weight": "n"}, "column 'n': the weights must not all be 0"),
        ("a,b\n1,2\n", {"weight": "n"}, "column 'n' must be one of a, b"),
        ("a,b\n1,2\n", {"columns": ["c"]}, "column 'c' must be one of a, b"),
        ("a,b\n1,2\n", {"columns": ["0"]}, "column '0' must be one of a, b"),
        ("a,b\n1,2\n", {"columns": ["a", "a"]}, "column 'a' is named more than once"),
        (
            "a,b\n1,2\n",
            {"columns": ["b"], "weight": "b"},
            "column 'b' is the weight, and cannot be read as a value too",
        ),
        ("a\n1\n", {"weight": "a"}, "has no column of numbers"),
        ("a,b\n,2\n1,\n", {"missing": "drop"}, "has no row without a missing value"),
        (b"\x89PNG\r\n\x1a\n\0\0", {}, "is not text; for images there is cvtimg segment"),
        ("a,b\n1,2\n" + "9" * 200_000 + ",3\n", {}, "is not a table"),
    ],
)
def test_what_is_wrong_in_text_is_named_with_its_place(
    file: Path, text: str | bytes, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(str(file))}: .*{message}") as caught:
        read(file, text, **options)
    assert "\n" not in str(caught.value)


def test_another_way_with_missing_values_is_refused(file: Path) -> None:
    with pytest.raises(ValueError, match="missing='guess' must be one of error, drop"):
        read(file, "a\n1\n", missing="guess")


# Arrays


@pytest.mark.parametrize("kind", ["?", "u1", "<i4", ">i8", "<f4", ">f8"])
def test_arrays_of_any_numbers_are_read(tmp_path: Path, kind: str) -> None:
    np.save(tmp_path / "one.npy", [1.5, 2.5])
    assert read_table(tmp_path / "one.npy").rows.tolist() == [[1.5], [2.5]]
    rows = np.array([[0, 1, 1], [1, 0, 1]], kind)
    np.save(tmp_path / "a.npy", rows)
    table = read_table(tmp_path / "a.npy", columns=["col2", "0"])
    assert (table.names, table.rows.tolist(), table.rows.dtype) == (("col2", "col0"), [[1, 0], [1, 1]], np.float64)


def test_structured_arrays_are_read_by_name(tmp_path: Path) -> None:
    rows = np.array([("x", 1, 2.5, 3), ("y", 4, np.nan, 6)], [("id", "U2"), ("a", "u1"), ("b", "f4"), ("n", "i8")])
    np.save(tmp_path / "a.npy", rows)
    table = read_table(tmp_path / "a.npy", columns=["b", "a"], weight="n", missing="drop")
    assert (table.names, table.rows.tolist()) == (("b", "a"), [[2.5, 1]])
    with pytest.raises(ValueError, match="column 'id' of type <U2 is not of numbers"):
        read_table(tmp_path / "a.npy", columns=["id"])
    assert read_table(tmp_path / "a.npy", missing="drop").left_out == {"id": "text"}


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((2, 2, 2)), r"array of shape \(2, 2, 2\) must be"),
        (np.float64(3), r"array of shape \(\) must be"),
        (np.zeros((0, 3)), "has no rows"),
        (np.zeros((3, 0)), "has no column of numbers"),
        (np.array([[1j]]), "column 'col0' of type complex128 is not of numbers"),
        (np.array([["x"]]), "column 'col0' of type <U1 is not of numbers"),
        (np.zeros(2, [("a", "f8", 2)]), r"no column of numbers \(a: arrays\)"),
        (np.array([[1, 2], [3, np.nan]]), r"row 1 \(from 0\), column 'col1': the value is missing"),
    ],
)
def test_what_is_wrong_in_an_array_is_named(tmp_path: Path, array: Array, message: str) -> None:
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(ValueError, match=message):
        read_table(tmp_path / "a.npy")


@pytest.mark.parametrize("kind", ["objects", "archive", 0, 5, 60, 200])
def test_what_is_no_whole_array_of_numbers_is_named(tmp_path: Path, kind: str | int) -> None:
    file = tmp_path / "a.npy"
    if kind == "objects":
        np.save(file, np.array([{}], object), allow_pickle=True)
    elif kind == "archive":
        np.savez(tmp_path / "a.npz", x=[1])
        (tmp_path / "a.npz").rename(file)
    else:
        np.save(file, RNG.normal(size=(20, 3)))
        file.write_bytes(file.read_bytes()[: int(kind)])
    with pytest.raises(ValueError, match=r"is not a complete \.npy file of numbers"):
        read_table(file)


# Scaling


@pytest.mark.parametrize("weights", [None, np.array([1, 0, 3, 2, 5.0])])
def test_standardized_columns_have_mean_0_and_variance_1_and_go_back(weights: Array | None) -> None:
    rows = RNG.normal(size=(5, 3)) * [1, 1e-3, 1e6] + [5, 0, 1e7]
    scaling = Spread.of(rows, weights).scaling
    standardized = scaling.apply(rows)
    np.testing.assert_allclose(np.average(standardized, axis=0, weights=weights), 0, atol=1e-9)
    np.testing.assert_allclose(np.average(standardized**2, axis=0, weights=weights), 1)
    np.testing.assert_allclose(scaling.undo(standardized), rows)


@pytest.mark.parametrize("weights", [None, np.array([1, 1, 1, 0.0])])
def test_a_constant_column_becomes_0_not_noise(weights: Array | None) -> None:
    rows = np.full((4, 1), 0.1)
    np.testing.assert_allclose(Spread.of(rows, weights).scaling.apply(rows), 0, atol=1e-15)


def test_the_energy_about_the_mean_is_the_energy_of_one_generator() -> None:
    assert Spread.of(np.array([[0.0, 0], [0, 2], [4, 1]]), np.array([1, 1, 2.0])).energy() == 18
    assert Spread.of(np.array([[1.0], [3.0]])).energy() == 2


# Writing


def test_labels_stand_in_the_rows_of_the_table(tmp_path: Path) -> None:
    labels, kept = np.array([1, 0], np.int32), np.array([True, False, True])
    write_row_labels(tmp_path / "l.csv", labels, kept)
    write_row_labels(tmp_path / "l.npy", labels, kept)
    assert (tmp_path / "l.csv").read_text() == 'label\n1\n""\n0\n'
    array = np.load(tmp_path / "l.npy")
    assert (array.tolist(), array.dtype) == ([1, -1, 0], np.int32)
    assert read_table(tmp_path / "l.csv", missing="drop").kept.tolist() == kept.tolist()
    with pytest.raises(FileExistsError):
        write_row_labels(tmp_path / "l.csv", labels, kept)
    with pytest.raises(ValueError, match=r"suffix='\.txt' must be one of \.csv, \.npy"):
        write_row_labels(tmp_path / "l.txt", labels, kept)


def test_generators_are_written_with_names_and_masses_and_read_again(tmp_path: Path) -> None:
    generators = np.array([[0.1, 1e-30], [2 / 3, 5]])
    write_generators(tmp_path / "g.csv", ["a, b", "mass"], generators, np.array([1, 3.0]))
    table = read_table(tmp_path / "g.csv")
    assert table.names == ("a, b", "mass", "cell_mass", "share")
    np.testing.assert_array_equal(table.rows, np.column_stack([generators, [1, 3], [0.25, 0.75]]))


# Folders


def test_a_folder_stands_for_the_tables_in_it(tmp_path: Path) -> None:
    for name in ("b.csv", "a.tsv", "notes.txt", "below/c.npy", ".hidden/d.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "empty").mkdir()
    found = [path.relative_to(tmp_path).as_posix() for path in find_tables(tmp_path)]
    assert found == ["a.tsv", "b.csv", "below/c.npy"]
    assert find_tables(f"{tmp_path}/*.txt") == find_tables(tmp_path / "notes.txt") == [tmp_path / "notes.txt"]
    with pytest.raises(FileNotFoundError, match=r"no table \(\.csv, \.tsv, \.npy, .*\) in this folder"):
        find_tables(tmp_path / "empty")


@pytest.mark.parametrize(("row", "is_read"), [(700, True), (1500, False)])
def test_a_thousand_rows_tell_how_numbers_are_written(file: Path, row: int, is_read: bool) -> None:
    text = "a;b\n" + "1;2\n" * row + "1,5;2\n" + "1;2\n" * 600
    if is_read:
        assert read(file, text).rows[row, 0] == 1.5
        return
    with pytest.raises(ValueError, match="'1,5' is not a number"):
        read(file, text)


@pytest.mark.parametrize(("n_rows", "is_left_out"), [(8, False), (14, True)])
def test_a_column_counts_rows_if_there_are_ten(file: Path, n_rows: int, is_left_out: bool) -> None:
    text = "n,v\n" + "".join(f"{n},{n * 7 % 5 + 0.5}\n" for n in range(n_rows))
    assert ("n" in read(file, text).left_out) == is_left_out
