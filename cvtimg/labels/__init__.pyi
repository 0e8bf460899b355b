from .components import absorb_small, connected_pieces, join_regions
from .contours import Contours, Polygon, find_contours
from .edges import find_edges
from .figures import region_means, region_table, run_lengths
from .files import write_coco, write_geojson, write_labels, write_svg, write_table

__all__ = [
    "Contours",
    "Polygon",
    "absorb_small",
    "connected_pieces",
    "find_contours",
    "find_edges",
    "join_regions",
    "region_means",
    "region_table",
    "run_lengths",
    "write_coco",
    "write_geojson",
    "write_labels",
    "write_svg",
    "write_table",
]
