from relations.table import table, written


def test_the_page_shows_all_relations() -> None:
    assert written() == table(), "python tests/relations/table.py writes it"
