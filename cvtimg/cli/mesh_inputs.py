"""What ``cvtimg mesh`` reads: polygons, masks and images of labels."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

POLYGON_SUFFIXES = (".geojson", ".json", ".wkt", ".wkb", ".csv")


def read_region(path: Path) -> Any:
    """Read polygons: GeoJSON, well-known text or binary, or a ring as a table with columns x and y."""
    import numpy as np

    from cvtimg._shared.extras import optional

    shapely = optional("shapely", "mesh")

    suffix = path.suffix.lower()
    try:
        if suffix == ".wkb":
            return shapely.from_wkb(path.read_bytes())
        text = path.read_text(encoding="utf-8-sig")
        if suffix == ".wkt":
            return shapely.from_wkt(text)
        if suffix == ".csv":
            lines = [line for line in text.splitlines() if line.strip()]
            has_names = any(letter.isalpha() for letter in lines[0].replace("e", ""))
            return np.loadtxt(lines[has_names:], delimiter=",", usecols=(0, 1), ndmin=2)
        return json.loads(text)
    except (ValueError, UnicodeDecodeError, IndexError, shapely.errors.ShapelyError) as error:
        raise ValueError(f"is not a {suffix} file of polygons: {error}") from error


def read_segments(path: Path) -> tuple[NDArray[np.int32], bool]:
    """Read labels, and tell whether they are a mask: an image with no other values than 0 and one more."""
    import numpy as np

    from cvtimg.labels.files import read_labels

    labels = read_labels(path)
    values = np.unique(labels)
    return labels, len(values) <= 2 and values[0] == 0


def read_size(path: Path) -> NDArray[Any]:
    """Read a gray image of sizes, with the values that the file has."""
    import cvtimg

    size = cvtimg.read_image(path)
    if size.ndim != 2:
        raise ValueError(f"--size {path} has {size.shape[2]} bands and must have one")
    return size
