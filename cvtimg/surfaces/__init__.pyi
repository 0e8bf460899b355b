from .base import Surface
from .conversion import as_surface
from .files import SURFACE_SUFFIXES, read_surface
from .implicit import ImplicitSurface
from .measures import SurfaceMeasures, measure_surface
from .placing import EFFORTS, surface_points
from .result import SurfacePoints
from .shapes import torus
from .triangulated import TriangulatedSurface

__all__ = [
    "EFFORTS",
    "SURFACE_SUFFIXES",
    "ImplicitSurface",
    "Surface",
    "SurfaceMeasures",
    "SurfacePoints",
    "TriangulatedSurface",
    "as_surface",
    "measure_surface",
    "read_surface",
    "surface_points",
    "torus",
]
