"""
The elbow of the energy
=======================

Energy against the number of colors for two photographs, a drawing and a texture. Rings mark the elbow, the number that
``-k auto`` picks. The drawing has exactly six colors: its energy is 0 there, which a logarithmic axis cannot show.
"""

from pathlib import Path

import cvtimg
from cvtimg.plotting import Plotted, draw_curves

SAMPLES = Path("../../sample_images")

# %%
# One call computes the energies of all numbers of colors.

plotted = []
for name in ("coffee.png", "astronaut.png", "drawing.png", "bone_texture.png"):
    image = cvtimg.read_image(SAMPLES / name)
    curve = cvtimg.energy_curve(image, 64)
    plotted.append(Plotted(Path(name).stem, curve, curve.elbow(), image))

figure = draw_curves(plotted, ".png")
