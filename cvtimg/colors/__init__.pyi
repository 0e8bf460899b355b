from .samples import AlphaArray, ColorSamples, color_samples, merge_samples
from .spaces import SPACES, ColorSpace, from_space, to_depth, to_space

__all__ = [
    "SPACES",
    "AlphaArray",
    "ColorSamples",
    "ColorSpace",
    "color_samples",
    "from_space",
    "merge_samples",
    "to_depth",
    "to_space",
]
