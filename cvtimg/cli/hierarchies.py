"""Trees of regions on the command line: a cut as the segments of an image, and outputs of the tree."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cvtimg.pictures import Metadata
    from cvtimg.segmentation import RegionHierarchy

#: Numbers of regions on a sheet of cuts.
SHOWN_CUTS = (5, 10, 20, 50)


def write_tree(
    hierarchy: RegionHierarchy, image: NDArray[Any], path: Path, place: Metadata | None, overwrite: bool
) -> None:
    """Write the tree itself."""
    hierarchy.save(path, overwrite=overwrite)


def write_strengths(
    hierarchy: RegionHierarchy, image: NDArray[Any], path: Path, place: Metadata | None, overwrite: bool
) -> None:
    """Write the strengths of borders: as they are, or as a picture in 8 bits with 1 and more in white."""
    import numpy as np

    from cvtimg import write_image

    strengths = hierarchy.contour_map()
    if path.suffix.lower() == ".png":
        strengths = np.rint(255 * np.minimum(strengths, 1)).astype(np.uint8)
    write_image(path, strengths, metadata=place, overwrite=overwrite)


def write_cuts(
    hierarchy: RegionHierarchy, image: NDArray[Any], path: Path, place: Metadata | None, overwrite: bool
) -> None:
    """Write a sheet of cuts: their borders over the image, and the regions in their mean colors."""
    import numpy as np

    from cvtimg import write_image
    from cvtimg.labels import region_means
    from cvtimg.plotting.sheets import Panel, contact_sheet, draw_edges, shown_colors

    drawn, flat = [], []
    for number in sorted({min(max(n, hierarchy.n_parts), hierarchy.n_leaves) for n in SHOWN_CUTS}):
        labels = hierarchy.cut(number)
        colors = shown_colors(np.nan_to_num(region_means(labels, image)), image, labels, ignore=0)
        drawn.append(Panel(draw_edges(image, labels, ignore=0), (f"{number} regions",)))
        flat.append(Panel(colors[labels]))
    write_image(path, contact_sheet([drawn, flat]), overwrite=overwrite)


#: Registry of the outputs that only a hierarchy has, with their writers.
WRITERS: dict[str, Callable[[RegionHierarchy, NDArray[Any], Path, Metadata | None, bool], None]] = {
    "tree": write_tree,
    "strengths": write_strengths,
    "cuts": write_cuts,
}
