"""Names of choices, for type checkers and for the command line, which must not import NumPy to print help.

What the names stand for is in the registries; a test compares them.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

EffortName: TypeAlias = Literal["fast", "balanced", "best"]
AutoEffortName: TypeAlias = Literal["auto", "fast", "balanced", "best"]
MethodName: TypeAlias = Literal["lloyd", "transfer", "macqueen", "probabilistic", "optimal1d"]
InitName: TypeAlias = Literal["split", "k-means++", "random"]
SpaceName: TypeAlias = Literal["rgb", "linear", "lab", "oklab"]
DitherName: TypeAlias = Literal["floyd-steinberg", "edge-aware", "blue-noise", "bayer", "compact"]
NoiseName: TypeAlias = Literal["auto", "white"]
AlignName: TypeAlias = Literal["auto", "translation", "euclidean", "affine", "homography"]
GoalName: TypeAlias = Literal["error", "eyes"]
