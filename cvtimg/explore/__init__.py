"""A page in the browser, served on this machine alone, on which settings are changed and their results seen at once."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
