"""What functions take and return, by the names that many modules share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, TypeAlias

from numpy.typing import ArrayLike, NDArray


class _Exported(Protocol):
    """What exports its samples as images of Pillow do."""

    @property
    def __array_interface__(self) -> dict[str, Any]: ...


#: An array whose numbers are of the type of an argument.
Array: TypeAlias = NDArray[Any]
#: An image, or rows: what `cvtimg._shared.pixels.array_of` takes.
ImageLike: TypeAlias = ArrayLike | _Exported
#: Keyword arguments by their names.
Options: TypeAlias = Mapping[str, Any]
#: A row of a table: values by the names of columns, as `summary` of results returns them.
Row: TypeAlias = dict[str, Any]
#: An object of JSON.
Json: TypeAlias = dict[str, Any]
