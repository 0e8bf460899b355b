"""``cvtimg mesh``: triangles for masks, images of labels and polygons; tetrahedra for stacks of voxels."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from cvtimg.batch import Report, Row, Stopwatch, Task, WrongUsageError, check_suffix, plan_each
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan
from cvtimg.cli.mesh_inputs import POLYGON_SUFFIXES

if TYPE_CHECKING:
    from cvtimg.meshes import Mesh

EXAMPLES = """Examples:

\b
  cvtimg mesh mask.png -n 2000 -o mask.vtu --plot mask-mesh.png
  cvtimg mesh labels.png --edge-length 6 -o labels.msh
  cvtimg mesh coast.geojson -n 20000 --min-size 0.01 --measures
  cvtimg mesh mask.png -n 5000 --size sizes.tif --grade 0.15 -o mesh.vtu
  cvtimg mesh stack.tif --label 2 -n 20000 -o bone.vtu
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "n", "triangles", "least_angle", "mean_quality", "seconds", "output")
#: As in `mesh_region`.
_GRADE = 0.2
MEASURES = ("h", "chi", "tau", "d", "alpha", "beta", "q", "p")

Inputs = Annotated[
    list[str],
    Argument(
        metavar="INPUT...",
        help="Masks (images of black and one more value), images of labels (0 is not meshed), or polygons: .geojson, "
        ".json, .wkt, .wkb, or .csv with columns x and y. Stacks of voxels, filled with tetrahedra: .tif of several "
        "pages, or .npy.",
    ),
]
Number = Annotated[
    int | None, Option("-n", metavar="N", parser=options.whole_number(1, 1 << 26), help="Number of vertices.")
]
EdgeLength = Annotated[
    float | None,
    Option(
        "--edge-length",
        metavar="H",
        parser=options.number(above=0),
        help="Edge length, in the units of the coordinates.",
    ),
]
Size = Annotated[
    Path | None,
    Option("--size", metavar="FILE", help="Gray image with the length of edges at each pixel; with -n, its ratios."),
]
Label = Annotated[
    int | None,
    Option("--label", metavar="K", parser=options.whole_number(0, 2**31 - 1), help="Mesh only pixels with this label."),
]
Grade = Annotated[
    float, Option(metavar="G", parser=options.number(above=0), help="Growth of sizes for each unit of length, at most.")
]
MinSize = Annotated[
    float,
    Option("--min-size", metavar="H", parser=options.number(0), help="Least size; smaller details are left out."),
]
Output = Annotated[
    Path | None, Option("--output", "-o", metavar="FILE", help="Mesh file: .vtu, .msh, .obj, .ply, .stl, or by meshio.")
]
OutDir = Annotated[Path | None, Option(metavar="DIR", help="Folder for outputs NAME.vtu.")]
Measures = Annotated[bool, Option("--measures", help="Report the eight measures of mesh quality.")]
Plot = Annotated[
    Path | None, Option(metavar="FILE", help="Plot the mesh, .png or .svg, with triangles colored by quality.")
]
Over = Annotated[Path | None, Option(metavar="IMAGE", help="Image to show below the mesh in --plot.")]


def mesh(
    inputs: Inputs,
    number: Number = None,
    edge_length: EdgeLength = None,
    size: Size = None,
    label: Label = None,
    grade: Grade = _GRADE,
    min_size: MinSize = 0.0,
    output: Output = None,
    out_dir: OutDir = None,
    measures: Measures = False,
    plot: Plot = None,
    over: Over = None,
    effort: options.Effort = "balanced",
    seed: options.Seed = 0,
    skip_existing: options.SkipExisting = False,
    max_pixels: options.MaxPixels = None,
    *,
    common: options.BatchOptions,
) -> int:
    """Divide masks, label images and polygons into triangles that are nearly equilateral.

    Vertices are generators of a centroidal Voronoi tessellation. Segments side by side share the vertices on their
    border, and triangles are tagged by labels. Give -n, --edge-length, --size, or -n and --size.

    Stacks of voxels are filled with tetrahedra (experimental); they take -n or --edge-length, and -o .vtu or .msh.

    The suffix of -o picks the format. Without -o and --out-dir, one input gives NAME-mesh.vtu beside it.
    """
    from cvtimg import find_images
    from cvtimg.meshes.files import suffixes
    from cvtimg.plotting.charts import PLOT_SUFFIXES

    given = {"n": number, "edge_length": edge_length, "size": size}
    if tuple(name for name, value in given.items() if value is not None) not in (
        ("n",), ("edge_length",), ("size",), ("n", "size")
    ):  # fmt: skip
        raise WrongUsageError("give -n, --edge-length, --size, or -n and --size")
    if over and not plot:
        raise WrongUsageError("--over needs --plot")
    check_suffix("-o", output, suffixes())
    check_suffix("--plot", plot, PLOT_SUFFIXES)
    pattern = output or ("{}.vtu" if out_dir else "{}-mesh.vtu")
    plan = plan_each(inputs, find_images, {"-o": pattern, "--plot": plot}, out_dir=out_dir, also_read=[size, over])
    report = Report((*COLUMNS, *MEASURES) if measures else COLUMNS, as_json=common.as_json, quiet=common.quiet)
    making = {"n": number, "edge_length": edge_length, "grade": grade, "min_size": min_size, "effort": effort}
    work = partial(_mesh, making={**making, "rng": seed}, label=label, size=size, over=over, measures=measures)
    work = partial(work, overwrite=common.overwrite)
    return run_plan(plan, work, report, common, skip_existing=skip_existing, max_pixels=max_pixels)


