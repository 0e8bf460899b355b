from .images import PixelBlocks, is_image_in_blocks
from .opening import open_blocks
from .passes import Block, BlockError, blocks_of, map_rows, over_blocks
from .rows import Blocks, as_blocks, is_blocked

__all__ = [
    "Block",
    "BlockError",
    "Blocks",
    "PixelBlocks",
    "as_blocks",
    "blocks_of",
    "is_blocked",
    "is_image_in_blocks",
    "map_rows",
    "open_blocks",
    "over_blocks",
]
