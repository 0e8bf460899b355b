"""Grids of the globe: centroidal Voronoi tessellations of the sphere, and their triangulations."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
