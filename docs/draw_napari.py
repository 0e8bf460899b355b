"""Draw the figure of docs/napari.md: the widget that counts objects, on the stack of the tutorial.

    xvfb-run -s "-screen 0 1400x900x24" python docs/draw_napari.py

Needs napari with Qt, the plugin, and a screen, which may be virtual.
"""

from __future__ import annotations

import runpy
import time
from collections.abc import Callable
from pathlib import Path

import napari
import numpy as np
from cvtimg_napari.objects import CountObjects
from napari.qt import get_qapp
from PIL import Image

DOCS = Path(__file__).parent
GALLERY = DOCS.parent / "examples" / "gallery"


def main() -> None:
    """Count the nuclei, and write what the window shows."""
    stack = runpy.run_path(str(GALLERY / "plot_stack.py"))["stack"]
    viewer = napari.Viewer()
    image = viewer.add_image(stack, name="nuclei", scale=(1.5, 0.5, 0.5), units=("micrometer",) * 3)
    widget = CountObjects(viewer)
    viewer.window.add_dock_widget(widget, name="Count objects")
    widget.image.choices = [image]
    widget.in_volume.value = True
    widget.count()
    wait(lambda: len(viewer.layers) == 2, 60)
    viewer.dims.set_current_step(0, 12)
    viewer.scale_bar.visible = True
    viewer.window.resize(1300, 800)
    wait(lambda: False, 2)
    shot = Image.fromarray(np.asarray(viewer.screenshot(canvas_only=False)))
    shot.convert("RGB").save(DOCS / "napari.webp", quality=82, method=6)
    viewer.close()


def wait(ready: Callable[[], bool], seconds: float) -> None:
    """Let the window work until something is ready, or so long."""
    end = time.monotonic() + seconds
    while not ready() and time.monotonic() < end:
        get_qapp().processEvents()
        time.sleep(0.01)


if __name__ == "__main__":
    main()
