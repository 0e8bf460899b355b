from .cells import PolygonMoments, voronoi_cells
from .descent import DESCENTS, Descend, Descent, Projection, Terms
from .draws import MACQUEEN, place_by_draws
from .figures import Circles, FigureMoments, Figures, Segments
from .measures import CellMeasures, measure_cells
from .moments import CellMoments, Moments, PixelMoments, pixel_labels, pixel_moments
from .pictures import EFFORTS, Effort, place_in_picture
from .place import place_generators
from .result import Placement
from .samples import SampleMoments

__all__ = [
    "DESCENTS",
    "EFFORTS",
    "MACQUEEN",
    "CellMeasures",
    "CellMoments",
    "Circles",
    "Descend",
    "Descent",
    "Effort",
    "FigureMoments",
    "Figures",
    "Moments",
    "PixelMoments",
    "Placement",
    "PolygonMoments",
    "Projection",
    "SampleMoments",
    "Segments",
    "Terms",
    "measure_cells",
    "pixel_labels",
    "pixel_moments",
    "place_by_draws",
    "place_generators",
    "place_in_picture",
    "voronoi_cells",
]
