from .agreement import HIDDEN as HIDDEN
from .films import restore_frames as restore_frames
from .reconstruction import restore as restore
from .renormalization import RENORMALIZATIONS as RENORMALIZATIONS
from .result import Restoration as Restoration
