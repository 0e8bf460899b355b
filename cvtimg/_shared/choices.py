"""Names of choices and what goes by names, for type checkers and the command line, whose help must not import NumPy.

What the names stand for is in the registries; a test compares them.
"""

from collections.abc import Mapping
from typing import Any, Literal, TypeAlias

EffortName: TypeAlias = Literal["fast", "balanced", "best"]
AutoEffortName: TypeAlias = Literal["auto", "fast", "balanced", "best"]
MethodName: TypeAlias = Literal["lloyd", "transfer", "macqueen", "probabilistic", "optimal1d"]
InitName: TypeAlias = Literal["split", "k-means++", "random"]
SpaceName: TypeAlias = Literal["rgb", "linear", "lab", "oklab"]
DitherName: TypeAlias = Literal["floyd-steinberg", "edge-aware", "blue-noise", "bayer", "compact"]
NoiseName: TypeAlias = Literal["auto", "white"]
AlignName: TypeAlias = Literal["auto", "translation", "euclidean", "affine", "homography"]
GoalName: TypeAlias = Literal["error", "eyes"]
#: Keyword arguments by their names.
Options: TypeAlias = Mapping[str, Any]
#: Keyword arguments that are put together, or what a library calls by names.
Arguments: TypeAlias = dict[str, Any]
#: A row of a table: values by the names of columns, as `summary` of results returns them.
Row: TypeAlias = dict[str, Any]
#: An object of JSON.
Json: TypeAlias = dict[str, Any]
