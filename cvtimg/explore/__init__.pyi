from .serving import serve as serve
from .tabs import TABS as TABS
