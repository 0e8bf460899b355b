"""Centroidal Voronoi tessellations of the colors of images.

The public names, each imported when it is first used, so that ``import cvtimg`` costs next to nothing.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
