"""Contours as a set of regions of interest: the ROI Manager of ImageJ and Fiji opens it."""

from collections.abc import Sequence
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
            place = "".join(f"{axis}{at:04d}-" for axis, at in drawing.place.items())
            for label, pieces in groupby(drawing.polygons, key=lambda polygon: polygon.label):
                for number, piece in enumerate(pieces):
                    name = f"{place}{label:05d}{f'-{number + 1}' if number else ''}"  # which no other piece has
                    archive.writestr(f"{name}.roi", _region(roifile, piece.rings[0][:-1], name, drawing).tobytes())


def _region(roifile: Any, ring: Any, name: str, drawing: Drawing) -> Any:
    whole = np.rint(ring)
    region = roifile.ImagejRoi.frompoints(whole.astype(np.int32) if np.array_equal(whole, ring) else ring, name=name)
    region.roitype = roifile.ROI_TYPE.POLYGON
    if len(drawing.place) == 1:
        region.position = next(iter(drawing.place.values()))
    elif drawing.place:
        region.z_position, region.t_position = (drawing.place.get(axis, 0) for axis in "zt")
    return region
