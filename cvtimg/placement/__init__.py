"""Regions of space, densities on them, and generators placed in them at the centers of mass of their own cells."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
