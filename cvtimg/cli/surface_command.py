"""``cvtimg surface``: evenly spaced points and triangles on surfaces."""

from dataclasses import asdict

from cvtimg.cli.running import Given, Row, Stopwatch, Task, Todo, plan_of, planned, plot

EXAMPLES = """\
  cvtimg surface scan.stl -n 5000
  cvtimg surface part.obj -n 20000 -o part.vtu --plot part.png
  cvtimg surface *.ply -n 2000 --out-dir remeshed --effort best
  cvtimg surface voxels.stl -n 5000 --feature-angle 180
"""
COLUMNS = ("input", "n", "triangles", "components", "borders", "least_angle", "mean_quality", "seconds", "output")


def surface(given: Given) -> Todo:
    """Place N points on surfaces, evenly, and join them by triangles that are nearly equilateral.

    Points are generators of a centroidal Voronoi tessellation on the surface. The triangles have its shape: holes and
    handles stay, and so do sharp edges, corners and borders. Holes of scans are counted with the borders.

    The suffix of -o picks the format. Without -o and --out-dir, one input gives NAME-points.vtu beside it.
    """
    named = "{}.vtu" if given.out_dir else "{}-points.vtu"
    return planned(plan_of(given, named), _surface, COLUMNS, given)


def _surface(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    import cvtimg
    from cvtimg.surfaces import read_surface

    shape = read_surface(task.source, given.weld)
    stopwatch.lap("read")
    result = cvtimg.surface_points(shape, given.number, feature_angle=given.feature_angle, effort=given.effort)
    stopwatch.lap("place")
    result.save(task.output, overwrite=given.overwrite)
    drawn = result.points, result.triangles, result.qualities
    plot(task.outputs.get("--plot"), given, "draw_surface", *drawn, center=given.view)
    stopwatch.lap("write")
    return {**result.summary(), "area": shape.area, **asdict(shape.repairs)}
