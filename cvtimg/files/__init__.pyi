from .finding import find_images
from .whole import remove_leftovers, whole_file, whole_folder

__all__ = [
    "find_images",
    "remove_leftovers",
    "whole_file",
    "whole_folder",
]
