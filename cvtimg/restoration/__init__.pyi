from .reconstruction import Restoration, restore
from .renormalization import RENORMALIZATIONS

__all__ = [
    "RENORMALIZATIONS",
    "Restoration",
    "restore",
]
