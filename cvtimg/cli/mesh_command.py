"""``cvtimg mesh``: triangles for masks, images of labels and polygons; tetrahedra for stacks of voxels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cvtimg.batch import Row, Stopwatch, Task, check_suffix
from cvtimg.cli.mesh_inputs import POLYGON_SUFFIXES
from cvtimg.cli.running import Todo, plan_of, planned, plot
from cvtimg.options.record import Given

EXAMPLES = """\
  cvtimg mesh mask.png -n 2000 -o mask.vtu --plot mask-mesh.png
  cvtimg mesh labels.png --edge-length 6 -o labels.msh
  cvtimg mesh coast.geojson -n 20000 --min-size 0.01 --measures
  cvtimg mesh mask.png -n 5000 --size sizes.tif --grade 0.15 -o mesh.vtu
  cvtimg mesh plate.geojson --name steel=1 --name clamped=0,0,0,1 -o plate.msh
  cvtimg mesh stack.tif --label 2 -n 20000 -o bone.vtu
"""
COLUMNS = ("input", "n", "triangles", "least_angle", "mean_quality", "seconds", "output")
MEASURES = ("h", "chi", "tau", "d", "alpha", "beta", "q", "p")


def mesh(given: Given) -> Todo:
    """Divide masks, label images and polygons into triangles that are nearly equilateral.

    Vertices are generators of a centroidal Voronoi tessellation. Segments side by side share the vertices on their
    border, and triangles are tagged by labels. Give -n, --edge-length, --size, -n and --size, or nothing for as many
    vertices as borders need.

    Stacks of voxels are filled with tetrahedra (experimental), all labels or that of --label; they take -n or
    --edge-length, and -o .vtu, .msh, .inp, .vtk or .xdmf.

    Names are groups in .msh, .vtu and .inp. Features of .geojson files that all have the property --name-by are regions
    of these names, which share the vertices on their borders.

    The suffix of -o picks the format; with --order 2 .vtu, .msh, or by meshio .inp and more. Without -o and
    --out-dir, one input gives NAME-mesh.vtu beside it.
    """
    named = "{}.vtu" if given.out_dir else "{}-mesh.vtu"
    if given.order == 2:
        from cvtimg.meshes.files import suffixes

        check_suffix("--order 2", Path(given.output or named), suffixes("triangle6"))
    return planned(plan_of(given, named), _mesh, (*COLUMNS, *MEASURES) if given.measures else COLUMNS, given)


def _mesh(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from dataclasses import asdict

    import cvtimg
    from cvtimg.cli.mesh_inputs import named, read_region, read_segments, read_size, warn_of_degrees

    is_polygon = task.source.suffix.lower() in POLYGON_SUFFIXES
    making = given.arguments
    if is_polygon and given.label is not None:
        raise ValueError("has polygons; --label is for images of labels")
    outlines = {"keep_points": given.keep_points, "snap": given.snap, "simplify": given.simplify}
    outlines["project"] = given.project
    if not is_polygon and (unfit := given.chosen(*outlines)):
        raise ValueError(f"has pixels; {' and '.join(unfit)} is for polygons")
    region = read_region(task.source, given.name_by) if is_polygon else None
    labels, is_mask = (None, False) if is_polygon else read_segments(task.source, given.label)
    if labels is not None and labels.ndim == 3:
        stopwatch.lap("read")
        return _fill(task, stopwatch, labels, is_mask, given)
    sizes = None if given.size is None else read_size(given.size)
    stopwatch.lap("read")
    if labels is None:
        result = cvtimg.mesh_region(region, size=sizes, **outlines, **making)
    elif is_mask:
        result = cvtimg.mesh_region(labels > 0, size=sizes, **making)
    else:
        result = cvtimg.mesh_labels(labels, size=sizes, **making)
    stopwatch.lap("mesh")
    if given.name:
        result = named(result, given.name)
    result.save(task.output, overwrite=given.overwrite)
    image = None if given.over is None else cvtimg.read_image(given.over)
    drawn = result.points, result.triangles, result.qualities, result.edges
    below = {"image": image, "y_down": not is_polygon or image is not None}
    plot(task.outputs.get("--plot"), given, "draw_mesh", *drawn, **below)
    stopwatch.lap("write")
    if is_polygon and result.projection is None and task.source.suffix.lower() in (".geojson", ".json"):
        warn_of_degrees(result)
    return {**result.summary(), **(asdict(result.measures()) if given.measures else {})}


def _fill(task: Task, stopwatch: Stopwatch, voxels: Any, is_mask: bool, given: Given) -> Row:
    from dataclasses import asdict

    from cvtimg.meshes import mesh_volume

    if unfit := given.chosen("size", "plot", "grade", "min_size", "order", "periodic", "name"):
        raise ValueError(f"has voxels, to which {' and '.join(unfit)} cannot be applied")
    result = mesh_volume(voxels > 0 if is_mask else voxels, n=given.n, edge_length=given.edge_length)
    stopwatch.lap("mesh")
    result.save(task.output, overwrite=given.overwrite)
    stopwatch.lap("write")
    return {
        **result.summary(),
        **(asdict(result.measures()) if given.measures else {}),
        **(
            {"labels": {tag: asdict(measures) for tag, measures in result.measures_by_label().items()}}
            if given.measures
            else {}
        ),
    }
