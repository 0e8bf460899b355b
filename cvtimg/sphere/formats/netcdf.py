"""NetCDF files, in the classic format with 64-bit offsets, which every netCDF library reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

#: Types of netCDF's classic format.
_TYPES = {"f": np.float64, "i": np.int32}


@dataclass(frozen=True, slots=True, eq=False)
class Variable:
    """A variable: its dimensions, values and attributes."""

    dimensions: tuple[str, ...]
    values: Any
    attributes: Mapping[str, Any] = field(default_factory=dict)


def write_netcdf(
    file: BinaryIO,
    dimensions: Mapping[str, int | None],
    variables: Mapping[str, Variable],
    attributes: Mapping[str, Any],
) -> None:
    """Write a netCDF file; the first dimension may be None: unlimited."""
    from scipy.io import netcdf_file

    with netcdf_file(file, "w", version=2) as content:
        for name, length in dimensions.items():
            content.createDimension(name, length)
        for name, variable in variables.items():
            values: NDArray[Any] = np.asarray(variable.values)
            created = content.createVariable(name, _TYPES[values.dtype.kind], variable.dimensions)
            created.data[...] = values
            _describe(created, variable.attributes)
        _describe(content, attributes)


def _describe(described: Any, attributes: Mapping[str, Any]) -> None:
    """Set attributes; floating point numbers in double precision, as other programs read them."""
    for key, value in attributes.items():
        setattr(described, key, np.float64(value) if isinstance(value, float) else value)
