"""The command line, for the tests of commands."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

SAMPLES = Path(__file__).parents[1] / "sample_images"


class Outcome(NamedTuple):
    """What a run of the command line left behind."""

    status: int
    out: str
    err: str

    @property
    def rows(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.out.splitlines()]


#: What the fixtures `run` and `row_of` of the tests of commands are.
Run: TypeAlias = Callable[..., Outcome]
RowOf: TypeAlias = Callable[..., dict[str, Any]]
