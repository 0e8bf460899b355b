"""Widgets about colors: an image in few of them, and how many it has."""

from io import BytesIO
from typing import Any, Literal

import numpy as np
from magicgui import magic_factory
from magicgui.widgets import CheckBox, Container, Label, PushButton, SpinBox, create_widget
from magicgui.widgets import Image as Picture
from napari.layers import Image
from napari.qt.threading import FunctionWorker, thread_worker
from napari.types import LayerDataTuple
from napari.viewer import Viewer

import cvtimg
from cvtimg.pictures import Frames
from cvtimg_napari.planes import Planes, placed, shown_part

Space = Literal["rgb", "linear", "lab", "oklab"]
Dither = Literal["none", "floyd-steinberg", "edge-aware", "blue-noise"]


@magic_factory(
    call_button="Quantize",
    n_colors={"label": "Colors", "min": 1, "max": 65536},
    together={"label": "Same colors in all planes"},
)
def quantize(
    image: Image, n_colors: int = 16, space: Space = "rgb", dither: Dither = "none", together: bool = True
) -> FunctionWorker[LayerDataTuple]:
    """Show an image in the colors that represent it with the least error."""

    @thread_worker(start_thread=True)
    def work() -> LayerDataTuple:
        planes = Planes.of(image)
        found = cvtimg.quantize_frames(
            Frames(planes.arrays, (0.0,) * len(planes.arrays), 1),
            n_colors,
            per_frame=not together,
            alpha=image.rgb and planes.arrays[0].shape[2] == 4,
            space=space,
            dither=None if dither == "none" else dither,
        )
        data = planes.put_together([one.image for one in found.results])
        palettes = [one.palette for one in found.results]
        attributes = placed(
            image, f"in {n_colors} colors", "image",
            palette=palettes[0] if together else palettes, mse=found.mse, psnr=found.psnr,
        )  # fmt: skip
        return data, attributes, "image"

    return work()


class Elbow(Container):
    """How many colors or segments an image has: the elbow of its energy, and its curve if matplotlib is installed."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self.image = create_widget(annotation=Image, label="image")
        self.n_max = SpinBox(label="At most", value=32, min=3, max=1024)
        self.together = CheckBox(label="All planes together", value=False)
        self.run = PushButton(text="Find the elbow")
        self.answer = Label(value="")
        self.curve = Picture(visible=False)
        super().__init__(widgets=[self.image, self.n_max, self.together, self.run, self.answer, self.curve])
        self.run.clicked.connect(self.find)

    def find(self) -> FunctionWorker[Any]:
        """Compute the curve of the plane that is shown, or of all planes."""
        layer, n_max, together = self.image.value, self.n_max.value, self.together.value
        shown = self._viewer.dims.current_step

        @thread_worker(connect={"returned": self._show}, start_thread=True)
        def work() -> tuple[str, Any]:
            planes = Planes.of(layer)
            at = tuple(shown[len(shown) - len(planes.axes) - 2 : len(shown) - 2])
            plane = planes.one_below_the_other if together else planes.arrays[_index(at, planes.axes)]
            colors, known = shown_part(plane, None)
            curve = cvtimg.energy_curve(colors if known is None else colors[known][np.newaxis], n_max)
            return layer.name, curve

        return work()

    def _show(self, found: tuple[str, Any]) -> None:
        name, curve = found
        k = curve.elbow()
        self.answer.value = f"{name}: {k} (explains {curve.explained[k - 1]:.1%} of the variance)"
        try:
            from cvtimg.plotting import Plotted, draw_curves

            content = draw_curves([Plotted(name, curve, k, None)], ".png")
        except ImportError:
            return
        from PIL import Image as PillowImage

        self.curve.value = np.asarray(PillowImage.open(BytesIO(content)).convert("RGB"))
        self.curve.visible = True


def _index(at: tuple[int, ...], axes: tuple[int, ...]) -> int:
    return int(np.ravel_multi_index(np.minimum(at, np.array(axes) - 1), axes)) if axes else 0
