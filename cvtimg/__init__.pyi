from .averaging import Averaging
from .cvt import Tessellation, tessellate
from .estimator import CVT
from .io import find_images, image_info, read_image, write_image
from .methods import METHODS
from .noise import estimate_noise
from .quantization import Quantized, quantize
from .samples import ColorSamples, color_samples
from .search import EFFORTS
from .seeding import SEEDINGS
from .segmentation import Segmentation, segment
from .superpixels import superpixels

__all__ = [
    "CVT",
    "EFFORTS",
    "METHODS",
    "SEEDINGS",
    "Averaging",
    "ColorSamples",
    "Quantized",
    "Segmentation",
    "Tessellation",
    "color_samples",
    "estimate_noise",
    "find_images",
    "image_info",
    "quantize",
    "read_image",
    "segment",
    "superpixels",
    "tessellate",
    "write_image",
]
