from .agreement import HIDDEN as HIDDEN
from .reconstruction import restore as restore
from .renormalization import RENORMALIZATIONS as RENORMALIZATIONS
from .result import Restoration as Restoration
