"""Draw docs/napari.webp: the window of napari with the widget of hierarchies.

python docs/draw_napari.py

Needs napari with Qt, plugins/cvtimg-napari, and a display (``xvfb-run`` makes one).
"""

import time
from pathlib import Path

import figures
import napari
from cvtimg_napari.segments import Hierarchy
from qtpy.QtWidgets import QApplication

import cvtimg

SAMPLES = Path(__file__).parent.parent / "sample_images"


def wait(seconds: float) -> None:
    """Let the window draw itself."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        QApplication.processEvents()
        time.sleep(0.01)


def main() -> None:
    """Open an image, find its regions, cut them, and take a picture of the window."""
    viewer = napari.Viewer(show=True)
    viewer.window.resize(1280, 800)
    viewer.add_image(cvtimg.read_image(SAMPLES / "coffee.png"), name="coffee")
    widget = Hierarchy(viewer)
    viewer.window.add_dock_widget(widget, name="Hierarchy of regions", area="right")
    widget.image.reset_choices()
    widget.find()
    while len(viewer.layers) < 2:
        wait(0.1)
    widget.n_regions.value = 30
    viewer.layers[-1].opacity = 0.5
    wait(2)
    viewer.reset_view()
    wait(2)
    figures.write("napari", viewer.screenshot(canvas_only=False, flash=False)[..., :3])


if __name__ == "__main__":
    main()
