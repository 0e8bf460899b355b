from .radii import Supports, support_radii

__all__ = ["Supports", "support_radii"]
