from .base import Region, low_discrepancy
from .boxes import Box
from .conversion import as_region
from .densities import ConstantDensity, Density, DensityLike, FunctionDensity, PictureDensity, as_density
from .implicit import ImplicitRegion
from .metrics import GAUGES, Gauge, LpGauge, MetricLike, PolygonGauge, as_gauge
from .pictures import PictureRegion
from .polygons import PolygonRegion

__all__ = [
    "GAUGES",
    "Box",
    "ConstantDensity",
    "Density",
    "DensityLike",
    "FunctionDensity",
    "Gauge",
    "ImplicitRegion",
    "LpGauge",
    "MetricLike",
    "PictureDensity",
    "PictureRegion",
    "PolygonGauge",
    "PolygonRegion",
    "Region",
    "as_density",
    "as_gauge",
    "as_region",
    "low_discrepancy",
]
