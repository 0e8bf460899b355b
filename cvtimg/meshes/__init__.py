"""Meshes of triangles whose vertices are generators of centroidal Voronoi tessellations."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
