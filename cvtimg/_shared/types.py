"""What functions take and return, by the names that many modules share."""

from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray


class _Exported(Protocol):
    """What exports its samples as images of Pillow do."""

    @property
    def __array_interface__(self) -> dict[str, Any]: ...


#: An array whose numbers are of the type of an argument.
Array: TypeAlias = NDArray[Any]
Dtype: TypeAlias = np.dtype[Any]
Floats: TypeAlias = NDArray[np.float64]
Floats32: TypeAlias = NDArray[np.float32]
Ints: TypeAlias = NDArray[np.int32]
Ints64: TypeAlias = NDArray[np.int64]
Bytes: TypeAlias = NDArray[np.uint8]
Bools: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.intp]
#: Points by their coordinates, (N, D).
Points: TypeAlias = NDArray[np.float64]
#: Triangles by the indices of their corners, (T, 3).
Triangles: TypeAlias = NDArray[np.int32]
#: An image, or rows: what `cvtimg._shared.pixels.array_of` takes.
ImageLike: TypeAlias = ArrayLike | _Exported
