"""Designs that grow, as an engine of scipy.stats.qmc."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from cvtimg._shared.choices import EffortName
from cvtimg.designs.points import design


class CVTDesign(qmc.QMCEngine):  # type: ignore[misc]
    """Centroidal Voronoi designs for `scipy.stats.qmc`: each call of ``random`` extends the points before, which stay.

    Parameters
    ----------
    d : int
        Number of dimensions.
    latin : bool
        Whether points are Latin as well: one in each slice of each axis at the first call, at most one later.
    effort : {"fast", "balanced", "best"}
        As in `design`.
    optimization : {None, "random-cd", "lloyd"}, optional
        SciPy's optimization of what is drawn.
    rng : int or numpy.random.Generator, optional
        Seed.

    Examples
    --------
    >>> from cvtimg.designs import CVTDesign
    >>> engine = CVTDesign(2, effort="fast", rng=0)
    >>> first, more = engine.random(8), engine.random(8)
    >>> first.shape, more.shape, engine.num_generated
    ((8, 2), (8, 2), 16)
    """

    def __init__(
        self,
        d: int,
        *,
        latin: bool = True,
        effort: EffortName = "balanced",
        optimization: str | None = None,
        rng: Any = None,
    ) -> None:
        self._initialize(d, optimization=optimization, rng=rng)
        self._latin = latin
        self._effort = effort
        self._points: NDArray[np.float64] = np.empty((0, d))

    def _random(self, n: int = 1, *, workers: int = 1) -> NDArray[np.float64]:
        found = design(n, self.d, latin=self._latin, existing=self._points, effort=self._effort, rng=self.rng)
        self._points = np.concatenate([self._points, found.unit_points])
        return found.unit_points.copy()

    def reset(self) -> CVTDesign:
        """Forget all points, and go back to the seed."""
        super().reset()
        self._points = np.empty((0, self.d))
        return self
