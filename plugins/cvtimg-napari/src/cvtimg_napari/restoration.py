"""A widget that makes one image of several versions."""

from functools import partial
from typing import Any

from magicgui import magic_factory
from napari import current_viewer
from napari.layers import Image
from napari.qt.threading import FunctionWorker, thread_worker
from napari.types import LayerDataTuple

import cvtimg
from cvtimg_napari.planes import Planes, placed


def _images(widget: Any) -> list[Image]:
    viewer = current_viewer()
    return [] if viewer is None else [layer for layer in viewer.layers if isinstance(layer, Image)]


@magic_factory(
    call_button="Restore",
    versions={"widget_type": "Select", "choices": _images, "label": "Versions"},
    align={"label": "Move versions to the first"},
    detail={"label": "Photographs: keep detail"},
    channels={"label": "Versions of other brightness"},
)
def restore(
    versions: list[Image], align: bool = False, detail: bool = False, channels: bool = False
) -> FunctionWorker[LayerDataTuple]:
    """Make one image of several layers, each noisy or with holes, or of the first axis of one layer."""
    if not versions:
        raise ValueError("select the layers of the versions, or one layer whose first axis has them")
    first, alone = versions[0], len(versions) == 1
    if detail and channels:
        raise ValueError("versions of other brightness have no detail in common: choose one of both")
    work_on = partial(
        cvtimg.denoise if detail else cvtimg.restore, align=align, **({} if detail else {"channels": channels})
    )

    @thread_worker(start_thread=True)
    def work() -> LayerDataTuple:
        planes = [Planes.of(layer) for layer in versions]
        axes = planes[0].axes
        if alone:
            if not axes:
                raise ValueError(f"{first.name} has one plane only: select more layers")
            n_each = len(planes[0].arrays) // axes[0]
            arrays = planes[0].arrays
            planes = [Planes(arrays[at * n_each : (at + 1) * n_each], axes[1:]) for at in range(axes[0])]
        elif len({one.axes for one in planes}) > 1:
            raise ValueError("versions must have the same axes")
        stacks = zip(*(one.arrays for one in planes), strict=True)
        found = [work_on(stack) for stack in stacks]
        attributes = placed(first, "restored", "image", int(alone), shifts=[one.shifts for one in found])
        return planes[0].put_together([one.image for one in found]), attributes, "image"

    return work()
