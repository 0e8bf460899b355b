from .curves import EnergyCurve, auto_count, energy_curve
from .rules import RULES, TargetMissedError

__all__ = ["RULES", "EnergyCurve", "TargetMissedError", "auto_count", "energy_curve"]
