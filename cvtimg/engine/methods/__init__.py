"""How generators move to a centroidal Voronoi tessellation: one short file per method, one line each in the registry.

A new method is a function like `lloyd` in a file of its own, and a line in `METHODS` that declares what it can do.
"""

from cvtimg._shared.checks import check_choice, raise_unsupported
from cvtimg._shared.choices import MethodName
from cvtimg._shared.iteration import Callback as Callback
from cvtimg._shared.iteration import Stopping as Stopping
from cvtimg._shared.iteration import Watch as Watch
from cvtimg.engine.methods._iteration import Conditions as Conditions
from cvtimg.engine.methods._iteration import Ends as Ends
from cvtimg.engine.methods._iteration import Iterate as Iterate
from cvtimg.engine.methods._iteration import Iteration as Iteration
from cvtimg.engine.methods._iteration import Method as Method
from cvtimg.engine.methods.lloyd import lloyd
from cvtimg.engine.methods.optimal1d import optimal1d
from cvtimg.engine.methods.probabilistic import Probabilistic as Probabilistic
from cvtimg.engine.methods.probabilistic import macqueen
from cvtimg.engine.methods.transfer import transfer

#: The registry of methods: the values of `method` and ``--method``. The first that can do a job is the default.
METHODS: dict[str, Method] = {
    "lloyd": Method(lloyd),
    "transfer": Method(transfer, takes_power=True),
    "macqueen": Method(macqueen),
    "probabilistic": Method(Probabilistic()),
    "optimal1d": Method(optimal1d, takes_locked=False, exact_in_one_dimension=True),
}


def choose_method(
    method: MethodName | Iterate | None = None,
    *,
    n_dims: int,
    volume_power: float = 0,
    n_locked: int = 0,
    has_start: bool = False,
) -> Method:
    """Return a method by its name, or by default the first in the registry that can do the job."""
    # A callable that is no `Method` is taken to lock generators and to take no volume power. An exact method takes no
    # account of initial generators, so where these are given it is no default.
    if method is None:
        exact = n_dims == 1 and not (volume_power or n_locked or has_start)
        fitting = [known for known in METHODS.values() if known.takes_power >= bool(volume_power)]
        return next(known for known in fitting if known.exact_in_one_dimension == exact)
    if isinstance(method, str):
        chosen = METHODS[check_choice("method", method, METHODS)]
    else:
        chosen = method if isinstance(method, Method) else Method(method)
    if volume_power and not chosen.takes_power:
        able = [name for name, known in METHODS.items() if known.takes_power]
        raise_unsupported("method", method, f"volume_power={volume_power:g}", able)
    if n_locked and not chosen.takes_locked:
        able = [name for name, known in METHODS.items() if known.takes_locked]
        raise_unsupported("method", method, "locked generators", able)
    return chosen
