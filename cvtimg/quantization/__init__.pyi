from .animations import QuantizedFrames, quantize_frames
from .blocks import QuantizedBlocks, quantize_blocks
from .dithering import DITHERS
from .images import quantize, quantize_to_size
from .palette_search import EngineOptions, Palette, find_palette
from .remapping import Quantized, map_to_palette
from .sharing import shared_palette
from .tiled import QuantizedFile, quantize_file

__all__ = [
    "DITHERS",
    "EngineOptions",
    "Palette",
    "Quantized",
    "QuantizedBlocks",
    "QuantizedFile",
    "QuantizedFrames",
    "find_palette",
    "map_to_palette",
    "quantize",
    "quantize_blocks",
    "quantize_file",
    "quantize_frames",
    "quantize_to_size",
    "shared_palette",
]
