"""Surfaces with a name."""

from __future__ import annotations

import numpy as np

from cvtimg._shared.checks import check_in_range, check_positive
from cvtimg.surfaces.implicit import ImplicitSurface
from cvtimg.surfaces.triangulation import Points


def torus(major: float = 1.0, minor: float = 0.4) -> ImplicitSurface:
    """Make a torus around the z axis.

    Parameters
    ----------
    major : float
        Radius of the circle in the middle of the tube.
    minor : float
        Radius of the tube, less than `major`.

    Returns
    -------
    ImplicitSurface

    Examples
    --------
    >>> from cvtimg.surfaces import torus
    >>> torus().triangulation.euler_characteristic
    0
    """
    major, minor = check_positive("major", major), check_positive("minor", minor)
    check_in_range("minor", minor, minor < major, f"less than major={major}")

    def distance(points: Points) -> Points:
        return np.asarray(np.hypot(np.hypot(points[:, 0], points[:, 1]) - major, points[:, 2]) - minor)

    def gradient(points: Points) -> Points:
        around = np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-300)
        middle = np.stack([points[:, 0] / around, points[:, 1] / around, np.zeros(len(points))], axis=1)
        steps = points - major * middle
        return np.asarray(steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-300))

    reach = np.array([major + minor, major + minor, minor]) + 0.1 * minor
    return ImplicitSurface(distance, -reach, reach, gradient=gradient, spacing=minor / 6)
