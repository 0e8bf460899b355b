from .charts import draw_pairs, draw_spectrum, draw_supports, save_plot
from .energy_curves import Plotted, draw_curves
from .globes import draw_globe, draw_map, draw_surface
from .meshes import draw_mesh
from .outlines import contour_drawing
from .sheets import Panel, contact_sheet, draw_edges, palette_strip, shown_colors

__all__ = [
    "Panel",
    "Plotted",
    "contact_sheet",
    "contour_drawing",
    "draw_curves",
    "draw_edges",
    "draw_globe",
    "draw_map",
    "draw_mesh",
    "draw_pairs",
    "draw_spectrum",
    "draw_supports",
    "draw_surface",
    "palette_strip",
    "save_plot",
    "shown_colors",
]
