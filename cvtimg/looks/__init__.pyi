from .similarity import VisualQuality, visual_quality

__all__ = ["VisualQuality", "visual_quality"]
