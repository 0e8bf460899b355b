"""Options of all verbs, each declared once; from them the command line, the page and its copied commands are made.

`record.Option` says what an option is, ``common`` has those that several verbs share, and the other modules list those
of each verb under its name in capitals. ``--help`` imports this package, so nothing here imports NumPy at its top.
"""

from functools import cache
from importlib import import_module

from cvtimg.options.record import Option

#: Modules, each with the verbs whose options it has.
_MODULES = {
    "quantize_options": "quantize palette info",
    "segment_options": "segment",
    "restore_options": "restore",
    "artwork_options": "stipple mosaic",
    "mesh_options": "mesh surface sphere",
    "sample_options": "cluster elbow design basis",
    "common": "explore",
}
#: Panels of ``--help`` in their order, each with the names of its options; the first has all others.
PANELS = {
    "What to get": "",
    "Details": "shading averaging smallest_detail edge_weight edge_radius components min_size "
    "chance strongest no_split diameter min_contrast exclude_edges measure background neck_depth "
    "threshold compactness edit merge weights motion channels "
    "noise_like hidden renormalize label grade keep_points periodic name name_by coast parent within strait all_seas "
    "keep_bays region layers",
    "Colors": "space dither dither_strength palette ramp lock color_bits depth shared_palette "
    "palette_per_frame alpha_threshold matte",
    "Output": "output out_dir ext in_place yes preserve skip_if_larger write labels mean edges overlay contours table "
    "masks tree strengths generators save_palette csv sheet plot histograms view over edge_mode line_color "
    "line_width subpixel simplify properties width height landscape margin bleed marks fill pen_width order cells "
    "outline scale measures keep_metadata optimize overwrite as_json quiet report dry_run",
    "Reading": "mask nodata weight_map columns weight missing delimiter decimal encoding header missing_values page "
    "channel_axis axes channel composite t z series pixel_size max_pixels",
    "Batch": "skip_existing jobs dask",
    "Expert": "volume_power seed method init",
}


def panel_of(name: str) -> str:
    """Return the panel of ``--help`` that has an option."""
    return next((panel for panel, names in PANELS.items() if name in names.split()), "What to get")


@cache  # the page asks for them at each move of a control
def options_of(verb: str) -> tuple[Option, ...]:
    """Return the options of a verb, in the order of ``--help``."""
    module = next(name for name, verbs in _MODULES.items() if verb in verbs.split())
    options: tuple[Option, ...] = getattr(import_module(f"cvtimg.options.{module}"), verb.upper())
    panels = list(PANELS)
    return tuple(sorted(options, key=lambda option: panels.index(panel_of(option.name))))
