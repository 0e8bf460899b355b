from .averaging import Averaging
from .grid_cells import superpixels
from .noise import estimate_noise
from .result import Segmentation
from .segments import segment, segment_curve
from .tiled import SegmentedFile, segment_file

__all__ = [
    "Averaging",
    "Segmentation",
    "SegmentedFile",
    "estimate_noise",
    "segment",
    "segment_curve",
    "segment_file",
    "superpixels",
]
