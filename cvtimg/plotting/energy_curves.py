"""Plots of energy curves: log E over log k for each image, its elbow, and the image at a few k along the curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import says_alpha, with_mark
from cvtimg._shared.types import Array
from cvtimg.colors.places import from_places
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.pictures.showing import natural_limits, shown
from cvtimg.plotting.charts import chart, figure_file
from cvtimg.quantization.images import quantize

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Numbers of generators at which an image is shown, in addition to the one picked.
_POWERS = tuple(1 << power for power in range(1, 7))
#: Width of the figure in inches.
_WIDTH = 8.0


@dataclass(frozen=True, slots=True, eq=False)
class Plotted:
    """One curve of a plot: its name, the k to mark, and the (H, W) or (H, W, C) image; None for a table."""

    name: str
    curve: EnergyCurve
    k: int
    image: Array | None = None
    space: SpaceName = "rgb"


@chart
def draw_curves(plotted: Sequence[Plotted], suffix: str, rule: str = "chord") -> bytes:
    """Plot curves and return the bytes of a file.

    Parameters
    ----------
    plotted : sequence of Plotted
        Energies are shown relative to E(1), so that images can be compared. The curve ends where E(k) is 0.
    rule : str
        Name of the rule that picked k, for the legend.
    """
    rows = [item for item in plotted if item.image is not None][:4]  # more would leave no room for the curves
    n_max = max(item.curve.n_max for item in plotted)
    n_columns = 2 + sum(k <= n_max for k in _POWERS)
    shapes = [np.asarray(item.image).shape for item in rows]
    heights = [*(min(_WIDTH / n_columns * shape[0] / shape[1], 2.0) + 0.35 for shape in shapes), 0.5 * _WIDTH]
    with figure_file(_WIDTH, sum(heights) + 0.3, suffix) as (figure, content):
        parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
        for number, (part, item) in enumerate(zip(parts, rows, strict=False)):
            _draw_thumbnails(part.subplots(1, n_columns, squeeze=False)[0], item, f"C{number}")
        order = [*rows, *(item for item in plotted if item not in rows)]
        _draw_axes(parts[-1].subplots(), order, n_max, rule)
    return content.getvalue()


def _draw_thumbnails(axes: Sequence[Axes], item: Plotted, color: str) -> None:
    """Show an image at the k that was picked, in a frame of the color of its curve, at other k, and as it is."""
    assert item.image is not None
    # Every n-th pixel: a filter would add colors that the image does not have.
    step = -(-max(item.image.shape[:2]) // 160)
    small = with_mark(np.ascontiguousarray(item.image[::step, ::step]), says_alpha(item.image))
    limits = natural_limits(_bands(small))
    others = [k for k in _POWERS if k <= item.curve.n_max and k != item.k]
    for place in axes:
        place.set(xticks=[], yticks=[])
        place.axis("off")
    for place, k in zip(axes, [item.k, *others, 0], strict=False):
        place.axis("on")
        place.spines[:].set_visible(k == item.k)
        place.spines[:].set(color=color, linewidth=2.5)
        reduced = small
        if k:
            colors = from_places(item.curve.generators[k - 1], item.space, small.dtype, says_alpha(small))
            reduced = quantize(small, palette=colors, space=item.space).image
        place.imshow(shown(_bands(reduced), limits), interpolation="nearest")
        text = "original" if k == 0 else f"k = {k}"
        place.set_title(text, fontsize=8, pad=3, color=color if k == item.k else "black")


def _draw_axes(axes: Axes, plotted: Sequence[Plotted], n_max: int, rule: str) -> None:
    for number, item in enumerate(plotted):
        first = item.curve.energies[0] or 1.0
        shares = np.where(item.curve.energies > 0, item.curve.energies / first, np.nan)
        color = f"C{number % 10}"
        label = f"{item.name}: " + (item.curve.verdict if rule == "chord" else f"{item.k} by {rule}")
        axes.plot(np.arange(1, len(shares) + 1), shares, color=color, marker=".", markersize=4, label=label)
        if np.isfinite(shares[item.k - 1]):
            axes.plot(item.k, shares[item.k - 1], "o", color=color, markersize=11, markerfacecolor="none", mew=2)
        else:
            axes.axvline(item.k, color=color, linestyle=":")  # the energy is 0 there, which no logarithm shows
    axes.set_xscale("log", base=2)
    if any(item.curve.energies[0] for item in plotted):
        axes.set_yscale("log")
    ticks = [1 << power for power in range(n_max.bit_length())]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.set_xlabel("generators k")
    axes.set_ylabel("energy E(k) / E(1)")
    axes.grid(visible=True, which="major", alpha=0.3)
    if len(plotted) <= 20:
        axes.legend(fontsize=8)


def _bands(image: Array) -> Array:
    """(H, W, C) image; a fourth band that is not alpha is not shown."""
    bands = np.asarray(image).reshape(*image.shape[:2], -1)
    return bands[..., :3] if bands.shape[2] == 4 and not says_alpha(image) else bands
