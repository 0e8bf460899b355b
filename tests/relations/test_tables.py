"""What must not change when a table comes in another container, another notation, or in another order of columns."""

import bz2
import gzip
import lzma
import tempfile
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from relations.relation import Relation, close, equal, quick_and_wide
from relations.remembering import beside

import cvtimg
from cvtimg._shared.types import Array
from cvtimg.designs.factors import Factor, read_factors, read_runs
from cvtimg.tables import Dialect, read_table

Rows = Array
NAMES = ["height", "girth", "größe"]


def rows_of(rng: np.random.Generator) -> Rows:
    """Return two clusters of 20 rows, among them numbers of thousands."""
    return np.concatenate([rng.normal(0, 1, (20, 3)), rng.normal(4000, 900, (20, 3))]).round(3)


def text(rows: Rows, delimiter: str = ",", write: Callable[[float], str] = str, head: str | None = None) -> str:
    names = delimiter.join(NAMES) if head is None else head
    return names + "\n" * bool(names) + "".join(delimiter.join(map(write, row)) + "\n" for row in rows.tolist())


def zipped(content: bytes) -> bytes:
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("table.csv", content)
    return packed.getvalue()


def german(value: float) -> str:
    """Write a number with a decimal comma, and points between thousands."""
    return f"{value:,.3f}".translate(str.maketrans(",.", ".,"))


#: The content of a file with the rows, by what is odd about it.
FORMS: dict[str, Callable[[Rows], str | bytes]] = {
    "semicolons": lambda rows: text(rows, ";"),
    "tabs": lambda rows: text(rows, "\t"),
    "bars": lambda rows: text(rows, "|"),
    "spaces": lambda rows: text(rows, "   "),
    "spaces around": lambda rows: text(rows, " , "),
    "a decimal comma": lambda rows: text(rows, ";", lambda value: str(value).replace(".", ",")),
    "a decimal comma and points": lambda rows: text(rows, ";", german),
    "thousands in quotes": lambda rows: text(rows, ",", lambda value: f'"{value:,.3f}"'),
    "a minus of typesetters": lambda rows: text(rows).replace("-", "\u2212"),
    "apostrophes": lambda rows: text(rows, ",", lambda value: f"{value:,.3f}".replace(",", "'")),
    "exponents": lambda rows: text(rows, ",", lambda value: f"{value:.12e}"),
    "a byte order mark": lambda rows: "\ufeff" + text(rows),
    "UTF-16": lambda rows: text(rows).encode("utf-16"),
    "UTF-16 without a mark": lambda rows: text(rows).encode("utf-16-le"),
    "Windows-1252": lambda rows: text(rows, ";").encode("cp1252"),
    "ends of lines of Windows": lambda rows: text(rows).replace("\n", "\r\n"),
    "a line of Excel": lambda rows: "sep=;\n" + text(rows, ";"),
    "comments": lambda rows: "# made by hand\n# 3 columns, 40 rows\n" + text(rows) + "# the end\n",
    "names in a comment": lambda rows: "# " + text(rows),
    "names in a comment, spaces": lambda rows: "# " + text(rows, " "),
    "a delimiter at each end": lambda rows: text(rows).replace("\n", ",\n"),
    "a delimiter at the ends below the names": lambda rows: text(rows).replace("\n", ",\n").replace(",\n", "\n", 1),
    "an index of pandas": lambda rows: labeled(text(rows), "", str),
    "a column of text": lambda rows: labeled(text(rows), "site", lambda number: f"place {number}"),
    "a column of dates": lambda rows: labeled(text(rows), "day", lambda number: f"2024-03-{number % 28 + 1:02}"),
    "a column of truths": lambda rows: labeled(text(rows), "wild", lambda number: str(number % 3 == 0)),
    "identifiers": lambda rows: labeled(text(rows), "id", lambda number: str(1000 + 7 * number)),
    "an empty column": lambda rows: labeled(text(rows), "notes", lambda _: ""),
    "gzip": lambda rows: gzip.compress(text(rows).encode()),
    "bzip2": lambda rows: bz2.compress(text(rows).encode()),
    "xz": lambda rows: lzma.compress(text(rows).encode()),
    "zip": lambda rows: zipped(text(rows).encode()),
}
FORMS["names of rows of R"] = lambda rows: "".join(
    line + "\n" if number == 0 else f'"tree {number}",{line}\n' for number, line in enumerate(text(rows).splitlines())
)


def labeled(table: str, name: str, label: Callable[[int], str]) -> str:
    """Put a column first."""
    head, *lines = table.splitlines()
    return f"{name},{head}\n" + "".join(f"{label(number)},{line}\n" for number, line in enumerate(lines))


def read(content: str | bytes, suffix: str = ".csv", **how: Any) -> Rows:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"table{suffix}")
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return read_table(path, **how).rows


def frames() -> dict[str, Callable[[Rows], Any]]:
    """Return what makes data frames; those of polars are skipped where it is not installed."""
    pandas = pytest.importorskip("pandas")
    return {
        "pandas": lambda rows: pandas.DataFrame(rows, columns=NAMES),
        "nullable": lambda rows: pandas.DataFrame(rows, columns=NAMES).convert_dtypes(),
        "of Arrow": lambda rows: pandas.DataFrame(rows, columns=NAMES).convert_dtypes(dtype_backend="pyarrow"),
        "mixed": lambda rows: pandas.DataFrame(
            {"a": rows[:, 0], "b": pandas.array(rows[:, 1], "Float64"), "c": rows[:, 2]}
        ),
        "polars": lambda rows: pytest.importorskip("polars").DataFrame(rows, schema=NAMES),
    }


