from .reduction import KINDS as KINDS
from .reduction import Basis as Basis
from .reduction import Projection as Projection
from .reduction import read_basis as read_basis
from .reduction import reduced_basis as reduced_basis
from .snapshots import Snapshots as Snapshots
from .snapshots import as_snapshots as as_snapshots
