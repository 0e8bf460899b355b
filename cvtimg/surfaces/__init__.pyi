from .base import Surface
from .conversion import as_surface
from .files import SURFACE_SUFFIXES, read_surface, read_vertex_density
from .implicit import ImplicitSurface
from .measures import SurfaceMeasures, measure_surface
from .placing import EFFORTS, surface_points
from .result import SurfacePoints
from .shapes import torus
from .triangulated import TriangulatedSurface
from .vertex_density import VertexDensity

__all__ = [
    "EFFORTS",
    "SURFACE_SUFFIXES",
    "ImplicitSurface",
    "Surface",
    "SurfaceMeasures",
    "SurfacePoints",
    "TriangulatedSurface",
    "VertexDensity",
    "as_surface",
    "measure_surface",
    "read_surface",
    "read_vertex_density",
    "surface_points",
    "torus",
]
