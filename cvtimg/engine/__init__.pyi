from .methods import METHODS, Callback, Conditions, Iterate, Iteration, Method, Probabilistic, Stopping, Watch
from .samples import WeightedSamples
from .search import EFFORTS, SearchEffort
from .seeding import SEEDINGS
from .tessellation import Tessellation, tessellate

__all__ = [
    "EFFORTS",
    "METHODS",
    "SEEDINGS",
    "Callback",
    "Conditions",
    "Iterate",
    "Iteration",
    "Method",
    "Probabilistic",
    "SearchEffort",
    "Stopping",
    "Tessellation",
    "Watch",
    "WeightedSamples",
    "tessellate",
]
