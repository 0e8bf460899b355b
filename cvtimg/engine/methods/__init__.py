"""How generators move from where they start to a centroidal Voronoi tessellation: one short file a method."""

from __future__ import annotations

from cvtimg.engine.methods._iteration import Callback, Conditions, Iteration, Method, Stopping, Watch
from cvtimg.engine.methods.lloyd import lloyd
from cvtimg.engine.methods.macqueen import macqueen
from cvtimg.engine.methods.optimal1d import optimal1d
from cvtimg.engine.methods.probabilistic import Probabilistic, probabilistic
from cvtimg.engine.methods.transfer import transfer

#: The registry: names for `method`, for tests and for the documentation.
METHODS: dict[str, Method] = {
    "lloyd": lloyd,
    "transfer": transfer,
    "macqueen": macqueen,
    "probabilistic": probabilistic,
    "optimal1d": optimal1d,
}

__all__ = ["METHODS", "Callback", "Conditions", "Iteration", "Method", "Probabilistic", "Stopping", "Watch"]
