from .finding import find_images
from .text_tables import csv_text, write_csv
from .whole import remove_leftovers, whole_file, whole_folder

__all__ = ["csv_text", "find_images", "remove_leftovers", "whole_file", "whole_folder", "write_csv"]
