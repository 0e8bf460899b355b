from .finding import find_images as find_images
from .whole import csv_text as csv_text
from .whole import remove_leftovers as remove_leftovers
from .whole import whole_file as whole_file
from .whole import whole_folder as whole_folder
from .whole import write_csv as write_csv
