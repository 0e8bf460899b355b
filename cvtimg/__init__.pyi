from . import (
    artwork,
    bases,
    batch,
    blocks,
    colors,
    designs,
    elbow,
    engine,
    explore,
    files,
    labels,
    looks,
    meshes,
    palettes,
    pictures,
    placement,
    plotting,
    quantization,
    restoration,
    segmentation,
    sphere,
    supports,
    surfaces,
    tables,
)
from .artwork.mosaics import mosaic
from .artwork.stippling import stipple
from .bases.frames import key_frames
from .bases.reduction import reduced_basis
from .designs.latin import latinize
from .designs.measures import point_measures
from .designs.points import design
from .elbow.curves import energy_curve
from .engine.tessellation import tessellate
from .files.finding import find_images
from .labels.contours import find_contours
from .labels.edges import find_edges
from .labels.files import read_labels, write_labels
from .labels.formats import write_contours
from .looks.similarity import visual_quality
from .meshes.meshing import mesh_labels, mesh_region
from .palettes.files import read_palette, write_palette
from .pictures.files import read_image, write_image
from .placement.place import place_generators
from .quantization.animations import quantize_frames
from .quantization.images import quantize
from .quantization.palette_search import find_palette
from .restoration.reconstruction import restore
from .segmentation.grid_cells import superpixels
from .segmentation.hierarchy.building import segment_hierarchy
from .segmentation.segments import segment
from .sphere.grids import sphere_grid
from .supports.radii import support_radii
from .surfaces.placing import surface_points
from .tables.estimator import CVT

__version__: str

__all__ = [
    "CVT",
    "artwork",
    "bases",
    "batch",
    "blocks",
    "colors",
    "design",
    "designs",
    "elbow",
    "energy_curve",
    "engine",
    "explore",
    "files",
    "find_contours",
    "find_edges",
    "find_images",
    "find_palette",
    "key_frames",
    "labels",
    "latinize",
    "looks",
    "mesh_labels",
    "mesh_region",
    "meshes",
    "mosaic",
    "palettes",
    "pictures",
    "place_generators",
    "placement",
    "plotting",
    "point_measures",
    "quantization",
    "quantize",
    "quantize_frames",
    "read_image",
    "read_labels",
    "read_palette",
    "reduced_basis",
    "restoration",
    "restore",
    "segment",
    "segment_hierarchy",
    "segmentation",
    "sphere",
    "sphere_grid",
    "stipple",
    "superpixels",
    "support_radii",
    "supports",
    "surface_points",
    "surfaces",
    "tables",
    "tessellate",
    "visual_quality",
    "write_contours",
    "write_image",
    "write_labels",
    "write_palette",
]
