"""Regions: where generators may lie, and the densities and metrics that they are placed by."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
