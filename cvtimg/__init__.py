"""Centroidal Voronoi tessellations of the colors of images, and of images, regions, surfaces and the globe.

The verbs are here, and the names that belong to them in the package of their subject: ``cvtimg.quantize`` returns a
``cvtimg.quantization.Quantized``. Each is imported when it is first used, so that ``import cvtimg`` costs next to
nothing.
"""

from importlib.util import find_spec

import lazy_loader

from cvtimg._shared.threads import limit_libraries

if find_spec("cvtimg._cyutility") is None:
    raise ImportError(
        "this is the source folder of cvtimg, which has no compiled code: start Python in another folder to import the "
        "package that is installed, or install this folder by pip install --editable ."
    )
_getattr, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

limit_libraries()


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        return version("cvtimg")
    return _getattr(name)
