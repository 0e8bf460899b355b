from .curves import EnergyCurve as EnergyCurve
from .curves import auto_count as auto_count
from .curves import energy_curve as energy_curve
from .rules import RULES as RULES
from .rules import TargetMissedError as TargetMissedError
