from .components import absorb_small, connected_pieces, join_regions
from .contours import Contours, Polygon, find_contours
from .edges import find_edges
from .figures import mean_picture, region_means, region_table, run_lengths
from .files import label_colors, read_labels, write_labels, write_table
from .formats import CONTOUR_FORMATS, Drawing, write_contours
from .formats.coco import write_coco
from .formats.geojson import write_geojson
from .formats.svg import write_svg

__all__ = [
    "CONTOUR_FORMATS",
    "Contours",
    "Drawing",
    "Polygon",
    "absorb_small",
    "connected_pieces",
    "find_contours",
    "find_edges",
    "join_regions",
    "label_colors",
    "mean_picture",
    "read_labels",
    "region_means",
    "region_table",
    "run_lengths",
    "write_coco",
    "write_contours",
    "write_geojson",
    "write_labels",
    "write_svg",
    "write_table",
]
