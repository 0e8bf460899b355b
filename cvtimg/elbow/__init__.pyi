from .curves import EnergyCurve, auto_count, energy_curve
from .rules import RULES

__all__ = [
    "RULES",
    "EnergyCurve",
    "auto_count",
    "energy_curve",
]
