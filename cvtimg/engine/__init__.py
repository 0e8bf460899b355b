"""Centroidal Voronoi tessellations of weighted samples: the engine that the rest of cvtimg is built on."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
