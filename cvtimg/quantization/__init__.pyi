from .animations import QuantizedFrames, quantize_frames
from .blocks import QuantizedBlocks
from .dithering import DITHERS
from .files import QuantizedFile, UnfitOptionError, quantize_file
from .images import quantize, quantize_to_size
from .palette_search import EngineOptions, Palette, find_palette, shared_palette
from .remapping import Quantized, map_to_palette

__all__ = [
    "DITHERS",
    "EngineOptions",
    "Palette",
    "Quantized",
    "QuantizedBlocks",
    "QuantizedFile",
    "QuantizedFrames",
    "UnfitOptionError",
    "find_palette",
    "map_to_palette",
    "quantize",
    "quantize_file",
    "quantize_frames",
    "quantize_to_size",
    "shared_palette",
]
