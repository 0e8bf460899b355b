from .cvt import Tessellation, tessellate
from .estimator import CVT
from .io import find_images, image_info, read_image, write_image
from .methods import METHODS
from .palette_search import Palette, find_palette
from .quantization import quantize
from .remapping import Quantized, map_to_palette
from .restoration import Restoration, restore
from .samples import ColorSamples, color_samples, merge_samples
from .search import EFFORTS
from .seeding import SEEDINGS

__all__ = [
    "CVT",
    "EFFORTS",
    "METHODS",
    "SEEDINGS",
    "ColorSamples",
    "Palette",
    "Quantized",
    "Restoration",
    "Tessellation",
    "color_samples",
    "find_images",
    "find_palette",
    "image_info",
    "map_to_palette",
    "merge_samples",
    "quantize",
    "read_image",
    "restore",
    "tessellate",
    "write_image",
]
