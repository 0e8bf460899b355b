from .factors import Factor as Factor
from .factors import read_factors as read_factors
from .latin import latinize as latinize
from .measures import PointMeasures as PointMeasures
from .measures import point_measures as point_measures
from .measures import star_discrepancy as star_discrepancy
from .points import Design as Design
from .points import design as design
