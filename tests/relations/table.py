"""The table of all relations, as docs/reliability.md shows it; run by itself, this writes it there."""

import re
import sys
from collections import defaultdict
from importlib import import_module
from pathlib import Path

HERE = Path(__file__).parent
PAGE = HERE.parents[1] / "docs" / "reliability.md"
#: What stands around the table in the page.
BEGIN, END = "<!-- relations -->\n", "<!-- end of relations -->\n"


def table() -> str:
    """Return all relations in Markdown: a row for each verb and date, with how its input is changed since then."""
    from relations.relation import QUICK, WIDE  # which the path has been set for

    rows: dict[tuple[str, str], set[str]] = defaultdict(set)
    n_inputs = 0
    for path in sorted(HERE.glob("test_*.py")):
        for relation in getattr(import_module(f"relations.{path.stem}"), "RELATIONS", ()):
            change = re.sub(r", \w+_picture$", "", relation.change)  # whatever the picture
            rows[relation.verb, relation.since].add(change)
            n_inputs += QUICK + WIDE
    lines = [f"{n_inputs:,} inputs are tried.", "", "| verb | what is changed in its input | since |", "|---|---|---|"]
    lines += [
        f"| `{verb}` | {'; '.join(sorted(changes))} | {since} |" for (verb, since), changes in sorted(rows.items())
    ]
    return "\n".join(lines) + "\n"


def written() -> str:
    """Return the table as it stands in the page."""
    return PAGE.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]


if __name__ == "__main__":
    sys.path.insert(0, str(HERE.parent))
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(page.replace(BEGIN + written(), BEGIN + table()), encoding="utf-8")
