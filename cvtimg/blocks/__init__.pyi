from .images import PixelBlocks, is_image_in_blocks
from .passes import Block, BlockError, map_rows, over_blocks
from .rows import Blocks, as_blocks, is_blocked, open_blocks

__all__ = [
    "Block",
    "BlockError",
    "Blocks",
    "PixelBlocks",
    "as_blocks",
    "is_blocked",
    "is_image_in_blocks",
    "map_rows",
    "open_blocks",
    "over_blocks",
]
