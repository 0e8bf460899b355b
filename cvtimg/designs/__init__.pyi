from .bounds import read_bounds
from .discrepancy import star_discrepancy
from .latin import latinize
from .measures import PointMeasures, point_measures
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
