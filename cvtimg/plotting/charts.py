"""Charts by matplotlib: designs in pairs of axes, the variance that modes explain, supports of points, and meshes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from inspect import cleandoc
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from cvtimg._shared.extras import optional
from cvtimg._shared.types import Array, Bytes, Floats, Ints
from cvtimg.files.whole import write_whole
from cvtimg.pictures.showing import limits_to_show, shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

#: Suffixes of plots.
PLOT_SUFFIXES = (".png", ".svg")
#: More axes would leave no room for their pairs, and more levels on an axis none for their names.
MOST_AXES = 8
#: Dots per inch of a chart.
_DPI = 150
#: Rows of a table that are drawn; and polygons from which an SVG file would be slower to show than pixels.
_MANY = 20_000
#: The quality from which the color map of triangles begins; few are worse.
POOR = 0.6
_Draw = TypeVar("_Draw", bound=Callable[..., bytes])


def chart(draw: _Draw) -> _Draw:
    """Complete the documentation of a function that draws by what all of them share."""
    returns = 'Returns\n-------\nbytes\n    Content of a file in the format that `suffix` names, ".png" or ".svg".'
    raises = "Raises\n------\nImportError\n    If matplotlib is not installed."
    if draw.__doc__:  # there is none under python -OO
        draw.__doc__ = f"{cleandoc(draw.__doc__)}\n\n{returns}\n\n{raises}\n"
    return draw


@chart
def draw_histograms(values: Mapping[str, Array], suffix: str, n_bins: int = 60) -> bytes:
    """Draw a histogram of each quantity, given by its name and unit, with its quantiles."""
    with figure_file(4.2 * len(values), 3.2, suffix) as (figure, content):
        for axes, (name, of_one) in zip(figure.subplots(1, len(values), squeeze=False)[0], values.items(), strict=True):
            low, middle, high = np.quantile(of_one, (0.01, 0.5, 0.99))
            axes.hist(of_one, bins=n_bins, color="C0")
            axes.axvline(middle, color="C3", linewidth=1)
            axes.set_title(f"median {middle:.4g}, 98 % in {low:.4g} to {high:.4g}", fontsize=8)
            axes.set_xlabel(name)
            axes.set_yticks([])
            axes.spines[["top", "left", "right"]].set_visible(False)
    return content.getvalue()


@chart
def draw_sheet(rows: Sequence[Sequence[tuple[Any, str]]], suffix: str) -> bytes:
    """Draw images side by side in rows, each below its caption.

    Parameters
    ----------
    rows : sequence of sequences of (image, str)
        (H, W) or (H, W, C) arrays with captions. Those of a row that are not of 8 bits are stretched alike from black
        to white, so that they can be compared.
    """
    n_columns, width = max(map(len, rows)), 3.2
    # As high as the highest image of a row, and the lines of its captions.
    heights = [
        max(width * image.shape[0] / image.shape[1] + 0.25 * (1 + caption.count("\n")) for image, caption in row)
        for row in rows
    ]
    with figure_file(width * n_columns, sum(heights), suffix) as (figure, content):
        grid = figure.subplots(len(rows), n_columns, squeeze=False, height_ratios=heights)
        for row, line in zip(rows, grid, strict=True):
            images = [np.reshape(image, (*image.shape[:2], -1)) for image, _ in row]
            limits = limits_to_show(images)
            for image, (_, caption), axes in zip(images, row, line, strict=False):
                # Pixels of small images are seen as they are.
                axes.imshow(shown(image, limits), interpolation="nearest" if image.shape[1] < width * _DPI else None)
                axes.set_title(caption, fontsize=8)
        for axes in grid.flat:
            axes.set(xticks=[], yticks=[], visible=bool(axes.images))
    return content.getvalue()


@chart
def draw_clusters(rows: Array, generators: Array, suffix: str) -> bytes:
    """Draw rows in the colors of their clusters, and the generators, on the first two principal axes of the rows.

    Parameters
    ----------
    rows : (n, d) array
        Of more than 20,000 rows some are drawn.
    generators : (k, d) array
        Each row belongs to the nearest.
    suffix : {".png", ".svg"}
        Format of the file.
    """
    some = rows[:: -(-len(rows) // _MANY)].astype(np.float64)
    middle = some.mean(axis=0)
    _, lengths, axes = np.linalg.svd(some - middle, full_matrices=False)
    squares = np.square(generators).sum(axis=1)
    labels = (squares - 2 * some @ generators.T).argmin(axis=1)
    shares = np.append(lengths**2, 0) / max(float(np.square(lengths).sum()), np.finfo(np.float64).tiny)
    plane = np.zeros((some.shape[1], 2))
    plane[:, : len(axes)] = axes[:2].T
    with figure_file(5, 5, suffix) as (figure, content):
        plot = figure.subplots()
        x, y = ((some - middle) @ plane).T
        plot.scatter(x, y, c=labels, s=6, cmap="tab20")
        x, y = ((generators - middle) @ plane).T
        plot.scatter(x, y, c="black", marker="x")
        plot.set_xlabel(f"first principal axis, {shares[0]:.0%} of the variance")
        plot.set_ylabel(f"second, {shares[1]:.0%}")
    return content.getvalue()


@chart
def draw_pairs(
    points: Array,
    names: Sequence[str],
    suffix: str,
    existing: Array | None = None,
    levels: Sequence[Sequence[str]] | None = None,
) -> bytes:
    """Draw points in each pair of axes, and how many lie in each tenth of an axis.

    Parameters
    ----------
    points : (n, d) array
        Of more than 8 axes the first 8 are drawn.
    names : sequence of str
        Names of the axes.
    existing : (L, d) array, optional
        Points to show in another color.
    levels : sequence of d sequences of str, optional
        Names of levels that share an axis from 0 to 1 evenly; none for other axes.
    """
    n_axes = min(points.shape[1], MOST_AXES)
    with figure_file(max(1.6 * n_axes, 4.0), max(1.6 * n_axes, 4.0), suffix) as (figure, content):
        grid = figure.subplots(n_axes, n_axes, squeeze=False, sharex="col")
        for (down, right), axes in np.ndenumerate(grid):
            axes.tick_params(labelsize=6)
            if down == right:
                shown = [points[:, right], *([] if existing is None else [existing[:, right]])]
                axes.hist(shown, bins=10, stacked=True, rwidth=0.8, color=["C0", "C3"][: len(shown)], alpha=0.5)
                axes.locator_params(axis="y", integer=True, nbins=4)
            elif down > right:
                axes.plot(points[:, right], points[:, down], ".", color="C0", markersize=4, label="new")
                if existing is not None:
                    axes.plot(existing[:, right], existing[:, down], "x", color="C3", markersize=4, label="existing")
            else:
                axes.set_axis_off()
            if levels is not None and levels[right]:
                axes.set_xticks(*_ticks(levels[right]))
            if levels is not None and levels[down] and down > right:
                axes.set_yticks(*_ticks(levels[down]))
            if down == n_axes - 1:
                axes.set_xlabel(names[right], fontsize=8)
            if right == 0:
                axes.set_ylabel(names[down] if down else "points", fontsize=8)
        if existing is not None and n_axes > 1:
            handles, _ = grid[1, 0].get_legend_handles_labels()
            figure.legend(handles, ["new", "existing"], loc="upper right", fontsize=9)
    return content.getvalue()


def _ticks(levels: Sequence[str]) -> tuple[list[float], list[str]]:
    """Return where some of the levels are on their axis, and their names."""
    every = -(-len(levels) // MOST_AXES)
    return [(level + 0.5) / len(levels) for level in range(0, len(levels), every)], list(levels[::every])


@chart
def draw_spectrum(energies: Floats, variance: float, suffix: str) -> bytes:
    """Draw the share of the variance that the first 0, 1, .. n modes leave unexplained, as energies of `Basis`."""
    with figure_file(6.0, 3.6, suffix) as (figure, content):
        axes = figure.subplots()
        shares = energies / variance if variance else np.zeros(len(energies))
        axes.semilogy(np.arange(len(shares)), np.maximum(shares, 1e-16), ".-")
        axes.locator_params(axis="x", integer=True)
        axes.set_xlabel("modes")
        axes.set_ylabel("share of the variance not explained")
        axes.grid(alpha=0.3)
    return content.getvalue()


@chart
def draw_supports(points: Floats, radii: Floats, suffix: str, lines: Sequence[Floats] = ()) -> bytes:
    """Draw disks of (n,) radii around (n, 2) points of the plane, and boundaries as lines, (k, 2) arrays."""
    with figure_file(6.0, 6.0, suffix) as (figure, content):
        from matplotlib.collections import PatchCollection
        from matplotlib.patches import Circle

        axes = figure.subplots()
        disks = [Circle(point, radius) for point, radius in zip(points.tolist(), radii, strict=True)]
        axes.add_collection(PatchCollection(disks, facecolor="C0", edgecolor="C0", alpha=0.12, linewidth=0.5))
        axes.add_collection(PatchCollection(disks, facecolor="none", edgecolor="C0", linewidth=0.4))
        axes.plot(*points.T, ".", color="0.2", markersize=3)
        for line in lines:
            axes.plot(*np.asarray(line).T, color="C3", linewidth=1.5)
        axes.set_aspect("equal")
        axes.autoscale_view()
    return content.getvalue()


@chart
def draw_mesh(
    points: Floats,
    triangles: Ints,
    qualities: Floats,
    edges: Ints,
    suffix: str,
    *,
    image: Bytes | None = None,
    y_down: bool = False,
) -> bytes:
    """Draw a mesh, its triangles colored by quality and its borders bold.

    Parameters
    ----------
    points, triangles, edges
        As in `cvtimg.meshes.Mesh`.
    qualities : (T,) array
        Of the triangles, from 0 to 1.
    image : (H, W) or (H, W, 3) uint8 array, optional
        Shown below the mesh, which then is transparent; coordinates are in its pixels.
    y_down : bool
        Whether y points down, as in images.
    """
    from matplotlib.collections import LineCollection

    low, high = points.min(axis=0), points.max(axis=0)
    height = float(7.6 * np.clip((high[1] - low[1]) / (high[0] - low[0]), 1 / 3, 4 / 3))
    with figure_file(9.0, height, suffix) as (figure, content):
        axes = figure.subplots()
        if image is not None:
            axes.imshow(image, extent=(0, image.shape[1], image.shape[0], 0), cmap="gray", vmin=0, vmax=255)
        alpha = 0.45 if image is not None else 1.0
        look: Any = {"array": qualities, "cmap": "viridis", "clim": (POOR, 1.0), "edgecolors": "0.15", "alpha": alpha}
        drawn = add_polygons(figure, axes, list(points[triangles]), **look)
        axes.add_collection(LineCollection(list(points[edges]), colors="black", linewidths=1.2))
        show_box(axes, low, high, y_down=y_down)
        figure.colorbar(drawn, ax=axes, label="quality 2 r / R", shrink=0.6)
    return content.getvalue()


def add_polygons(
    figure: Figure, axes: Axes, outlines: Sequence[Any], *, thickest: float = 0.6, shares: object = 1.0, **look: Any
) -> PolyCollection:
    """Add polygons with edges of a twentieth of their size, but at most so thick, in points, and in shares of that."""
    from matplotlib.collections import PolyCollection

    size = 72 * figure.get_figwidth() / max(len(outlines), 1) ** 0.5
    look |= {"linewidths": shares * min(size / 20, thickest), "rasterized": len(outlines) > _MANY}
    drawn = PolyCollection(outlines, **look)
    axes.add_collection(drawn)
    return drawn


def show_box(axes: Axes, low: Array, high: Array, *, y_down: bool = False) -> None:
    """Show a box of the plane in equal units, with a margin."""
    margin = 0.01 * max(high - low)
    axes.set_aspect("equal")
    axes.set_xlim(low[0] - margin, high[0] + margin)
    ends = (low[1] - margin, high[1] + margin)
    axes.set_ylim(ends[::-1] if y_down else ends)


def save_plot(path: Path, draw: Callable[..., bytes], *arguments: Any, overwrite: bool = False, **more: Any) -> None:
    """Write what a function of this package, such as `draw_mesh`, draws of its arguments; .png or .svg."""
    write_whole(path, draw(*arguments, suffix=path.suffix.lower(), **more), overwrite=overwrite)


@contextmanager
def figure_file(width: float, height: float, suffix: str) -> Iterator[tuple[Figure, BytesIO]]:
    """Give a figure to draw on; its file is written when the block ends."""
    matplotlib, content = optional("matplotlib", "plot", "plots need"), BytesIO()
    from matplotlib.figure import Figure

    # Text stays text in an SVG, and equal charts have equal bytes.
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "cvtimg"}):
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure, content
        metadata = {"Date": None} if suffix == ".svg" else None
        figure.savefig(content, format=suffix[1:], dpi=_DPI, metadata=metadata)
