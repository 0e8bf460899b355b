from .formats import GRID_FORMATS
from .measures import GridMeasures, measure_grid
from .result import SphereGrid
from .triangulation import LEAST_DISTANCE, SphereCells, triangulate

__all__ = [
    "GRID_FORMATS",
    "LEAST_DISTANCE",
    "GridMeasures",
    "SphereCells",
    "SphereGrid",
    "measure_grid",
    "triangulate",
]
