from .frames import KeyFrames, key_frames
from .reduction import KINDS, Basis, Projection, read_basis, reduced_basis
from .snapshots import Snapshots, as_snapshots

__all__ = [
    "KINDS",
    "Basis",
    "KeyFrames",
    "Projection",
    "Snapshots",
    "as_snapshots",
    "key_frames",
    "read_basis",
    "reduced_basis",
]
