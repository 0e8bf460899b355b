"""Files of contours, a format per module.

A module of this package has a function ``write(path, drawings, overwrite)`` that takes a `Drawing` of each page. To add
a format, add a module and a line of `CONTOUR_FORMATS`; the command line takes its suffixes from there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from cvtimg._shared.choices import Options
from cvtimg.files.whole import StrPath

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from cvtimg._shared.types import Bytes, Floats
    from cvtimg.labels.contours import Polygon

#: The registry: modules by suffix. Modules are given by name, because ``cvtimg segment --help`` must not import NumPy.
CONTOUR_FORMATS = {".svg": "svg", ".geojson": "geojson", ".zip": "imagej"}
#: Decimal places of a coordinate in pixels; half of the last is far below the clearance of borders.
PLACE_DIGITS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """Contours, and what formats can tell about them.

    Attributes
    ----------
    polygons : tuple of Polygon
        Those of `Contours`, by label.
    size : (int, int)
        Height and width of the image.
    colors : (max label + 1, 3) uint8 array
        Color of each label.
    properties : mapping of int to mapping
        Properties of each label.
    transform : (2, 3) array, optional
        Maps (x, y, 1) in pixels to coordinates on a map.
    epsg : int, optional
        Code of the coordinate system of that map.
    unit : str
        Unit of the coordinates after `transform`, such as "um"; "" for one that the map has, or pixels.
    place : mapping of str to int
        Place of the page in its stack, from 1, such as ``{"t": 1, "z": 3}``; empty for an image.
    channels : sequence of str
        Names of the bands of a mean; 1, 2, ... by default.
    lines : sequence of (N, 2) arrays
        Lines to draw in place of the polygons, points (x, y) in pixels.
    chances : (L,) array, optional
        Chance that a person draws each line.
    """

    polygons: tuple[Polygon, ...]
    size: tuple[int, int]
    colors: Bytes
    properties: Mapping[int, Options]
    transform: ArrayLike | None = None
    epsg: int | None = None
    unit: str = ""
    place: Mapping[str, int] = field(default_factory=dict)
    channels: Sequence[str] = ()
    lines: Sequence[Floats] = ()
    chances: Floats | None = None


def write_contours(path: StrPath, drawing: Drawing | Sequence[Drawing], *, overwrite: bool = False) -> None:
    """Write contours in the format that the suffix of the path names.

    Parameters
    ----------
    path : str or path-like
        Ends in .svg or .geojson, or in .zip for a set of regions of interest of ImageJ and Fiji.
    drawing : Drawing or sequence of Drawing
        The contours, and their colors, properties and place; several for the pages of a stack, which .svg cannot hold.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    ImportError
        If roifile is not installed (``pip install 'cvtimg[microscopy]'``) and the path ends in .zip.
    TypeError
        If a drawing is none, such as an array of labels.
    ValueError
        If the suffix is another, or the format holds one page.
    OSError
        If the file cannot be written.
    """
    from cvtimg._shared.checks import check_choice, refuse_type

    suffix = check_choice(f"{path}: suffix", Path(path).suffix.lower(), CONTOUR_FORMATS)
    drawings = [drawing] if isinstance(drawing, Drawing) else list(drawing)
    for page in drawings:
        if not isinstance(page, Drawing):
            refuse_type("drawing", type(drawing).__name__, "a Drawing, such as cvtimg.plotting.contour_drawing makes")
    import_module(f"{__name__}.{CONTOUR_FORMATS[suffix]}").write(path, drawings, overwrite)
