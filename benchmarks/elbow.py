"""The energy elbow: time and energies of curves, and whether the number that it picks is the right one.

Prints, for photographs, the CPU seconds of the curve to k = 64 beside those of scikit-learn's single k = 64 on the
same weighted distinct colors, and how far each E(k) is above that of `tessellate` run alone; the share of synthetic
pictures whose number of colors each rule finds; and, where human segmentations are at hand, the Probabilistic Rand
Index of cells with the number that each rule picks, beside every fixed number.

    python benchmarks/elbow.py [--quick] [--seeds 1 2]
"""

import argparse
import statistics
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from common import DATA, Rows, cpu_seconds, parser, picture_sets, progress, read_rgb, run, spread
from numpy.typing import NDArray
from segmentation import metrics_of

N_MAX = 64
#: How the synthetic pictures differ: standard deviation of the noise, and least distance of two colors in units of it.
SIGMAS = (2, 5, 10)
SEPARATIONS = (6, 4)
FIXED = range(2, 9)
RULES = ("chord", "variance")


def curves(given: argparse.Namespace) -> Rows:
    """Compare CPU seconds of curves to k = 64, and E(k) with tessellate balanced at every k."""
    from sklearn.cluster import KMeans

    import cvtimg

    sets = picture_sets(given.data, 1 if given.quick else 4)
    rows = []
    for picture in sets.get("kodak") or next(iter(sets.values())):
        progress(f"curve of {picture.name}")
        samples = cvtimg.colors.color_samples(picture.pixels)
        colors = samples.colors.astype(np.float64)

        def rival(samples: Any = samples, colors: NDArray[np.float64] = colors) -> object:
            return KMeans(N_MAX, n_init=1, random_state=0).fit(colors, sample_weight=samples.density)

        curve = cvtimg.energy_curve(samples, N_MAX)
        repeats = 1 if given.quick else 3
        ours = statistics.median(cpu_seconds(lambda samples=samples: cvtimg.energy_curve(samples, N_MAX), repeats))
        theirs = statistics.median(cpu_seconds(rival, repeats))
        above = curve.energies / [cvtimg.tessellate(samples, k).energy for k in range(1, N_MAX + 1)] - 1
        worst = int(np.argmax(above))
        rows.append(
            {
                "picture": picture.name,
                "colors": samples.n_colors,
                "curve_s": round(ours, 4),
                "sklearn_s": round(theirs, 4),
                "ratio": round(ours / theirs, 3),
                "worst": f"{above[worst]:+.2%} at k = {worst + 1}",
                "above_1_percent": int((above > 0.01).sum()),
                "mean": f"{above.mean():+.2%}",
            }
        )
    return rows


def synthetic_picture(n_colors: int, sigma: float, separation: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Draw 128 x 128 pixels of so many colors, with Gaussian noise, clipped to 8 bits.

    Colors are uniform in 16..240 for each channel, and at least `separation` sigma and 48 levels from each other. Each
    covers 3 % of the picture, and a share of the rest that a flat Dirichlet distribution draws: from 3 % to over half
    of the picture. The regions are level sets of a smooth random field.
    """
    side = 128
    colors: list[NDArray[np.float64]] = []
    while len(colors) < n_colors:
        colors = []
        for color in rng.uniform(16, 240, (2000, 3)):
            if all(np.linalg.norm(color - other) >= max(48, separation * sigma) for other in colors):
                colors.append(color)
            if len(colors) == n_colors:
                break
    shares = 0.03 + (1 - 0.03 * n_colors) * rng.dirichlet(np.ones(n_colors))
    frequencies = np.fft.fftfreq(side)[:, None] ** 2 + np.fft.rfftfreq(side) ** 2
    field = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((side, side))) * np.exp(-800 * frequencies), (side, side))
    labels = np.empty(side * side, np.intp)
    labels[np.argsort(field.ravel())] = np.searchsorted(np.cumsum(shares)[:-1], (np.arange(side**2) + 0.5) / side**2)
    pixels = np.array(colors)[labels].reshape(side, side, 3) + sigma * rng.standard_normal((side, side, 3))
    return np.clip(np.rint(pixels), 0, 255).astype(np.uint8)


def _hits(seed: int, separation: float, n_pictures: int) -> dict[str, Any]:
    """Count the pictures whose number of colors each rule finds; 2 to 12 colors take turns."""
    from cvtimg.elbow.curves import auto_count

    rng = np.random.default_rng(seed)
    found: dict[str, list[bool]] = {rule: [] for rule in RULES}
    missed = []
    for number in range(n_pictures):
        progress(f"synthetic picture {number} of seed {seed}")
        n_colors, sigma = 2 + number % 11, SIGMAS[number % len(SIGMAS)]
        picked = auto_count(synthetic_picture(n_colors, sigma, separation, rng))[1].elbows()
        for rule in RULES:
            found[rule].append(picked.get(rule) == n_colors)
        if picked["chord"] != n_colors:
            missed.append(f"{n_colors} colors, sigma {sigma}: {picked['chord']}")
    rates = {rule: f"{sum(found[rule])}/{n_pictures}" for rule in RULES}
    return {"seed": seed, "separation": separation, **rates, "missed": "; ".join(missed)}


def human_pictures(data: Path, n_pictures: int | None) -> Iterator[tuple[NDArray[np.uint8], NDArray[Any]]]:
    """Read pictures and their human segmentations."""
    for path in spread(sorted((data / "bsds").glob("*.jpg")), n_pictures):
        yield read_rgb(path), np.load(path.with_name(f"{path.stem}_gt.npz"))["segmentation"]


def _rand_indices(data: Path, space: str, n_pictures: int | None) -> Rows:
    """Compute the mean Probabilistic Rand Index of plain cells for every fixed K, and for what each rule picks."""
    import cvtimg
    from cvtimg.colors.places import to_places
    from cvtimg.elbow.curves import auto_count

    measure = metrics_of(data)
    if measure is None:
        return []
    indices: dict[str, list[float]] = {}
    for pixels, humans in human_pictures(data, n_pictures):
        samples = cvtimg.colors.color_samples(pixels)
        _, curve = auto_count(samples, space=space)
        places = to_places(samples.colors, space, samples.alpha)
        by_k: dict[int, float] = {}
        for name, k in {**{f"K = {k}": k for k in FIXED}, **{rule: curve.elbow(rule) for rule in RULES}}.items():
            progress(f"Rand index {space} {name}")
            if k not in by_k:
                labels = cvtimg.tessellate(places, k, density=samples.density).labels[samples.inverse]
                by_k[k] = float(np.mean([measure.ri(measure.cont(labels, human)) for human in humans]))
            indices.setdefault(name, []).append(by_k[k])
    return [{"space": space, "K": name, "PRI": round(float(np.mean(some)), 4)} for name, some in indices.items()]


def hits(given: argparse.Namespace) -> Rows:
    """Count synthetic pictures of 2 to 12 colors whose number is found."""
    return [_hits(seed, far, 33 if given.quick else 100) for far in SEPARATIONS for seed in given.seeds]


def rand_indices(given: argparse.Namespace) -> Rows:
    """Compute mean Probabilistic Rand Indices of plain cells."""
    data, n = given.data or DATA, 4 if given.quick else None
    return [row for space in ("rgb", "lab") for row in _rand_indices(data, space, n)]


if __name__ == "__main__":
    read = parser(__doc__)
    read.add_argument("--seeds", type=int, nargs="+", default=[1, 2], help="of the synthetic pictures (default: 1 2)")
    run(read, curves, hits, rand_indices)
