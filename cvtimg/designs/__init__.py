"""Designs of experiments: points that fill a cube or a region evenly, and measures of how evenly."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
