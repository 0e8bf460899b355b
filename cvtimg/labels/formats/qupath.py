"""Contours as objects of QuPath: GeoJSON in pixels, with measurements and the plane of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any
from uuid import NAMESPACE_URL, uuid5

import numpy as np

from cvtimg._shared.geojson import collection
from cvtimg.files.whole import StrPath, write_text
from cvtimg.labels.formats import Drawing
from cvtimg.labels.formats.geojson import features_of


def write_qupath(path: StrPath, drawings: Sequence[Drawing], *, overwrite: bool = False) -> None:
    """Write a file of detections that QuPath opens over the image, by File > Import objects.

    Parameters
    ----------
    path : str or path-like
        Ends in .geojson.
    drawings : sequence of Drawing
        Contours of each page, such as those of `cvtimg.plotting.contour_drawing`.
    overwrite : bool
        Replace an existing file.

    Notes
    -----
    Coordinates are in pixels: QuPath takes the size of a pixel from the image.

    Examples
    --------
    >>> import json
    >>> import tempfile
    >>> from pathlib import Path
    >>> from cvtimg import find_contours
    >>> drawing = Drawing(find_contours([[1, 1, 2]]).polygons, (1, 3), np.zeros((3, 3), np.uint8), {1: {}, 2: {}})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_qupath(f"{folder}/a.geojson", [drawing])
    ...     features = json.loads(Path(folder, "a.geojson").read_text())["features"]
    >>> [(one["properties"]["name"], one["properties"]["objectType"]) for one in features]
    [('1', 'detection'), ('2', 'detection')]
    """
    objects = (one for drawing in drawings for one in _objects(drawing))
    write_text(path, collection(objects), overwrite=overwrite)


def _objects(drawing: Drawing) -> Iterator[dict[str, Any]]:
    plane = {"c": -1, **{axis: drawing.place.get(axis, 1) - 1 for axis in "zt"}}
    for one in features_of(replace(drawing, transform=None)):
        label = one["properties"]["label"]
        known = drawing.properties[label]
        values = np.atleast_1d(known.get("mean", ())).tolist()
        names = drawing.channels if len(drawing.channels) == len(values) else range(1, len(values) + 1)
        means = {f"Mean {name}": value for name, value in zip(names, values, strict=True)}
        area = {"Area px^2": known["area"]} if "area" in known else {}
        about = {"objectType": "detection", "name": str(label), "measurements": {**area, **means}}
        # Identifiers must be unique, and are the same whenever the same objects are written.
        number = uuid5(NAMESPACE_URL, f"cvtimg:{plane['t']}/{plane['z']}/{label}")
        yield {**one, "id": str(number), "properties": about, "geometry": {**one["geometry"], "plane": plane}}
