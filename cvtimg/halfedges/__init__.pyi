from .figures import TriangleMeasures, measure_triangles
from .half_edges import HalfEdges, boundary_edges, find_twins, half_edges_out

__all__ = ["HalfEdges", "TriangleMeasures", "boundary_edges", "find_twins", "half_edges_out", "measure_triangles"]
