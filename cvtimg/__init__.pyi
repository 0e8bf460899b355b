from .cvt import Tessellation, tessellate
from .estimator import CVT
from .io import find_images, image_info, read_image, write_image
from .methods import METHODS
from .noise import estimate_noise
from .quantization import Quantized, quantize
from .samples import ColorSamples, color_samples
from .search import EFFORTS
from .seeding import SEEDINGS

__all__ = [
    "CVT",
    "EFFORTS",
    "METHODS",
    "SEEDINGS",
    "ColorSamples",
    "Quantized",
    "Tessellation",
    "color_samples",
    "estimate_noise",
    "find_images",
    "image_info",
    "quantize",
    "read_image",
    "tessellate",
    "write_image",
]
