"""Flat drawings and photographs, told apart: whether few colors explain what versions show."""

from __future__ import annotations

import numpy as np

from cvtimg.engine import tessellate
from cvtimg.restoration.evidence import Evidence
from cvtimg.restoration.versions import fuse

#: Blur, in pixels, that removes most of the noise.
_BLUR = 2.0
#: Colors of a drawing, the share of pixels, those farthest from edges, that must have them, and pixels looked at.
_COLORS, _AWAY_FROM_EDGES, _SAMPLED = 12, 0.5, 1 << 13
#: What colors leave, as a part of the variance of noise: drawings up to 0.6; photographs 3 to 200 if the
#: noise is below 20 levels of 8 bits, and 1 or less if it hides what is faint.
_LEFT = 1.0


def is_drawing(evidence: Evidence) -> bool:
    """Tell whether versions show a drawing in a few flat colors, as far as their noise lets see."""
    from scipy.ndimage import gaussian_gradient_magnitude

    picture, weight = fuse(evidence.placed, evidence.trust, _BLUR)
    slopes = sum(np.square(gaussian_gradient_magnitude(band, 1.0)) for band in np.moveaxis(picture, 2, 0))
    slope = np.asarray(slopes).ravel()
    rows = picture.reshape(slope.size, -1)[slope <= np.quantile(slope, _AWAY_FROM_EDGES)]
    rows = rows[:: -(-len(rows) // _SAMPLED)].astype(np.float64)
    cells = tessellate(rows, min(_COLORS, len(np.unique(rows, axis=0))), effort="fast")
    left = np.square(rows - cells.generators[cells.labels]).mean()
    noise = evidence.variances(evidence.placed)[0] / max(float(weight.mean()), 1e-9) / (4 * np.pi * _BLUR**2)
    rounding = (evidence.placed.rounding / 2) ** 2  # half of what a level of 8 bits is
    return bool(left <= _LEFT * (noise + rounding))
