from .cells import CellMeasures, PolygonMoments, measure_cells, voronoi_cells
from .densities import ConstantDensity, PictureDensity, as_density
from .descent import DESCENTS, Descent, Terms
from .draws import MACQUEEN, place_by_draws
from .figures import Circles, FigureMoments, Figures, Segments
from .implicit import ImplicitRegion
from .metrics import GAUGES, Gauge, LpGauge, PolygonGauge, as_gauge
from .moments import CellMoments, Moments, PixelMoments, pixel_labels, pixel_moments
from .pictures import place_in_picture
from .place import place_generators
from .polygons import PictureRegion, PolygonRegion, as_region
from .regions import Box, Region
from .result import Placement
from .samples import SampleMoments

__all__ = [
    "DESCENTS",
    "GAUGES",
    "MACQUEEN",
    "Box",
    "CellMeasures",
    "CellMoments",
    "Circles",
    "ConstantDensity",
    "Descent",
    "FigureMoments",
    "Figures",
    "Gauge",
    "ImplicitRegion",
    "LpGauge",
    "Moments",
    "PictureDensity",
    "PictureRegion",
    "PixelMoments",
    "Placement",
    "PolygonGauge",
    "PolygonMoments",
    "PolygonRegion",
    "Region",
    "SampleMoments",
    "Segments",
    "Terms",
    "as_density",
    "as_gauge",
    "as_region",
    "measure_cells",
    "pixel_labels",
    "pixel_moments",
    "place_by_draws",
    "place_generators",
    "place_in_picture",
    "voronoi_cells",
]
