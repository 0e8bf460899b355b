from .opening import open_blocks as open_blocks
from .passes import BlockError as BlockError
from .rows import Blocks as Blocks
from .rows import as_blocks as as_blocks
from .spread import Scaling as Scaling
from .spread import Spread as Spread
