"""Placement: generators in regions of space, so that each is the center of mass of its own cell."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
