from .files import PALETTE_FORMATS as PALETTE_FORMATS
from .files import PaletteFormat as PaletteFormat
from .files import read_palette as read_palette
from .files import write_palette as write_palette
from .swatches import Swatches as Swatches
from .swatches import color_order as color_order
