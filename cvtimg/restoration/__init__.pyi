from .agreement import HIDDEN
from .reconstruction import restore
from .renormalization import RENORMALIZATIONS
from .result import Restoration

__all__ = ["HIDDEN", "RENORMALIZATIONS", "Restoration", "restore"]
