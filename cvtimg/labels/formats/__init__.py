"""Files of contours, a format per module.

A module of this package has a function ``write(path, drawing, overwrite)`` that takes a `drawing.Drawing`. To add a
format, add a module and a line of `CONTOUR_FORMATS`; the command line takes its suffixes from there. COCO, which holds
masks and not contours, is in `coco`.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from cvtimg.files.whole import StrPath

if TYPE_CHECKING:
    from cvtimg.labels.formats.drawing import Drawing

__all__ = ["CONTOUR_FORMATS", "write_contours"]

#: The registry: modules by suffix. Modules are given by name, because ``cvtimg segment --help`` must not import NumPy.
CONTOUR_FORMATS = {".svg": "svg", ".geojson": "geojson"}


def write_contours(path: StrPath, drawing: Drawing, *, overwrite: bool = False) -> None:
    """Write contours in the format that the suffix of the path names.

    Parameters
    ----------
    path : str or path-like
        Ends in .svg or .geojson.
    drawing : Drawing
        The contours, and their colors, properties and place.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    ValueError
        If the suffix is another.
    OSError
        If the file cannot be written.
    """
    from cvtimg._shared.checks import check_choice

    suffix = check_choice(f"{path}: suffix", Path(path).suffix.lower(), CONTOUR_FORMATS)
    import_module(f"{__name__}.{CONTOUR_FORMATS[suffix]}").write(path, drawing, overwrite)
