"""Labels and tables of regions on disk; each file appears whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_labels
from cvtimg.files.text_tables import write_csv
from cvtimg.files.whole import StrPath
from cvtimg.labels.formats.numbers import shortest
from cvtimg.pictures.files import Metadata, write_image

#: Suffixes of files of labels.
LABEL_SUFFIXES = (".png", ".tif", ".tiff", ".npy")


def write_labels(
    path: StrPath, labels: ArrayLike, *, metadata: Metadata | None = None, overwrite: bool = False
) -> None:
    """Write the label of each pixel.

    Parameters
    ----------
    path : str or path-like
        Ends in .png, .tif, .tiff or .npy. A PNG or TIFF has 8 bits per pixel for labels up to 255 and 16 bits up to
        65535; a TIFF has 32 bits beyond. A .npy file holds an int32 array.
    labels : (H, W) integer array
        0 or higher.
    metadata : Metadata, optional
        What to write beside the labels, such as where a GeoTIFF lies; as in `write_image`.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or the format cannot hold the labels.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_labels(f"{folder}/labels.npy", [[1, 1, 2]])
    ...     np.load(f"{folder}/labels.npy").tolist()
    [[1, 1, 2]]
    """
    numbers = check_labels("labels", labels)
    suffix = check_choice("suffix", Path(path).suffix.lower(), LABEL_SUFFIXES)
    n_bytes = next(size for size in (1, 2, 4) if numbers.max() < 256**size)
    if suffix == ".png" and n_bytes == 4:
        raise ValueError(f"{path}: has labels up to {numbers.max()}, and .png holds 65535; use .tif or .npy")
    stored = numbers if suffix == ".npy" else numbers.astype(f"u{n_bytes}")
    write_image(path, stored, metadata=metadata, overwrite=overwrite)


def write_table(path: StrPath, table: Mapping[str, NDArray[Any]], *, overwrite: bool = False) -> None:
    """Write columns of numbers, such as those of `region_table`, as CSV with a line of names.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_table(f"{folder}/table.csv", {"label": np.array([1, 2]), "area": np.array([12.5, 3.0])})
    ...     print(Path(folder, "table.csv").read_text(), end="")
    label,area
    1,12.5
    2,3
    """
    rows = zip(*(map(shortest, column.tolist()) for column in table.values()), strict=True)
    write_csv(path, table, rows, overwrite=overwrite)
