"""Series of noisy photographs from an unsteady hand: `denoise(..., align=True)` beside OpenCV and BM3D.

Each photograph of a folder is taken several times, moved by up to 5 pixels and turned by up to .7 degrees, at half its
size, so that frames differ as those of a camera do. Prints how far the motion that was found is off, root mean square
over the frame in pixels; PSNR in dB, eight pixels from the borders; and processor seconds. The rivals align by OpenCV's
ECC, which is told the model, take the mean, and denoise it: by fastNlMeans at the best of several strengths, chosen by
the truth, or by BM3D, which is told the noise, where its package, which is not free software, is installed.

Four frames with noise 18 are also measured with other exposures, which the rivals are told; with holes, where there are
no rivals; and moved by homographies.

    python benchmarks/handheld.py [--quick] FOLDER
"""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
from common import machine, parser, pin_threads, print_means, timed, write_results
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import map_coordinates

from cvtimg import denoise

Floats = NDArray[np.float64]

SHAPE, BORDER = (192, 256), 8
#: Also of four frames and noise 18: gains of bands, the share of pixels that is missing, one by one, and perspective.
EXPOSURES, HOLES, TILT = np.array([[1, 1, 1], [0.7, 0.7, 0.7], [1.4, 1.4, 1.4], [1.15, 1, 0.85]]), 0.3, 1e-4
KINDS = ("", "other exposures", "holes", "homographies")
LONGEST, LARGEST_ANGLE = 5.0, 0.7
STRENGTHS = (1.5, 2.5, 4, 6, 9, 13)
SIGMAS, COUNTS = (5, 18), (4, 8)


def scene(path: Path) -> Floats:
    """Return a photograph, its longer side from left to right."""
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB").rotate(90 * (image.height > image.width), expand=True), np.float64)


def motion(rng: np.random.Generator, tilt: float = 0.0) -> Floats:
    """(3, 3) rotation and translation, and perspective, from pixels (x, y) of the first frame to those of another."""
    angle, shift = np.deg2rad(rng.uniform(-LARGEST_ANGLE, LARGEST_ANGLE)), rng.uniform(-LONGEST, LONGEST, 2)
    center = (np.array(SHAPE[::-1]) - 1) / 2
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    last = np.append(rng.uniform(-tilt, tilt, 2) if tilt else np.zeros(2), 1)
    return np.vstack([np.column_stack([turn, center + shift - turn @ center]), last])


def mapped(transform: Floats, x: Floats, y: Floats) -> Floats:
    """(2, ...) places that a homography maps to."""
    places = np.tensordot(transform, np.stack([x, y, np.ones_like(x)]), 1)
    return places[:2] / places[2]


def frame(picture: Floats, transform: Floats) -> Floats:
    """Return what a frame shows: means of 2 x 2 pixels of a photograph that was moved."""
    y, x = np.indices(2 * np.array(SHAPE)) / 2 - 0.25
    x, y = mapped(np.linalg.inv(transform), x, y)
    corner = (np.array(picture.shape[:2]) / 2 - SHAPE) // 2
    at = 2 * (np.stack([y, x]) + corner[:, None, None]) + 0.5
    fine = np.stack([map_coordinates(band, at, order=3, mode="mirror") for band in np.moveaxis(picture, 2, 0)], axis=2)
    return fine.reshape(SHAPE[0], 2, SHAPE[1], 2, 3).mean(axis=(1, 3))


def off(found: Floats, true: Floats) -> float:
    """Root mean square distance of places mapped by two motions."""
    y, x = np.indices(SHAPE).astype(float)
    return float(np.sqrt(np.square(mapped(found, x, y) - mapped(true, x, y)).sum(axis=0).mean()))