def _mesh(
    task: Task,
    stopwatch: Stopwatch,
    *,
    making: Mapping[str, Any],
    label: int | None,
    size: Path | None,
    over: Path | None,
    measures: bool,
    overwrite: bool,
) -> Row:
    from dataclasses import asdict

    import cvtimg
    from cvtimg.cli.mesh_inputs import read_region, read_segments, read_size
    from cvtimg.meshes import measure_triangles

    is_polygon = task.source.suffix.lower() in POLYGON_SUFFIXES
    if is_polygon and label is not None:
        raise ValueError("has polygons, which have no --label")
    region = read_region(task.source) if is_polygon else None
    labels, is_mask = (None, False) if is_polygon else read_segments(task.source, label)
    if labels is not None and labels.ndim == 3:
        stopwatch.lap("read")
        flat = {"--size": size is not None, "--measures": measures, "--plot": "--plot" in task.outputs}
        flat |= {"--grade": making["grade"] != _GRADE, "--min-size": making["min_size"] > 0}
        if unfit := [option for option, given in flat.items() if given]:
            raise ValueError(f"has voxels, for which there is no {' and no '.join(unfit)}")
        return _fill(task, stopwatch, labels, is_mask, making, overwrite=overwrite)
    sizes = None if size is None else read_size(size)
    stopwatch.lap("read")
    if labels is None:
        found = cvtimg.mesh_region(region, size=sizes, **making)
    elif is_mask:
        found = cvtimg.mesh_region(labels > 0, size=sizes, **making)
    else:
        found = cvtimg.mesh_labels(labels, size=sizes, **making)
    stopwatch.lap("mesh")
    found.save(task.output, overwrite=overwrite)
    if "--plot" in task.outputs:
        _plot(found, task.outputs["--plot"], over, y_down=not is_polygon, overwrite=overwrite)
    stopwatch.lap("write")
    each = measure_triangles(found.points, found.triangles)
    return {
        "n": len(found.points),
        "n_wanted": found.n_wanted,
        "triangles": len(found.triangles),
        "area": float(each.areas.sum()),
        "least_angle": float(each.least_angles.min()),
        "mean_quality": float(each.qualities.mean()),
        "below_30": float((each.least_angles < 30).mean()),
        "energy": found.energy,
        "n_iter": len(found.energies) - 1,
        **(asdict(found.measures()) if measures else {}),
    }


def _plot(found: Mesh, path: Path, over: Path | None, *, y_down: bool, overwrite: bool) -> None:
    """Plot a mesh, over an image if there is one; then y is down, as in the image."""
    from cvtimg import read_image
    from cvtimg.files.whole import write_whole
    from cvtimg.plotting.meshes import draw_mesh

    image = None if over is None else read_image(over)
    drawn = draw_mesh(
        found.points, found.triangles, found.qualities, found.edges, path.suffix.lower(),
        image=image, y_down=y_down or image is not None,
    )  # fmt: skip
    write_whole(path, drawn, overwrite=overwrite)


def _fill(
    task: Task, stopwatch: Stopwatch, voxels: Any, is_mask: bool, making: Mapping[str, Any], *, overwrite: bool
) -> Row:
    """Fill a mask of voxels with tetrahedra."""
    from cvtimg.meshes import mesh_volume

    if not is_mask:
        raise ValueError("has voxels of several labels: choose one by --label")
    found = mesh_volume(voxels > 0, n=making["n"], edge_length=making["edge_length"])
    stopwatch.lap("mesh")
    found.save(task.output, overwrite=overwrite)
    stopwatch.lap("write")
    return {
        "n": len(found.points),
        "n_wanted": found.n_wanted,
        "tetrahedra": len(found.tetrahedra),
        "triangles": len(found.surface),
        "volume": found.volume,
        "least_angle": float(found.dihedral_angles.min()),
        "is_manifold": found.is_manifold,
    }
