"""Outlines of maps as they are: polygons of Natural Earth (public domain), as the npm package world-atlas has them."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

Points = NDArray[np.float64]
#: Polygons that are meshed, from small to large, and the points that each has at least.
COUNT, LEAST = 80, 30


def outlines_of(path: Path) -> list[shapely.Polygon]:
    """Read polygons of TopoJSON without what was rounded away."""
    content = json.loads(path.read_text())
    arcs = [np.cumsum(arc, axis=0) * content["transform"]["scale"] for arc in content["arcs"]]
    shapes = [shape for each in content["objects"].values() for shape in each["geometries"]]
    found = []
    for shape in shapes:
        for rings in [shape["arcs"]] if shape["type"] == "Polygon" else shape.get("arcs", []):
            lines = [np.concatenate([arcs[k] if k >= 0 else arcs[~k][::-1] for k in ring]) for ring in rings]
            if len(lines[0]) >= LEAST and (polygon := shapely.Polygon(lines[0], lines[1:])).is_valid:
                found.append(polygon)
    found.sort(key=lambda polygon: polygon.area)
    return [found[k] for k in np.linspace(0, len(found) - 1, COUNT).astype(int)]


def of_outlines(path: Path, make: Callable[[list[Points]], tuple[Points, Any]]) -> dict[str, Any]:
    """Mesh outlines with a program that gets rings and returns points and triangles."""
    from cvtimg.meshes import measure_triangles

    angles, off, start = [], 0.0, time.process_time()
    for polygon in outlines_of(path):
        each = measure_triangles(*make([shapely.get_coordinates(ring)[:-1] for ring in shapely.get_rings(polygon)]))
        angles.append(each.least_angles)
        off = max(off, abs(float(each.areas.sum()) / polygon.area - 1))
    least, below = [float(one.min()) for one in angles], int((np.concatenate(angles) < 20).sum())
    figures = {"worst": round(min(least), 2), "mean": round(float(np.mean(least)), 2), "below 20": below}
    return figures | {"triangles": sum(map(len, angles)), "area off": off, "seconds": time.process_time() - start}
