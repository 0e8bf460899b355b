from .bounds import read_bounds
from .latin import latinize
from .measures import PointMeasures, point_measures, star_discrepancy
from .points import Design, design
from .sequences import CVTDesign

__all__ = [
    "CVTDesign",
    "Design",
    "PointMeasures",
    "design",
    "latinize",
    "point_measures",
    "read_bounds",
    "star_discrepancy",
]