def aligned(frames: list[NDArray[np.uint8]], gains: Floats, homographies: bool) -> tuple[list[Floats], Floats]:
    """Motions that ECC finds, and the mean of the frames in place, at the gain of the first."""
    first, size = cv2.cvtColor(frames[0], cv2.COLOR_RGB2GRAY), SHAPE[::-1]
    ends = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-6)
    motions, total, weight = [np.eye(3)], frames[0].astype(np.float32), np.ones(SHAPE, np.float32)
    model, warp = cv2.MOTION_EUCLIDEAN, cv2.warpAffine
    if homographies:
        model, warp = cv2.MOTION_HOMOGRAPHY, cv2.warpPerspective
    for other, gain in zip(frames[1:], gains[1:], strict=True):
        transform = np.eye(3 if homographies else 2, 3, dtype=np.float32)
        gray = cv2.cvtColor(other, cv2.COLOR_RGB2GRAY)
        _, transform = cv2.findTransformECC(first, gray, transform, model, ends, None, 5)
        how = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        known = warp(np.ones(SHAPE, np.float32), transform, size, flags=how) > 0.99
        moved = warp((other / gain).astype(np.float32), transform, size, flags=how)
        total[known] += moved[known]
        weight += known
        motions.append(np.vstack([transform, [0, 0, 1]])[:3])
    return motions, np.asarray(total / weight[:, :, None], np.float64)


def psnr(image: NDArray[np.generic], clean: Floats) -> float:
    """In dB, without the border."""
    inner = slice(BORDER, -BORDER)
    apart = np.clip(np.asarray(image, np.float64), 0, 255)[inner, inner] - clean[inner, inner]
    return float(10 * np.log10(255**2 / np.mean(apart**2)))


def measured(picture: Floats, sigma: float, n_frames: int, kind: str = "") -> dict[str, float]:
    """Restore one series by all; frames with holes, which the rivals do not take, by cvtimg alone."""
    rng = np.random.default_rng(n_frames)
    motions = [np.eye(3), *(motion(rng, TILT * (kind == "homographies")) for _ in range(n_frames - 1))]
    clean = frame(picture, motions[0])
    gains = EXPOSURES if kind == "other exposures" else np.ones((n_frames, 3))
    frames = []
    for gain, one in zip(gains, motions, strict=True):
        seen = gain * frame(picture, one) + sigma * rng.standard_normal(clean.shape)
        frames.append(np.clip(np.rint(seen), 0, 255).astype(np.uint8))
    masks = [rng.random(SHAPE) >= HOLES for _ in frames] if kind == "holes" else None
    result, seconds = timed(lambda: denoise(frames, masks=masks, align=True))
    alone = denoise(frames[:1], masks=masks and masks[:1])
    found = {
        "off": max(map(off, result.transforms, motions)),
        "cvtimg": psnr(result.image, clean),
        "one frame": psnr(alone.image, clean),
    }
    if masks:
        return {**found, "seconds": seconds}
    (by_ecc, mean), ecc_seconds = timed(lambda: aligned(frames, gains, kind == "homographies"))
    rounded = np.clip(np.rint(mean), 0, 255).astype(np.uint8)
    best = max(psnr(cv2.fastNlMeansDenoisingColored(rounded, None, h, h, 5, 15), clean) for h in STRENGTHS)
    found |= {"off, ECC": max(map(off, by_ecc, motions)), "ECC, mean": psnr(mean, clean), "+ OpenCV": best}
    if find_spec("bm3d"):
        found["+ BM3D"] = psnr(255 * import_module("bm3d").bm3d_rgb(mean / 255, sigma / 255 / n_frames**0.5), clean)
    return {**found, "seconds": seconds, "seconds, ECC": ecc_seconds}


def main() -> None:
    """Measure, print, write."""
    arguments = parser(__doc__)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--case", default="", help="part of the names of series")
    given = arguments.parse_args()
    pin_threads(given.threads)
    cv2.setNumThreads(1)
    print(machine())
    paths, rows = sorted(given.folder.glob("*.png"))[: 4 if given.quick else None], []
    series = [(sigma, n_frames, "") for sigma in SIGMAS for n_frames in COUNTS]
    series += [(SIGMAS[-1], len(EXPOSURES), kind) for kind in KINDS[1:]]
    for sigma, n_frames, kind in series:
        title = f"{n_frames} frames, noise {sigma}{kind and ', '}{kind}"
        if given.case in title:
            found = [measured(scene(path), sigma, n_frames, kind) for path in paths]
            print_means(title, [path.stem for path in paths], found, ".4g")
            about = {"frames": n_frames, "noise": sigma, "kind": kind}
            rows += [{**about, "case": path.stem, **one} for path, one in zip(paths, found, strict=True)]
    write_results("handheld", {"quick": given.quick}, rows)


if __name__ == "__main__":
    main()
