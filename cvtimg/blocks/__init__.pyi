from .passes import Block, BlockError, map_rows, over_blocks
from .rows import Blocks, as_blocks, is_blocked, open_blocks

__all__ = ["Block", "BlockError", "Blocks", "as_blocks", "is_blocked", "map_rows", "open_blocks", "over_blocks"]
