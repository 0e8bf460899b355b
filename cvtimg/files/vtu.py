"""VTK's format of unstructured grids (VTU): XML with binary arrays, which ParaView and meshio read."""

from collections.abc import Mapping

import numpy as np

from cvtimg._shared.types import Array, Floats

#: VTK's numbers of kinds of cells.
LINE, TRIANGLE, POLYGON, TETRAHEDRON, LINE3, TRIANGLE6 = 3, 5, 7, 10, 21, 22
_TYPES = {"f8": "Float64", "i4": "Int32", "u1": "UInt8"}


def vtu_content(points: Floats, corners: Array, ends: Array, kind: int | Array, values: Mapping[str, Array]) -> bytes:
    """Return the content of a VTU file: corners, one cell after the other, the end of each, and their kind or kinds."""
    arrays: dict[str, tuple[Array, int]] = {
        "points": (np.asarray(points, "<f8"), 3),
        "connectivity": (np.asarray(corners, "<i4"), 1),
        "offsets": (np.asarray(ends, "<i4"), 1),
        "types": (np.full(len(ends), kind, np.uint8), 1),
    }
    for name, column in values.items():
        arrays[name] = np.asarray(column, "<f8" if column.dtype.kind == "f" else "<i4"), 1
    lines, blocks, offset = {}, [], 0
    for name, (array, width) in arrays.items():
        about = f'type="{_TYPES[array.dtype.str[1:]]}" Name="{name}" NumberOfComponents="{width}"'
        lines[name] = f'<DataArray {about} format="appended" offset="{offset}"/>'
        block = array.tobytes()
        blocks += [np.array(len(block), "<u8").tobytes(), block]
        offset += 8 + len(block)
    head = "\n".join(
        [
            '<?xml version="1.0"?>',
            '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
            f'<UnstructuredGrid><Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(ends)}">',
            f"<Points>{lines['points']}</Points>",
            f"<Cells>{lines['connectivity']}{lines['offsets']}{lines['types']}</Cells>",
            f'<CellData Scalars="{next(iter(values), "")}">{"".join(lines[name] for name in values)}</CellData>',
            "</Piece></UnstructuredGrid>",
            '<AppendedData encoding="raw">_',
        ]
    )
    return b"".join([head.encode(), *blocks, b"\n</AppendedData></VTKFile>\n"])