SINCE = "2026-11-27"


def energy(rows: Any) -> float:
    return cvtimg.tessellate(rows, 4).energy


def curve(rows: Any) -> Rows:
    return cvtimg.energy_curve(rows, 6).energies


def taken(rows: Any) -> Rows:
    bounds = [Factor(name, -1e4, 1e4) for name in NAMES]
    return cvtimg.design(2, bounds, existing=rows, effort="fast").existing


def table_of(rng: np.random.Generator) -> str:
    return text(rows_of(rng))


def any_numbers(rng: np.random.Generator) -> Rows:
    return rng.normal(size=(40, 3)) * 10.0 ** rng.integers(-300, 300, (40, 3))


def read_back(rows: Rows) -> Rows:
    return read(text(rows, "\t"))


def by_name(content: str) -> Rows:
    return read(content, columns=NAMES)


def turned(content: str) -> str:
    return text(read(content)[:, ::-1], head=",".join(NAMES[::-1]))


def written(form: Callable[[Rows], str | bytes]) -> Callable[[str], str | bytes]:
    return lambda content: form(read(content))


RELATIONS = [
    *(Relation("read_table", form, table_of, read, written(make), equal, SINCE) for form, make in FORMS.items()),
    beside("read_table", "all digits", any_numbers, lambda rows: rows, read_back, since=SINCE),
    Relation("read_table", "columns by name, in another order", table_of, by_name, turned, equal, SINCE),
    Relation("tessellate", "columns in another order", rows_of, energy, lambda rows: rows[:, ::-1], close(1e-9), SINCE),
    *(Relation("tessellate", f"{name} frame", rows_of, energy, make, equal, SINCE) for name, make in frames().items()),
    *(Relation("energy_curve", f"{name} frame", rows_of, curve, make, equal, SINCE) for name, make in frames().items()),
    *(Relation("design", f"{name} frame", rows_of, taken, make, equal, SINCE) for name, make in frames().items()),
]
test_a_result_follows_its_input, test_a_result_follows_any_input = quick_and_wide(RELATIONS)


def test_years_are_names_where_the_numbers_below_are_unlike_them() -> None:
    years = text(rows_of(np.random.default_rng(0)), head="2020,2021,2022")
    assert read(years).shape == (40, 3)
    assert read(years, dialect=Dialect(header=False)).shape == (41, 3)
    whole = "".join(f"{number},{number * number}\n" for number in range(40))
    assert len(read(whole)) == 40
    assert len(read(whole, dialect=Dialect(header=True))) == 39


def test_options_say_what_a_table_does_not(tmp_path: Path) -> None:
    assert read("a;b\n1,234;2,5\n", dialect=Dialect(decimal=",")).tolist() == [[1.234, 2.5]]
    assert read("a;b\n1,234;2\n3;4\n", dialect=Dialect(decimal=".")).tolist() == [[1234, 2], [3, 4]]
    assert read("a b;c\n1 2;3\n", dialect=Dialect(delimiter=";"), columns=["c"]).tolist() == [[3]]
    assert read("a\n1,5\n-2,25\n").tolist() == [[1.5], [-2.25]]
    marks = Dialect(missing_values=("-999",))
    assert read("a,b\n1,2\n-999,3\n", dialect=marks, missing="drop").tolist() == [[1, 2]]
    assert read("a,größe\n1,2\n".encode("cp437"), dialect=Dialect(encoding="cp437")).tolist() == [[1, 2]]
    with pytest.raises(ValueError, match="encoding='latin-99' must be the name of one"):
        read("a\n1\n", dialect=Dialect(encoding="latin-99"))


def test_what_is_left_out_is_told_and_can_be_chosen(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("nr,a,day,name\n" + "".join(f"{n},{n % 7},2024-01-{n:02},x\n" for n in range(1, 21)))
    table = read_table(path)
    assert table.names == ("a",)
    assert table.left_out == {"nr": "it counts the rows", "day": "dates", "name": "text"}
    assert read_table(path, columns=["nr", "a"]).left_out == {}


@pytest.mark.parametrize("write", [lambda value: str(value), lambda value: str(value).replace(".", ",")])
def test_factors_and_runs_are_read_as_tables_are(write: Callable[[float], str], tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_text(f"name;low;high;levels\nspeed;{write(0.5)};{write(2.5)};\nalloy;;;A|B\n")
    factors = read_factors(tmp_path / "b.csv")
    assert (factors[0].low, factors[0].high, factors[1].levels) == (0.5, 2.5, ("A", "B"))
    (tmp_path / "r.csv").write_text(f"alloy;speed\nA;{write(1.25)}\nB;{write(0.75)}\n")
    assert read_runs(tmp_path / "r.csv", factors).tolist() == [[1.25, 0.25], [0.75, 0.75]]


@pytest.mark.parametrize("suffix", [".feather", ".parquet", ".xlsx"])
def test_a_table_in_another_container_is_the_same(suffix: str, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    rows = rows_of(np.random.default_rng(2))
    frame = pandas.DataFrame(rows, columns=NAMES).assign(site=[f"place {number}" for number in range(40)])
    path = tmp_path / f"t{suffix}"
    if suffix == ".xlsx":
        pytest.importorskip("openpyxl")
        frame.to_excel(path, index=False)
    else:
        pytest.importorskip("pyarrow")
        getattr(frame, f"to_{suffix[1:]}")(path)
    table = read_table(path)
    np.testing.assert_array_equal(table.rows, rows)
    assert table.left_out == {"site": "text"}
