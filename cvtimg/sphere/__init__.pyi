from .coasts import CoastalGrid, coastal_grid
from .densities import GlobePicture, Refinement, by_spacing
from .formats import GRID_FORMATS
from .formats.polygons import cell_polygons
from .grids import EFFORTS, GridEffort, sphere_grid
from .measures import GridMeasures, measure_grid
from .nesting import Cap, nested_grid
from .patches import move_in_patches
from .result import SphereGrid
from .triangulation import LEAST_DISTANCE, SphereCells, triangulate

__all__ = [
    "EFFORTS",
    "GRID_FORMATS",
    "LEAST_DISTANCE",
    "Cap",
    "CoastalGrid",
    "GlobePicture",
    "GridEffort",
    "GridMeasures",
    "Refinement",
    "SphereCells",
    "SphereGrid",
    "by_spacing",
    "cell_polygons",
    "coastal_grid",
    "measure_grid",
    "move_in_patches",
    "nested_grid",
    "sphere_grid",
    "triangulate",
]
