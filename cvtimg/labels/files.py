"""Labels and tables of regions on disk; each file appears whole or not at all."""

from collections.abc import Mapping
from colorsys import hsv_to_rgb
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_choice, check_labels, check_that, check_within
from cvtimg._shared.extras import optional
from cvtimg._shared.svg import shortest
from cvtimg._shared.types import Array, Bytes, Ints
from cvtimg.files.whole import StrPath, whole_file, write_csv
from cvtimg.pictures.files import Metadata, read_indices, write_image

#: Suffixes of files of labels.
LABEL_SUFFIXES = (".png", ".tif", ".tiff", ".npy")
#: An image of labels as colors has no more.
_MOST_COLORS = 256


def write_labels(
    path: StrPath, labels: ArrayLike, *, metadata: Metadata | None = None, overwrite: bool = False
) -> None:
    """Write the label of each pixel.

    Parameters
    ----------
    path : str or path-like
        Ends in .png, .tif, .tiff or .npy. A PNG or TIFF has 8 bits per pixel for labels up to 255 and 16 bits up to
        65535; a TIFF has 32 bits beyond. A .npy file holds an int32 array. A PNG of up to 255 labels is indexed: its
        indices are the labels, shown in distinct colors, with 0 in black.
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
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_labels(f"{folder}/labels.npy", [[1, 1, 2]])
    ...     np.load(f"{folder}/labels.npy").tolist()
    [[1, 1, 2]]
    """
    numbers = check_labels("labels", labels)
    suffix = check_choice("suffix", Path(path).suffix.lower(), LABEL_SUFFIXES)
    stored_as = np.min_scalar_type(int(numbers.max()))
    if suffix == ".png":
        check_within("labels", numbers, 0, 65535, ", which .png holds; use .tif or .npy")
    stored = numbers if suffix == ".npy" else numbers.astype(stored_as)
    palette = label_colors(int(numbers.max())) if suffix == ".png" and stored_as == np.uint8 else None
    write_image(path, stored, palette=palette, metadata=metadata, overwrite=overwrite)


def read_labels(path: StrPath) -> Ints:
    """Read labels that `write_labels` or another program wrote, whatever colors show them.

    Parameters
    ----------
    path : str or path-like
        An indexed or gray image of at most 32 bits, or a .npy array of whole numbers; or one in RGB or RGBA, of which
        equal bands are taken as one, and otherwise up to 256 colors as labels 1, 2, ..., black and what is clear as 0.
        Black alone is label 1 if all else is clear.

    Returns
    -------
    (H, W) int32 array

    Raises
    ------
    OSError
        If the file cannot be read.
    TypeError, ValueError
        If it does not hold labels.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_labels(f"{folder}/labels.png", [[0, 1, 200]])
    ...     read_labels(f"{folder}/labels.png").tolist()
    [[0, 1, 200]]
    """
    values = one_band(read_indices(path))
    if values.dtype.kind == "f" and np.array_equal(values, np.rint(values)):
        values = values.astype(np.int64)  # as integers of 32 bits are read
    return check_labels("labels", values)


def one_band(image: Array) -> Array:
    """Return labels (H, W) of an image that may have bands: equal ones, or a color for each label.

    Examples
    --------
    >>> one_band(np.array([[[0, 0, 0], [255, 0, 0]], [[0, 0, 255], [255, 0, 0]]], np.uint8)).tolist()
    [[0, 2], [1, 2]]
    """
    if image.ndim < 3:
        return image
    n_bands = image.shape[-1]
    bands = image[..., : n_bands - 1 + n_bands % 2]
    clear = image[..., -1] == 0 if n_bands % 2 == 0 else np.zeros(image.shape[:-1], bool)
    if (bands == bands[..., :1]).all():
        values = np.where(clear, 0, bands[..., 0])
        return values if values.any() or not clear.any() else 1 - clear.astype(np.uint8)  # drawn in black on nothing
    colors = np.where(clear[..., None], 0, bands).astype(np.int64) @ 65536 ** np.arange(bands.shape[-1])[::-1]
    values, labels = np.unique(colors, return_inverse=True)
    demand = f"have at most {_MOST_COLORS}, as black for the outside and a color for each region, not {len(values)}"
    check_that("colors of an image of labels", len(values) <= _MOST_COLORS, f"{demand}: segment a photograph first")
    return labels.reshape(colors.shape) + int(values[0] != 0)


def label_colors(n_labels: int) -> Bytes:
    """Return (n_labels + 1, 3) colors, black for label 0 and distinct ones for the others.

    Hues follow the golden ratio, so that labels that are near each other look different, and brightness changes in
    steps of its own.

    Examples
    --------
    >>> label_colors(2).tolist()
    [[0, 0, 0], [242, 48, 48], [60, 98, 189]]
    """
    golden, steps = (5**0.5 - 1) / 2, ((0.8, 0.95), (0.68, 0.74), (0.45, 1.0))
    colors = [(0.0, 0.0, 0.0)]
    for label in range(n_labels):
        colors.append(hsv_to_rgb(label * golden % 1, *steps[label % len(steps)]))
    return np.rint(np.array(colors) * 255).astype(np.uint8)


def write_table(
    path: StrPath, table: Mapping[str, Array], *, image: str | None = None, overwrite: bool = False
) -> None:
    """Write columns of numbers or text, such as those of `region_table`, as .csv with a line of names, or as .parquet.

    With `image`, the first column has that name in each row, so that tables of several images can be joined.

    Raises
    ------
    ModuleNotFoundError
        If pyarrow is not installed (``pip install 'cvtimg[parquet]'``) and the path ends in .parquet.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_table(f"{folder}/table.csv", {"label": np.array([1, 2]), "area": np.array([12.5, 3.0])})
    ...     print(Path(folder, "table.csv").read_text(), end="")
    label,area
    1,12.5
    2,3
    """
    if image is not None:
        table = {"image": np.full(len(next(iter(table.values()))), image), **table}
    if Path(path).suffix.lower() == ".parquet":
        pyarrow = optional("pyarrow", "parquet", "tables in .parquet need")
        from pyarrow import parquet

        with whole_file(path, overwrite=overwrite) as file:
            parquet.write_table(pyarrow.table(dict(table)), file)
        return
    columns = (map(str if column.dtype.kind == "U" else shortest, column.tolist()) for column in table.values())
    write_csv(path, table, zip(*columns, strict=True), overwrite=overwrite)
