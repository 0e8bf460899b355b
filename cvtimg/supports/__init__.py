"""Supports of meshless methods: radii of disks and balls that cover a region, and a proof that they do."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
