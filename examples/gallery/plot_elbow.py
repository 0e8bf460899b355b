"""
The elbow of the energy
=======================

Energy against the number of colors for a drawing, a texture and a photograph. Rings mark the elbow, the number that
``-k auto`` picks. The drawing has exactly six colors: its energy is 0 there, which a logarithmic axis cannot show.
"""

from pathlib import Path

import cvtimg
from cvtimg.plotting import Plotted, draw_curves

SAMPLES = Path("../../sample_images")

# %%
# One call computes the energies of all numbers of colors.

plotted = []
for name in ("drawing.png", "bone_texture.png", "coffee.png"):
    image = cvtimg.read_image(SAMPLES / name)
    curve = cvtimg.energy_curve(image, 64)
    plotted.append(Plotted(Path(name).stem, curve, curve.elbow(), image))

figure = draw_curves(plotted, ".png")
