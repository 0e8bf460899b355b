"""Widgets that divide images: segments, superpixels, and hierarchies of regions."""

from typing import Any, Literal

import numpy as np
from magicgui import magic_factory
from magicgui.widgets import Container, PushButton, Slider, create_widget
from napari.layers import Image, Labels
from napari.qt.threading import FunctionWorker, thread_worker
from napari.types import LayerDataTuple
from napari.viewer import Viewer
from numpy.typing import NDArray

import cvtimg
from cvtimg.segmentation import RegionHierarchy
from cvtimg_napari.planes import Planes, number_apart, placed, shown_part

Space = Literal["rgb", "linear", "lab", "oklab"]
#: The slider of a hierarchy begins with so many regions.
_FIRST_CUT = 20


@magic_factory(
    call_button="Segment",
    n_segments={"label": "Segments", "min": 1, "max": 65536},
    smallest_detail={"label": "Smallest detail", "min": 0, "max": 1000},
    min_size={"label": "Least size", "max": 1 << 30},
    components={"label": "Connected components"},
    together={"label": "Same segments in all planes"},
)
def segment(
    image: Image,
    n_segments: int = 3,
    space: Space = "rgb",
    smallest_detail: float = 1,
    min_size: int = 0,
    components: bool = False,
    together: bool = False,
    mask: Labels | None = None,
) -> FunctionWorker[LayerDataTuple]:
    """Divide an image into segments of similar color, numbered from dark to bright."""
    if together and (min_size or components):
        raise ValueError("the same segments in all planes exclude least sizes and components")
    options: dict[str, Any] = {"space": space, "min_size": min_size, "components": components}
    options |= {"edge_weight": 0} if together else {"smallest_detail": smallest_detail}

    @thread_worker(start_thread=True)
    def work() -> LayerDataTuple:
        def divide(plane: NDArray[Any], inside: NDArray[np.bool_] | None) -> NDArray[np.int32]:
            return cvtimg.segment(plane, n_segments, mask=inside, **options).labels

        planes = Planes.of(image)
        masks = _masks(mask, len(planes.arrays))
        if together:
            parts = [shown_part(*pair) for pair in zip(planes.arrays, masks, strict=True)]
            colors = np.concatenate([part for part, _ in parts])
            inside = None if parts[0][1] is None else np.concatenate([known for _, known in parts])
            labels = np.split(divide(colors, inside), len(parts))
        else:
            labels = [divide(*shown_part(*pair)) for pair in zip(planes.arrays, masks, strict=True)]
            labels = number_apart(labels) if components else labels
        return planes.put_together(labels), placed(image, "segments", "labels", n_segments=n_segments), "labels"

    return work()


@magic_factory(call_button="Find superpixels", n_superpixels={"label": "Superpixels", "min": 1, "max": 1 << 24})
def superpixels(
    image: Image, n_superpixels: int = 400, space: Space = "rgb", mask: Labels | None = None
) -> FunctionWorker[LayerDataTuple]:
    """Divide an image into about so many connected superpixels of similar size in each plane."""

    @thread_worker(start_thread=True)
    def work() -> LayerDataTuple:
        planes, labels = Planes.of(image), []
        for pair in zip(planes.arrays, _masks(mask, len(planes.arrays)), strict=True):
            plane, inside = shown_part(*pair)
            found = cvtimg.superpixels(plane, n_superpixels, space=space, mask=inside)
            labels.append(found.labels)
        return planes.put_together(number_apart(labels)), placed(image, "superpixels", "labels"), "labels"

    return work()


class Hierarchy(Container):
    """Regions as people see them: computed once, then cut into as many as the slider says; and edges."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._planes: Planes | None = None
        self._trees: list[RegionHierarchy] = []
        self._labels: Labels | None = None
        self.image = create_widget(annotation=Image, label="image")
        self.run = PushButton(text="Find regions")
        self.n_regions = Slider(label="Regions", value=_FIRST_CUT, min=1, max=_FIRST_CUT, enabled=False)
        super().__init__(widgets=[self.image, self.run, self.n_regions])
        self.run.clicked.connect(self.find)
        self.n_regions.changed.connect(self.cut)

    def find(self) -> FunctionWorker[Any]:
        """Compute the hierarchy of each plane."""
        layer = self.image.value

        @thread_worker(connect={"returned": self._show}, start_thread=True)
        def work() -> tuple[Image, Planes, list[RegionHierarchy]]:
            planes, trees = Planes.of(layer), []
            for plane in planes.arrays:
                colors, inside = shown_part(plane, None)
                trees.append(cvtimg.segment_hierarchy(colors, mask=inside))
            return layer, planes, trees

        return work()

    def cut(self) -> None:
        """Show as many regions in each plane as the slider says."""
        if self._labels is not None and self._planes is not None:
            self._labels.data = self._planes.put_together(self._cuts())

    def _cuts(self) -> list[NDArray[np.int32]]:
        wanted = self.n_regions.value
        return number_apart(tree.cut(int(np.clip(wanted, tree.n_parts, tree.n_leaves))) for tree in self._trees)

    def _show(self, found: tuple[Image, Planes, list[RegionHierarchy]]) -> None:
        layer, self._planes, self._trees = found
        self._labels = None
        self.n_regions.max = max(tree.n_leaves for tree in self._trees)
        self.n_regions.enabled = True
        data = self._planes.put_together(self._cuts())
        chances = self._planes.put_together([tree.find_edges(strength=True) for tree in self._trees])
        self._viewer.add_image(chances, visible=False, **placed(layer, "edges", "image"))
        self._labels = self._viewer.add_labels(data, **placed(layer, "regions", "labels"))


def _masks(mask: Labels | None, n_planes: int) -> tuple[NDArray[Any] | None, ...]:
    """Return the plane of a mask for each plane of an image; a mask of one plane is for all."""
    if mask is None:
        return (None,) * n_planes
    planes = Planes.of(mask).arrays
    if len(planes) not in (1, n_planes):
        raise ValueError(f"{mask.name} must have 1 or {n_planes} planes, and has {len(planes)}")
    return planes * (n_planes // len(planes))
