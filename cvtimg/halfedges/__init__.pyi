from .half_edges import HalfEdges as HalfEdges
from .half_edges import TriangleMeasures as TriangleMeasures
from .half_edges import boundary_edges as boundary_edges
from .half_edges import edge_keys as edge_keys
from .half_edges import find_twins as find_twins
from .half_edges import half_edges_out as half_edges_out
from .half_edges import measure_triangles as measure_triangles
