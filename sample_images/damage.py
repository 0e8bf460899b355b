"""Make noisy, incomplete versions of an image, to measure how well they are restored.

Each version loses different parts. Holes, blocks and scratches are marked by alpha 0. Occlusions are painted over in
the color of the background and not marked.

Run it from anywhere: ``python sample_images/damage.py sample_images/coffee.png --noise 0.1 --holes 0.3``. The same
seed gives the same versions.
"""

# scikit-image is only half annotated: its drawing functions have no types.
# mypy: allow-untyped-calls

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from skimage.draw import disk, line
from skimage.morphology import dilation
from skimage.morphology import disk as round_brush

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Sides of a block and radius of an occlusion, as shares of the shorter side of the image.
BLOCK_SIDES = (0.15, 0.3)
OCCLUSION_RADIUS = 0.09
SCRATCH_RADIUS = 2
#: An occlusion that would hide what no other version shows is moved at most this many times.
TRIALS = 200


@dataclass(frozen=True, slots=True)
class Damage:
    """Kinds and amounts of damage to each version.

    Attributes
    ----------
    noise : float
        Standard deviation of Gaussian noise, independent in each channel, where white is 1.
    holes : float
        Share of the pixels lost independently of each other.
    blocks, scratches, occlusions : int
        Numbers of lost rectangles, of lost scratches, and of disks outside the background that are painted over in its
        color.
    """

    noise: float = 0.0
    holes: float = 0.0
    blocks: int = 0
    scratches: int = 0
    occlusions: int = 0


def damaged_versions(clean: Floats, n_versions: int, damage: Damage, seed: int = 0) -> tuple[list[Floats], list[Mask]]:
    """Damage an image in several ways.

    Parameters
    ----------
    clean : (H, W, C) or (H, W) array
        In 0..1.
    n_versions : int
        Number of versions. No pixel is painted over in two of them.
    damage : Damage
        Damage to each version, in different places.
    seed : int
        The same seed gives the same versions.

    Returns
    -------
    versions : list of arrays like `clean`
        Values may leave 0..1 because of the noise. Lost pixels are 0.
    known : list of (H, W) bool arrays
        False where pixels are lost. Painted-over pixels count as known.
    """
    rng = np.random.default_rng(seed)
    background = commonest_color(clean)
    painted_elsewhere = np.zeros(clean.shape[:2], np.bool_)
    versions, masks = [], []
    for _ in range(n_versions):
        painted = occlusions(clean, background, damage.occlusions, painted_elsewhere, rng)
        painted_elsewhere |= painted
        version = clean.copy()
        version[painted] = background
        version += damage.noise * rng.standard_normal(clean.shape)
        known = ~lost(clean.shape[:2], damage, rng)
        version[~known] = 0
        versions.append(version)
        masks.append(known)
    return versions, masks


def commonest_color(clean: Floats) -> Floats:
    """Mean of the pixels in the fullest of 16 boxes a channel: what a person would call the background."""
    pixels = clean.reshape(clean.shape[0] * clean.shape[1], -1)
    _, box_of, counts = np.unique(np.floor(pixels * 15.999), axis=0, return_inverse=True, return_counts=True)
    color: Floats = pixels[box_of.reshape(-1) == counts.argmax()].mean(axis=0)
    return color


def occlusions(clean: Floats, background: Floats, n_occlusions: int, elsewhere: Mask, rng: np.random.Generator) -> Mask:
    """Discs about pixels that are not background, apart from those that other versions lack."""
    shape = clean.shape[:2]
    distance = np.abs(clean.reshape(*shape, -1) - background).max(axis=2)
    objects = np.argwhere(distance > 0.1)
    painted = np.zeros(shape, np.bool_)
    n_left, radius = n_occlusions, OCCLUSION_RADIUS * min(shape)
    for _ in range(TRIALS):
        if n_left == 0 or not len(objects):
            break
        disc = np.zeros(shape, np.bool_)
        disc[disk(tuple(objects[rng.integers(len(objects))]), radius, shape=shape)] = True
        if not (disc & elsewhere).any():
            painted |= disc
            n_left -= 1
    return painted


def lost(shape: tuple[int, int], damage: Damage, rng: np.random.Generator) -> Mask:
    """Return where a version knows nothing: holes, blocks and scratches."""
    gone = rng.random(shape) < damage.holes
    height, width = shape
    for _ in range(damage.blocks):
        tall, wide = (int(side) for side in rng.uniform(*BLOCK_SIDES, 2) * min(shape))
        top, left = rng.integers(height - tall + 1), rng.integers(width - wide + 1)
        gone[top : top + tall, left : left + wide] = True
    scratched = np.zeros(shape, np.bool_)
    for _ in range(damage.scratches):
        start, end = rng.integers(height, size=2)
        scratched[line(start, 0, end, width - 1)] = True
    return gone | np.asarray(dilation(scratched, round_brush(SCRATCH_RADIUS)), np.bool_)


def save(path: Path, version: Floats, known: Mask) -> None:
    """Write a version as PNG, 8 bits a channel, alpha 0 where it is lost."""
    levels = np.clip(np.rint(255 * version), 0, 255).astype(np.uint8)
    rgb = levels if levels.ndim == 3 else levels[:, :, None].repeat(3, axis=2)
    alpha = np.where(known, 255, 0).astype(np.uint8)[:, :, None]
    Image.fromarray(np.concatenate([rgb * (alpha > 0), alpha], axis=2)).save(path)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Make damaged versions of an image: NAME_1.png, NAME_2.png, ...")
    parser.add_argument("picture", type=Path)
    parser.add_argument("--out-dir", type=Path, default=Path("out"), help="folder to write to (default: out)")
    parser.add_argument("--versions", type=int, default=3, help="number of versions (default: 3)")
    parser.add_argument(
        "--noise", type=float, default=0.1, help="standard deviation of the noise, with white = 1 (default: 0.1)"
    )
    parser.add_argument("--holes", type=float, default=0.0, help="share of pixels lost independently (default: 0)")
    parser.add_argument("--blocks", type=int, default=0, help="rectangles lost in each version (default: 0)")
    parser.add_argument("--scratches", type=int, default=0, help="scratches in each version (default: 0)")
    parser.add_argument("--occlusions", type=int, default=0, help="parts painted over by the background (default: 0)")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    with Image.open(given.picture) as image:
        clean = np.asarray(image.convert("RGB"), np.float64) / 255
    damage = Damage(given.noise, given.holes, given.blocks, given.scratches, given.occlusions)
    given.out_dir.mkdir(parents=True, exist_ok=True)
    for number, (version, known) in enumerate(
        zip(*damaged_versions(clean, given.versions, damage, given.seed), strict=True), start=1
    ):
        path = given.out_dir / f"{given.picture.stem}_{number}.png"
        save(path, version, known)
        print(f"{path}: {1 - known.mean():.0%} lost")


if __name__ == "__main__":
    main()
