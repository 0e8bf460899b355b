"""Files of any kind: outputs that appear whole or not at all, and inputs as people name them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
