from .files import SURFACE_SUFFIXES, as_surface, read_surface, read_vertex_density
from .implicit import ImplicitSurface
from .measures import SurfaceMeasures, measure_surface
from .placing import EFFORTS, surface_points
from .result import SurfacePoints
from .shapes import torus
from .surface import Surface, TriangulatedSurface, VertexDensity

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
