"""Contours as a set of regions of interest: the ROI Manager of ImageJ and Fiji opens it."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np

from cvtimg._shared.extras import optional
from cvtimg.files.whole import StrPath, whole_file
from cvtimg.labels.formats import Drawing


def write(path: StrPath, drawings: Sequence[Drawing], overwrite: bool) -> None:
    """Write a region for each piece of a label, named by the label, at its place in the stack; holes are filled.

    Coordinates are in pixels, as ImageJ needs them whatever the size of a pixel is.
    """
    roifile = optional("roifile", "microscopy")
    with whole_file(path, overwrite=overwrite) as file, ZipFile(file, "w", ZIP_DEFLATED) as archive:
        for drawing in drawings:
            for name, ring in _named_rings(drawing):
                archive.writestr(f"{name}.roi", _region(roifile, ring, name, drawing).tobytes())


def _named_rings(drawing: Drawing) -> Iterator[tuple[str, Any]]:
    """Yield the outer ring of each piece, and a name that no other piece of the file has."""
    place = "".join(f"{axis}{at:04d}-" for axis, at in drawing.place.items())
    for label, pieces in groupby(drawing.polygons, key=lambda polygon: polygon.label):
        for number, piece in enumerate(pieces):
            yield f"{place}{label:05d}{f'-{number + 1}' if number else ''}", piece.rings[0][:-1]


def _region(roifile: Any, ring: Any, name: str, drawing: Drawing) -> Any:
    whole = np.rint(ring)
    region = roifile.ImagejRoi.frompoints(whole.astype(np.int32) if np.array_equal(whole, ring) else ring, name=name)
    region.roitype = roifile.ROI_TYPE.POLYGON
    if len(drawing.place) == 1:
        region.position = next(iter(drawing.place.values()))
    elif drawing.place:
        region.z_position, region.t_position = (drawing.place.get(axis, 0) for axis in "zt")
    return region
