from .mosaics import Mosaic as Mosaic
from .mosaics import mosaic as mosaic
from .stipples import Stipples as Stipples
from .stippling import stipple as stipple
from .tones import disk_area as disk_area
from .tones import ink_coverage as ink_coverage
from .tours import find_tour as find_tour
