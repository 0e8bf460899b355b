from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cvtimg.files import csv_text, write_csv

TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\r\0"))
ROWS = st.integers(1, 4).flatmap(lambda n: st.lists(st.lists(TEXT, min_size=n, max_size=n), min_size=1))


@given(ROWS)
def test_any_text_comes_back_from_a_table(rows: list[list[str]]) -> None:
    names = [f"column {number}" for number in range(len(rows[0]))]
    assert list(csv.reader(StringIO(csv_text(names, rows), newline=""))) == [names, *rows]


def test_a_table_replaces_no_file_unless_asked(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    write_csv(path, ["k", "energy"], [[1, 0.1], [2, None]])
    assert path.read_text() == "k,energy\n1,0.1\n2,\n"
    with pytest.raises(FileExistsError, match=r"a\.csv"):
        write_csv(path, ["k"], [[1]])
    write_csv(path, ["name"], [["a\udcff.png"]], overwrite=True)
    assert path.read_bytes() == b"name\na\xff.png\n"
