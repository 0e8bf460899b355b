"""Sheets of paper: where a drawing lies on them, in millimeters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvtimg._shared.checks import check_choice, check_non_negative, check_positive, check_that
from cvtimg._shared.types import Floats

#: Widths and heights of sheets, upright.
PAPERS = {
    "a2": (420.0, 594.0),
    "a3": (297.0, 420.0),
    "a4": (210.0, 297.0),
    "a5": (148.0, 210.0),
    "a6": (105.0, 148.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
    "tabloid": (279.4, 431.8),
}
#: Width of a drawing where neither it nor the paper is known, and the margin on paper.
USUAL_WIDTH, USUAL_MARGIN = 200.0, 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """A sheet of paper with a drawing in its middle."""

    size: tuple[float, float]  # width and height
    corner: Floats  # (2,): where the upper left corner of the drawing lies
    scale: float  # millimeters per pixel

    @classmethod
    def of(
        cls,
        pixels: tuple[int, int],
        *,
        width: float | None = None,
        height: float | None = None,
        paper: str | tuple[float, float] | None = None,
        landscape: bool = False,
        margin: float | None = None,
    ) -> Sheet:
        """Fit a drawing of a height and width in pixels.

        Parameters are as in `Stipples.save`. Without paper, the sheet is as large as the drawing and its margin.
        """
        side = np.array(pixels[::-1], np.float64)
        given = {"width": width, "height": height}
        wanted = np.array([np.inf if at is None else check_positive(name, at, "in mm") for name, at in given.items()])
        border = check_non_negative("margin", (USUAL_MARGIN if paper else 0.0) if margin is None else margin)
        if paper is None:
            check_that("landscape", not landscape, "have a paper")
            scale = float(np.min((wanted if np.isfinite(wanted).any() else [USUAL_WIDTH, np.inf]) / side))
            sheet = scale * side + 2 * border
        else:
            named = PAPERS[check_choice("paper", paper.lower(), PAPERS)] if isinstance(paper, str) else paper
            sheet = np.array([check_positive("paper", at, "in mm") for at in named])
            sheet = np.sort(sheet)[::-1] if landscape else sheet
            check_that(f"margin={border:g}", 2 * border < sheet.min(), f"leave room on {sheet[0]:g} x {sheet[1]:g} mm")
            scale = float((np.minimum(wanted, sheet - 2 * border) / side).min())
        return cls((float(sheet[0]), float(sheet[1])), (sheet - scale * side) / 2, scale)
