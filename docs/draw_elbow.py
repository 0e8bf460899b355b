"""Draw the energy curves of sample images with their elbows: ``python docs/draw_elbow.py``."""

from pathlib import Path

import cvtimg
from cvtimg.plotting.energy_curves import Plotted, draw_curves

ROOT = Path(__file__).parent.parent


def main() -> None:
    """Write docs/elbow.png."""
    plotted = []
    for name in ("coffee.png", "astronaut.png", "drawing.png", "bone_texture.png"):
        image = cvtimg.read_image(ROOT / "sample_images" / name)
        curve = cvtimg.energy_curve(image, 64)
        plotted.append(Plotted(Path(name).stem, curve, curve.elbow(), image))
    (ROOT / "docs" / "elbow.png").write_bytes(draw_curves(plotted, ".png"))


if __name__ == "__main__":
    main()
