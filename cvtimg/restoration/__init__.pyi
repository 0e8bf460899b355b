from .evidence import HIDDEN as HIDDEN
from .reconstruction import denoise as denoise
from .reconstruction import restore as restore
from .reconstruction import restore_versions as restore_versions
from .result import RENORMALIZATIONS as RENORMALIZATIONS
from .result import Denoised as Denoised
from .result import Restoration as Restoration
