from .anisotropy import HuangMetric, RecoveredHessian
from .files import MESH_FORMATS
from .measures import MeshMeasures, TriangleMeasures, measure_mesh, measure_triangles
from .meshing import EFFORTS, MeshEffort, mesh_labels, mesh_region
from .result import Mesh
from .sizes import MeshSize
from .volumes import VolumeMesh, mesh_volume

__all__ = [
    "EFFORTS",
    "MESH_FORMATS",
    "HuangMetric",
    "Mesh",
    "MeshEffort",
    "MeshMeasures",
    "MeshSize",
    "RecoveredHessian",
    "TriangleMeasures",
    "VolumeMesh",
    "measure_mesh",
    "measure_triangles",
    "mesh_labels",
    "mesh_region",
    "mesh_volume",
]
