from .finding import find_images as find_images
from .text_tables import csv_text as csv_text
from .text_tables import write_csv as write_csv
from .whole import remove_leftovers as remove_leftovers
from .whole import whole_file as whole_file
from .whole import whole_folder as whole_folder
