from .contours import Contours, Polygon, find_contours
from .cvt import Tessellation, tessellate
from .edges import find_edges
from .estimator import CVT
from .io import find_images, image_info, read_image, write_image
from .methods import METHODS
from .quantization import Quantized, quantize
from .regions import region_table
from .samples import ColorSamples, color_samples
from .search import EFFORTS
from .seeding import SEEDINGS

__all__ = [
    "CVT",
    "EFFORTS",
    "METHODS",
    "SEEDINGS",
    "ColorSamples",
    "Contours",
    "Polygon",
    "Quantized",
    "Tessellation",
    "color_samples",
    "find_contours",
    "find_edges",
    "find_images",
    "image_info",
    "quantize",
    "read_image",
    "region_table",
    "tessellate",
    "write_image",
]
