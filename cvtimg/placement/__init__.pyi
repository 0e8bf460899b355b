from .descent import DESCENTS, Descend, Descent, Projection, Terms
from .moments import CellMoments, Moments, PixelMoments, pixel_labels, pixel_moments
from .pictures import EFFORTS, Effort, place_in_picture
from .result import Placement

__all__ = [
    "DESCENTS",
    "EFFORTS",
    "CellMoments",
    "Descend",
    "Descent",
    "Effort",
    "Moments",
    "PixelMoments",
    "Placement",
    "Projection",
    "Terms",
    "pixel_labels",
    "pixel_moments",
    "place_in_picture",
]
