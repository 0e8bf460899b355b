from .radii import Supports as Supports
from .radii import support_radii as support_radii
