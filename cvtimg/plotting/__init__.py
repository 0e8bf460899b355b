"""Drawings of results, which compute nothing: sheets of images, palettes, edges and energy curves."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
