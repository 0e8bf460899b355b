from .agreement import HIDDEN as HIDDEN
from .recognition import is_drawing as is_drawing
from .reconstruction import denoise as denoise
from .reconstruction import restore as restore
from .renormalization import RENORMALIZATIONS as RENORMALIZATIONS
from .result import Denoised as Denoised
from .result import Restoration as Restoration
