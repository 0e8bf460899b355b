"""``cvtimg mesh``: triangles for masks, images of labels and polygons; tetrahedra for stacks of voxels."""

from pathlib import Path

from cvtimg.batch.plans import check_suffix
from cvtimg.cli.running import Given, Todo, plan_of, planned
from cvtimg.options.record import late

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
    columns = (*COLUMNS, *MEASURES) if given.measures else COLUMNS
    return planned(plan_of(given, named), late("cli.meshing", "meshed"), columns, given)
