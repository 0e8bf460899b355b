from .opening import open_blocks
from .passes import BlockError
from .rows import Blocks, as_blocks

__all__ = ["BlockError", "Blocks", "as_blocks", "open_blocks"]
