from .serving import serve
from .tabs import TABS

__all__ = ["TABS", "serve"]
