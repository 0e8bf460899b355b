"""Voronoi cells as polygons: GeoJSON for maps, VTU for views in space."""

from collections.abc import Iterator
from itertools import pairwise
from typing import BinaryIO, TypeAlias

import numpy as np

from cvtimg._shared.extras import shapely
from cvtimg._shared.geojson import collection, feature
from cvtimg._shared.types import Array, Floats
from cvtimg.files.vtu import POLYGON, vtu_content
from cvtimg.sphere.formats.geometry import GridContent, Indices, latitudes_longitudes

#: Decimals of degrees: about a centimeter on the earth.
_DECIMALS = 7
#: Edges that span more degrees of longitude get points between.
_WIDE = 3.0

Ring: TypeAlias = list[list[float]]


def write_geojson(file: BinaryIO, grid: GridContent) -> None:
    """Write each cell as a feature in degrees, cut where it crosses the antimeridian (RFC 7946)."""
    around, geometry = grid.around, grid.geometry
    areas = (geometry.cell_areas * grid.radius**2).tolist()
    corners = around.vertices_on_cell[around.vertices_on_cell >= 0]
    offsets = np.concatenate([[0], np.cumsum(around.degrees)]).astype(np.int32)
    features = (
        feature(
            [[[*piece, piece[0]]] for piece in pieces],
            {
                "area": areas[number],
                "neighbors": int(around.degrees[number]),
                **{name: int(flags[number]) for name, flags in grid.flags.items()},
            },
            id=number,
        )
        for number, pieces in enumerate(cell_polygons(geometry.vertices, corners, offsets))
    )
    file.writelines(text.encode() for text in collection(features))


def write_vtu(file: BinaryIO, grid: GridContent) -> None:
    """Write cells as polygons in space with their areas, numbers of neighbors and densities."""
    around, geometry = grid.around, grid.geometry
    corners = around.vertices_on_cell[around.vertices_on_cell >= 0]
    areas = geometry.cell_areas * grid.radius**2
    values: dict[str, Array] = {"area": areas, "neighbors": around.degrees, "density": grid.density, **grid.flags}
    file.write(vtu_content(geometry.vertices * grid.radius, corners, np.cumsum(around.degrees), POLYGON, values))


def cell_polygons(vertices: Floats, corners: Indices, offsets: Indices) -> Iterator[list[Ring]]:
    """Yield the polygons of cells on a map, for charts and files.

    Parameters
    ----------
    vertices, corners, offsets
        As in `cvtimg.sphere.SphereCells`.

    Yields
    ------
    list of rings
        Of each cell: lists of (longitude, latitude) in degrees, without their ends. Longitudes are in -180..180. A cell
        across the antimeridian has two rings; one around a pole goes along the edge of the map. Edges are straight on
        the map, so that long ones get points between, where the great circle is.
    """
    table = _on_map(vertices)
    following = np.roll(corners, -1)
    following[offsets[1:] - 1] = corners[offsets[:-1]]
    wide = np.abs(table[corners, 0] - table[following, 0]) > _WIDE
    special = np.logical_or.reduceat(wide | (np.abs(table[corners, 1]) == 90), offsets[:-1])
    rings, numbers = table[corners].tolist(), corners.tolist()
    for cell, (start, end) in enumerate(pairwise(offsets.tolist())):
        if special[cell]:
            yield _pieces(_dense_ring(vertices, table, numbers[start:end]))
        else:
            yield [rings[start:end]]


def _on_map(places: Floats) -> Floats:
    latitudes, longitudes = (np.degrees(angles).round(_DECIMALS) for angles in latitudes_longitudes(places))
    return np.stack([((longitudes + 180) % 360 - 180).round(_DECIMALS), latitudes], axis=1)


def _dense_ring(vertices: Floats, table: Floats, corners: list[int]) -> Ring:
    """Put points between corners that are far apart, and let a corner at a pole have the longitudes beside it."""
    kept = [corner for corner in corners if abs(table[corner, 1]) < 90]
    path = []
    for a, b in zip(kept, [*kept[1:], kept[0]], strict=True):
        path.append(table[a].tolist())
        skipped = (corners.index(b) - corners.index(a)) % len(corners) > 1
        if skipped:
            pole = float(np.copysign(90, vertices[a, 2]))
            path += [[table[a, 0], pole], [table[b, 0], pole]]
            continue
        n = int(abs((table[b, 0] - table[a, 0] + 180) % 360 - 180) / _WIDE) + 1
        parts = np.arange(1, n)[:, None] / n
        low, high = vertices[min(a, b)], vertices[max(a, b)]  # the same points for both cells at the edge
        between = _on_map(low + parts * (high - low)).tolist()
        path += between if a < b else between[::-1]
    return path


def _pieces(ring: Ring) -> list[Ring]:
    """Cut a ring at the edge of the map, and move its pieces to -180..180."""
    turned = ring[int(np.argmax(np.abs(np.diff(ring, axis=0, append=ring[:1])[:, 0]))) + 1 :]  # from there it goes on
    path = np.array([*turned, *ring[: len(ring) - len(turned)]])
    path[:, 0] = np.unwrap(path[:, 0], period=360)
    step, turns = path[0, 0] - path[-1, 0], [-360.0, 0.0, 360.0]
    if abs(step) > 180:  # around a pole, along the edge of the map
        around, turns = [np.copysign(360, step), 0], [0.0]
        path = np.concatenate([path[-1:] + around, path, path[:1] - around])
        ends = [[longitude, -np.copysign(90, step)] for longitude in path[[-1, 0], 0]]
        path = np.concatenate([path, ends])
    pieces = []
    for turn in turns:
        clipped = shapely.clip_by_rect(shapely.Polygon(path), turn - 180, -90, turn + 180, 90)
        for part in shapely.get_parts(shapely.orient_polygons(clipped)):
            moved = (shapely.get_coordinates(part)[:-1] - [turn, 0]).round(_DECIMALS)
            if len(moved) > 2 and np.ptp(moved[:, 0]) > 0:
                pieces.append(moved.tolist())
    return pieces
