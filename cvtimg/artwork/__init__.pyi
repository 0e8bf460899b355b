from .mosaics import Mosaic, mosaic
from .stipples import Stipples
from .stippling import stipple
from .tones import disk_area, ink_coverage
from .tours import find_tour, tour_length

__all__ = ["Mosaic", "Stipples", "disk_area", "find_tour", "ink_coverage", "mosaic", "stipple", "tour_length"]
