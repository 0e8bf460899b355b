from .similarity import VisualQuality as VisualQuality
from .similarity import content_quality as content_quality
from .similarity import visual_quality as visual_quality
