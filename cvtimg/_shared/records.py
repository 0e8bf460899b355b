"""Records of results."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np


class ReadOnly:
    """A dataclass whose arrays, alone or in tuples, cannot be written to."""

    __slots__ = ()

    def __post_init__(self) -> None:
        record: Any = self
        for field in fields(record):
            value = getattr(self, field.name)
            for array in value if isinstance(value, tuple) else (value,):
                if isinstance(array, np.ndarray):
                    array.flags.writeable = False
