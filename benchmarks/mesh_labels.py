"""Images of labels that are meshed, and what is measured of their meshes."""

import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import SAMPLES, timed
from numpy.typing import NDArray

Row = dict[str, Any]
Labels = NDArray[np.int32]


def pictures(data: Path) -> Iterator[tuple[str, Labels, int]]:
    """Yield names, labels and numbers of vertices: of people, of nuclei, of bone, and by cvtimg of samples."""
    import cvtimg

    for name, n in (("3063", 4000), ("100039", 6000), ("196027", 6000), ("302022", 6000)):
        path = data / "bsds" / f"{name}_gt.npz"
        if path.exists():
            yield f"Berkeley {name}", np.load(path)["segmentation"][0].astype(np.int32), n
    nuclei = data / "scenes" / "dsb2018_nuclei_mask2d.npz"
    if nuclei.exists():
        with np.load(nuclei) as found:
            yield "nuclei", found[found.files[0]].astype(np.int32), 8000
    bone = data / "scenes" / "bone_trabecular_lhdl_slice060.png"
    if bone.exists():
        yield "bone", 1 + (cvtimg.read_image(bone) > 142).astype(np.int32), 12_000
    cat = cvtimg.read_image(SAMPLES / "chelsea.png")
    yield "chelsea.png, 3 segments", cvtimg.segment(cat, 3, edge_weight=500).labels.astype(np.int32), 8000


def of_labels(data: Path, quick: bool) -> list[Row]:
    """Mesh images of labels; measure how far the area of the worst piece is off, and the whole."""
    import cvtimg
    from cvtimg.halfedges import connected_parts, find_twins
    from cvtimg.labels.components import connected_pieces
    from cvtimg.meshes import measure_triangles

    rows = []
    for name, labels, n in list(pictures(data))[: 1 if quick else None]:
        pieces = connected_pieces(labels)
        mesh, seconds = timed(partial(cvtimg.mesh_labels, pieces, n=n), time.process_time)
        each = measure_triangles(mesh.points, mesh.triangles)
        twins = find_twins(mesh.triangles, len(mesh.points)).ravel()
        halves = np.flatnonzero(twins >= 0)
        halves = halves[mesh.tags[halves // 3] == mesh.tags[twins[halves] // 3]]
        pixels = np.bincount(pieces.ravel())[1:]
        areas = np.bincount(mesh.tags, each.areas, len(pixels) + 1)[1:]
        rows.append({
            "picture": name,
            "vertices": len(mesh.points),
            "seconds": round(seconds, 2),
            "pieces": len(pixels),
            "components": connected_parts((halves // 3, twins[halves] // 3), len(mesh.tags))[0],
            "smallest piece": int(pixels.min()),
            "worst area %": f"{100 * np.abs(areas / pixels - 1).max():.1e}",
            "total area %": f"{100 * abs(areas.sum() / pixels.sum() - 1):.1e}",
            "below 30 %": round(100 * float((each.least_angles < 30).mean()), 3),
            "mean q": round(float(each.qualities.mean()), 4),
        })  # fmt: skip
    return rows
