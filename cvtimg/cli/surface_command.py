"""``cvtimg surface``: evenly spaced points and triangles on surfaces."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from cvtimg.batch import Report, Row, Stopwatch, Task, check_suffix, plan_each
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan

EXAMPLES = """Examples:

\b
  cvtimg surface scan.stl -n 5000
  cvtimg surface part.obj -n 20000 -o part.vtu --plot part.png
  cvtimg surface *.ply -n 2000 --out-dir remeshed --effort best
  cvtimg surface scan.ply -n 5000 --density quality
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "n", "triangles", "least_angle", "mean_quality", "seconds", "output")

Inputs = Annotated[list[str], Argument(metavar="INPUT...", help="Surfaces of triangles: .stl, .obj, .ply or .off.")]
Number = Annotated[int, Option("-n", metavar="N", parser=options.whole_number(4, 1 << 24), help="Number of points.")]
Density = Annotated[
    str | None,
    Option(
        metavar="NAME", help="Gather points by this property of the vertices in PLY files: distances go as NAME^(-1/4)."
    ),
]
Output = Annotated[
    Path | None, Option("--output", "-o", metavar="FILE", help="Mesh file: .vtu, .obj, .ply, .stl, .msh, or by meshio.")
]
OutDir = Annotated[Path | None, Option(metavar="DIR", help="Folder for outputs NAME.vtu.")]
Plot = Annotated[
    Path | None, Option(metavar="FILE", help="Plot the triangles, .png or .svg, colored by quality and shaded.")
]
View = Annotated[
    tuple[float, float],
    Option(metavar="LON LAT", help="Direction to the viewer of the plot, in degrees; z points up."),
]


def surface(
    inputs: Inputs,
    number: Number,
    output: Output = None,
    out_dir: OutDir = None,
    density: Density = None,
    plot: Plot = None,
    view: View = (-60.0, 30.0),
    effort: options.Effort = "balanced",
    skip_existing: options.SkipExisting = False,
    *,
    common: options.BatchOptions,
) -> int:
    """Place N points on surfaces, evenly or by a density, and join them by triangles that are nearly equilateral.

    Points are generators of a centroidal Voronoi tessellation on the surface. The triangles have its shape: holes and
    handles stay. Where a surface has a boundary, triangles end half a cell before it.

    The suffix of -o picks the format. Without -o and --out-dir, one input gives NAME-points.vtu beside it.
    """
    from cvtimg import find_images
    from cvtimg.meshes.files import suffixes
    from cvtimg.plotting.charts import PLOT_SUFFIXES

    check_suffix("-o", output, suffixes())
    check_suffix("--plot", plot, PLOT_SUFFIXES)
    pattern = output or ("{}.vtu" if out_dir else "{}-points.vtu")
    plan = plan_each(inputs, find_images, {"-o": pattern, "--plot": plot}, out_dir=out_dir)
    report = Report(COLUMNS, as_json=common.as_json, quiet=common.quiet)
    work = partial(_surface, number=number, density=density, effort=effort, view=view, overwrite=common.overwrite)
    return run_plan(plan, work, report, common, skip_existing=skip_existing)


def _surface(
    task: Task,
    stopwatch: Stopwatch,
    *,
    number: int,
    density: str | None,
    effort: options.Effort,
    view: tuple[float, float],
    overwrite: bool,
) -> Row:
    from dataclasses import asdict

    import cvtimg
    from cvtimg.files.whole import write_whole
    from cvtimg.surfaces import read_surface, read_vertex_density

    shape = read_surface(task.source)
    weight = None if density is None else read_vertex_density(task.source, density)
    stopwatch.lap("read")
    found = cvtimg.surface_points(shape, number, density=weight, effort=effort)
    stopwatch.lap("place")
    found.save(task.output, overwrite=overwrite)
    if "--plot" in task.outputs:
        from cvtimg.plotting.globes import draw_surface

        path = task.outputs["--plot"]
        drawn = draw_surface(found.points, found.triangles, found.qualities, path.suffix.lower(), center=view)
        write_whole(path, drawn, overwrite=overwrite)
    stopwatch.lap("write")
    return {
        "n": number,
        "triangles": len(found.triangles),
        "area": shape.area,
        "energy": found.energy,
        "offset": found.offset,
        "n_iter": found.n_iter,
        **asdict(found.measures()),
    }
