from .averaging import Averaging
from .blocks import segment_blocks
from .grid_cells import superpixels
from .hierarchy.building import segment_hierarchy
from .hierarchy.tree import RegionHierarchy
from .noise import estimate_noise
from .result import Segmentation
from .segments import segment, segment_curve
from .tiled import SegmentedFile, segment_file
from .touching import Objects, split_touching

__all__ = [
    "Averaging",
    "Objects",
    "RegionHierarchy",
    "Segmentation",
    "SegmentedFile",
    "estimate_noise",
    "segment",
    "segment_blocks",
    "segment_curve",
    "segment_file",
    "segment_hierarchy",
    "split_touching",
    "superpixels",
]
