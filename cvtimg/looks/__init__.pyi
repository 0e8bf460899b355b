from .similarity import VisualQuality as VisualQuality
from .similarity import visual_quality as visual_quality
