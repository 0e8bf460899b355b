from .moments import CellMoments, Moments, PixelMoments, pixel_labels, pixel_moments

__all__ = [
    "CellMoments",
    "Moments",
    "PixelMoments",
    "pixel_labels",
    "pixel_moments",
]
