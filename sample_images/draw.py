"""Draw the synthetic sample images.

Some examples need an image with a known truth: a gray two-phase texture to segment, and a flat drawing beside damaged
copies of it to restore. They are drawn here, so anyone may use them and see how they were made. Seeds are fixed: a
second run with the same libraries writes the same bytes.

Run it from anywhere: ``python sample_images/draw.py``.
"""

# scikit-image is only half annotated: its drawing functions and filters have no types.
# mypy: allow-untyped-calls

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from skimage.draw import disk, ellipse, line, polygon
from skimage.filters import gaussian
from skimage.morphology import dilation
from skimage.morphology import disk as round_brush

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Mask = NDArray[np.bool_]

FOLDER = Path(__file__).resolve().parent

BONE_SIDE = 256
BONE_SEED = 2

DRAWING_SHAPE = (192, 256)
# Channels keep away from 0 and 255, because noise that clips there shifts the mean of a region, and
# averaging many noisy pixels no longer gives quite the true color back.
SKY = (128, 184, 216)
SUN = (216, 192, 72)
HILL = (136, 176, 88)
WALL = (216, 208, 184)
ROOF = (160, 80, 56)
CROWN = (56, 112, 80)

HOLE_SHARE = 0.25
HOLE_SIZE = 1.6
NOISE_SIGMA = (0.15, 0.20, 0.25)


def random_field(rng: np.random.Generator, side: int, period: tuple[float, float], spread: float) -> Floats:
    """Return a (side, side) random field of unit variance whose waves are about `period` long.

    `period` is the wavelength in pixels down and across; `spread` is the relative band width.
    """
    down = np.fft.fftfreq(side)[:, None] * period[0]
    across = np.fft.fftfreq(side)[None, :] * period[1]
    band = np.exp(-0.5 * ((np.hypot(down, across) - 1.0) / spread) ** 2)
    field = np.fft.ifft2(np.fft.fft2(rng.standard_normal((side, side))) * band).real
    return np.asarray((field - field.mean()) / field.std(), dtype=np.float64)


def bone_struts(rng: np.random.Generator) -> Mask:
    """Return where bone is, True on the struts, as a (256, 256) mask.

    Marrow spaces are the cells where one of a few random fields is the largest, and struts are
    the borders between them. Unlike the level lines of one field, such borders meet in threes, as
    struts do. A slow field thins some of them until they break, and the last blur and cut rounds
    off the corners, which no living bone has.
    """
    fields = np.stack([random_field(rng, BONE_SIDE, (120.0, 95.0), 0.3) for _ in range(6)])
    highest = np.sort(fields, axis=0)
    lead = highest[-1] - highest[-2]
    # The lead over its own slope is the distance to the border in pixels, so that struts are
    # equally thick whether the fields cross steeply or not.
    slope = np.hypot(*np.gradient(lead))
    distance = lead / np.maximum(gaussian(slope, 3.0, mode="wrap"), 0.01)
    thickness = 3.2 + 1.6 * random_field(rng, BONE_SIDE, (60.0, 60.0), 0.5)
    return np.asarray(gaussian(distance < thickness, 2.5, mode="wrap") > 0.45, dtype=np.bool_)


def draw_bone() -> Bytes:
    """Return a gray picture, (256, 256) uint8, that looks like a micro-CT slice of spongy bone."""
    rng = np.random.default_rng(BONE_SEED)
    struts = gaussian(bone_struts(rng).astype(np.float64), 1.6, mode="wrap")
    mineral = 1.0 + 0.13 * random_field(rng, BONE_SIDE, (40.0, 40.0), 0.5)
    # A scanner's noise is not independent from pixel to pixel: reconstruction smooths it.
    noise = gaussian(rng.standard_normal(struts.shape), 0.9, mode="wrap")
    noise /= noise.std()
    gray = 34.0 + 150.0 * struts * mineral + 13.0 * noise
    return np.asarray(np.clip(np.rint(gray), 0, 255), dtype=np.uint8)


def draw_scene() -> Bytes:
    """Return a house and a tree on a hill under the sun: (192, 256, 3) uint8, six flat colors."""
    height, width = DRAWING_SHAPE
    scene = np.empty((height, width, 3), dtype=np.uint8)
    scene[:] = SKY
    scene[disk((36, 222), 22, shape=DRAWING_SHAPE)] = SUN
    scene[ellipse(218, 112, 92, 230, shape=DRAWING_SHAPE)] = HILL
    scene[84:158, 52:132] = WALL
    scene[polygon((86, 42, 86), (40, 92, 144), shape=DRAWING_SHAPE)] = ROOF
    scene[118:158, 82:102] = ROOF
    for left in (60, 108):
        scene[100:116, left : left + 16] = SKY
    scene[112:166, 190:200] = ROOF
    for row, column, radius in ((110, 179, 20), (110, 211, 20), (92, 195, 23)):
        scene[disk((row, column), radius, shape=DRAWING_SHAPE)] = CROWN
    return scene


def scratch(start: tuple[int, int], end: tuple[int, int]) -> Mask:
    """Return a straight scratch, seven pixels wide, from `start` to `end` as (row, column)."""
    mask = np.zeros(DRAWING_SHAPE, dtype=np.bool_)
    mask[line(*start, *end)] = True
    return np.asarray(dilation(mask, round_brush(3)), dtype=np.bool_)


def block(top: int, left: int, height: int, width: int) -> Mask:
    """Return a rectangular gap."""
    mask = np.zeros(DRAWING_SHAPE, dtype=np.bool_)
    mask[top : top + height, left : left + width] = True
    return mask


def large_gaps() -> tuple[Mask, Mask, Mask]:
    """Return what is lost in one piece in each version: no place is lost in two of them."""
    return (block(6, 190, 60, 60), scratch((8, 4), (184, 148)), block(108, 148, 66, 88))


def spoil(scene: Bytes, gap: Mask, sigma: float, rng: np.random.Generator) -> Bytes:
    """Return `scene` with noise and holes as (192, 256, 4) uint8, alpha 0 where nothing is known.

    `sigma` is the noise's standard deviation as a share of the range 0..255.
    """
    noisy = scene + 255.0 * sigma * rng.standard_normal(scene.shape)
    # Blurred noise cut at a quantile gives ragged holes, as flaking paint does, and their share
    # of the picture exactly.
    flakes = gaussian(rng.standard_normal(DRAWING_SHAPE), HOLE_SIZE)
    lost = (flakes < np.quantile(flakes, HOLE_SHARE)) | gap
    spoiled = np.zeros((*DRAWING_SHAPE, 4), dtype=np.uint8)
    spoiled[..., :3] = np.clip(np.rint(noisy), 0, 255)
    spoiled[..., 3] = 255
    # The color under a hole is wiped as well, or a reader that drops alpha would see it.
    spoiled[lost] = 0
    return spoiled


def save(name: str, pixels: Bytes) -> None:
    """Write `pixels` to `name` in this folder, as small a PNG as Pillow can make."""
    Image.fromarray(pixels).save(FOLDER / name, optimize=True)


def main() -> None:
    """Draw every picture anew."""
    save("bone_texture.png", draw_bone())
    scene = draw_scene()
    save("drawing.png", scene)
    versions = zip(large_gaps(), NOISE_SIGMA, strict=True)
    for number, (gap, sigma) in enumerate(versions, start=1):
        rng = np.random.default_rng(number)
        save(f"drawing_{number}.png", spoil(scene, gap, sigma, rng))


if __name__ == "__main__":
    main()
