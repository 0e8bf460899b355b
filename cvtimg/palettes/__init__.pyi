from .files import PALETTE_FORMATS, PaletteFormat, read_palette, write_palette
from .swatches import Swatches

__all__ = ["PALETTE_FORMATS", "PaletteFormat", "Swatches", "read_palette", "write_palette"]
