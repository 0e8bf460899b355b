from .animation import QuantizedFrames, quantize_frames
from .averaging import Averaging
from .blocks import quantize_blocks
from .color import SPACES
from .contours import Contours, Polygon, find_contours
from .cvt import Tessellation, tessellate
from .dithering import DITHERS
from .edges import find_edges
from .elbow import EnergyCurve, energy_curve
from .elbow_rules import RULES
from .estimator import CVT
from .frames import Frames, read_frames, write_frames
from .grid_cells import superpixels
from .io import find_images, image_info, read_image, read_metadata, write_image
from .methods import METHODS
from .noise import estimate_noise
from .palette import read_palette, write_palette
from .palette_search import Palette, find_palette
from .quantization import quantize, quantize_to_size
from .regions import region_means, region_table
from .remapping import Quantized, map_to_palette
from .renormalization import RENORMALIZATIONS
from .restoration import Restoration, restore
from .samples import ColorSamples, color_samples, merge_samples
from .search import EFFORTS
from .seeding import SEEDINGS
from .segmentation import Segmentation, segment, segment_curve
from .sharing import shared_palette
from .tiled_quantization import QuantizedFile, quantize_file
from .tiled_segmentation import SegmentedFile, segment_file

__all__ = [
    "CVT",
    "DITHERS",
    "EFFORTS",
    "METHODS",
    "RENORMALIZATIONS",
    "RULES",
    "SEEDINGS",
    "SPACES",
    "Averaging",
    "ColorSamples",
    "Contours",
    "EnergyCurve",
    "Frames",
    "Palette",
    "Polygon",
    "Quantized",
    "QuantizedFile",
    "QuantizedFrames",
    "Restoration",
    "Segmentation",
    "SegmentedFile",
    "Tessellation",
    "color_samples",
    "energy_curve",
    "estimate_noise",
    "find_contours",
    "find_edges",
    "find_images",
    "find_palette",
    "image_info",
    "map_to_palette",
    "merge_samples",
    "quantize",
    "quantize_blocks",
    "quantize_file",
    "quantize_frames",
    "quantize_to_size",
    "read_frames",
    "read_image",
    "read_metadata",
    "read_palette",
    "region_means",
    "region_table",
    "restore",
    "segment",
    "segment_curve",
    "segment_file",
    "shared_palette",
    "superpixels",
    "tessellate",
    "write_frames",
    "write_image",
    "write_palette",
]
