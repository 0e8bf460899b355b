"""A widget that counts objects, in planes or in volumes, and measures them in a table."""

from typing import Any

import numpy as np
from magicgui.widgets import CheckBox, Container, PushButton, Table, create_widget
from napari.layers import Image, Labels
from napari.qt.threading import FunctionWorker, thread_worker
from napari.viewer import Viewer
from numpy.typing import NDArray

from cvtimg.labels import region_table
from cvtimg.pictures import PixelSize
from cvtimg.segmentation import count_objects
from cvtimg_napari.planes import Planes, number_apart, placed, shown_part

_Rows = dict[str, NDArray[Any]]


class CountObjects(Container):
    """Objects before a background, without settings: labels, and a table of measures in the units of the layer."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._labels: Labels | None = None
        self.image = create_widget(annotation=Image, label="image")
        self.in_volume = CheckBox(text="In volumes: the axis before the last two is depth")
        self.run = PushButton(text="Count")
        self.table = Table()
        super().__init__(widgets=[self.image, self.in_volume, self.run, self.table])
        self.run.clicked.connect(self.count)

    def count(self) -> FunctionWorker[Any]:
        """Count in the background, then show labels and the table."""
        layer, in_volume = self.image.value, self.in_volume.value

        @thread_worker(connect={"returned": self._show}, start_thread=True)
        def work() -> tuple[Image, NDArray[np.int32], _Rows]:
            planes = Planes.of(layer)
            labels, rows = (_in_volumes if in_volume else _in_planes)(planes, layer)
            return layer, planes.put_together(labels), rows

        return work()

    def _show(self, found: tuple[Image, NDArray[np.int32], _Rows]) -> None:
        layer, labels, rows = found
        attributes = placed(layer, "objects", "labels", n_objects=len(rows["label"]))
        features = {"index": rows["label"], **rows}
        self._labels = self._viewer.add_labels(labels, **attributes, features=features)
        self.table.value = {name: column.tolist() for name, column in rows.items()}


def _in_planes(planes: Planes, layer: Image) -> tuple[list[NDArray[np.int32]], _Rows]:
    """Count in each plane."""
    parts = [shown_part(plane, None) for plane in planes.arrays]
    labels = number_apart(count_objects(colors, mask=known).labels for colors, known in parts)
    size = _pixel_size(layer)
    tables = [region_table(own, colors, pixel_size=size) for own, (colors, _) in zip(labels, parts, strict=True)]
    return labels, _joined(tables, planes.axes)


def _in_volumes(planes: Planes, layer: Image) -> tuple[list[NDArray[np.int32]], _Rows]:
    """Count in the volume of each time."""
    if not planes.axes:
        raise ValueError(f"{layer.name} has one plane only, which is no volume")
    depth = planes.axes[-1]
    starts = range(0, len(planes.arrays), depth)
    volumes = [np.stack([shown_part(one, None)[0] for one in planes.arrays[at : at + depth]]) for at in starts]
    spacing = tuple(map(float, layer.scale[-3:]))
    labels = number_apart(count_objects(volume, spacing=spacing).labels for volume in volumes)
    size = _pixel_size(layer)
    tables = [region_table(own, volume, pixel_size=size) for own, volume in zip(labels, volumes, strict=True)]
    return [plane for own in labels for plane in own], _joined(tables, planes.axes[:-1])


def _pixel_size(layer: Image) -> PixelSize | None:
    """Return the size of a pixel, if the layer has one."""
    depth = float(layer.scale[-3]) if layer.ndim > 2 else None
    return PixelSize.named(float(layer.scale[-1]), float(layer.scale[-2]), str(layer.units[-1]), depth)


def _joined(tables: list[_Rows], axes: tuple[int, ...]) -> _Rows:
    """Put tables below each other, with the place of each along the axes."""
    places = list(np.ndindex(*axes))
    rows = {
        f"axis_{axis}": np.concatenate(
            [np.full(len(own["label"]), at[axis]) for own, at in zip(tables, places, strict=True)]
        )
        for axis in range(len(axes))
    }
    return rows | {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
