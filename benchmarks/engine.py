"""The engine beside other clusterings: time against energy, and scaling.

Prints two parts: at which times which clustering has the lowest energy, on photographs, with a plot; and seconds and
energy as samples, generators and dimensions grow.

    python benchmarks/engine.py [--quick] [--full] [--docs] [--parts curves scaling]
"""

import argparse
import importlib
import importlib.util
import statistics
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np
from common import (
    OUT,
    ROOT,
    Picture,
    group,
    machine,
    parser,
    picture_sets,
    pin_threads,
    print_table,
    progress,
    spread,
    timed,
    write_results,
)
from numpy.typing import NDArray
from PIL import Image
from rivals import distinct_colors, to_8_bits

PARTS = ("curves", "scaling")
EFFORTS = ("fast", "balanced", "best")
#: Seconds below which a clustering is timed three times, of which the median counts.
SHORT = 0.3
#: Products of samples, generators and dimensions above which scikit-learn runs only with --full.
HEAVY = 1e9
#: The lowest excess in the plot, in percent: zero has no place on an axis of logarithms.
FLOOR = 0.01

Row = dict[str, Any]
#: A clustering: generators of rows, (K, D).
Cluster = Callable[[], NDArray[Any]]


@dataclass(frozen=True, slots=True)
class Setting:
    """A rival at one of its settings; `run` clusters the pixels of a picture into k colors."""

    rival: str
    setting: str
    run: Callable[[Any, int], NDArray[Any]]
    prepare: Callable[[NDArray[np.uint8]], Any] = lambda pixels: pixels


@dataclass(frozen=True, slots=True)
class Point:
    """A setting on all pictures at one k: its seconds, and percent of energy above the best known."""

    k: int
    rival: str
    setting: str
    seconds: float
    excess: float


def options() -> argparse.Namespace:
    """Read the command line."""
    read = parser(__doc__)
    read.add_argument("--full", action="store_true", help="up to 5e7 samples, and all pictures: an hour or more")
    read.add_argument("--docs", action="store_true", help="write the plot to docs/time_energy.webp")
    read.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="only these (default: all)")
    read.add_argument("--pictures", type=int, default=4, metavar="N", help="pictures for the curves (4)")
    read.add_argument("--k", type=int, nargs="+", default=[16, 64, 256], metavar="K", help="colors (16 64 256)")
    given = read.parse_args()
    given.pictures = 1 if given.quick else given.pictures
    return given


# ---------------------------------------------------------------------------------------------- the clusterings


def cvtimg_rows(rows: NDArray[Any], k: int, effort: str) -> NDArray[Any]:
    """Cluster the rows of a table."""
    import cvtimg

    return cvtimg.tessellate(rows, k, effort=effort).generators


def cvtimg_colors(pixels: NDArray[np.uint8], k: int, effort: str) -> NDArray[Any]:
    """Count colors and cluster them."""
    import cvtimg

    return cvtimg.tessellate(cvtimg.colors.color_samples(pixels), k, effort=effort).generators


def scikit_rows(rows: NDArray[Any], k: int, weights: NDArray[Any] | None = None, **settings: Any) -> NDArray[Any]:
    """Cluster the rows of a table by KMeans from k-means++."""
    cluster = importlib.import_module("sklearn.cluster")
    settings = {"n_init": 1, **settings}
    model = cluster.KMeans(k, random_state=0, **settings).fit(rows.astype(np.float32), sample_weight=weights)
    return np.asarray(model.cluster_centers_)


def scikit_colors(pixels: NDArray[np.uint8], k: int, **settings: Any) -> NDArray[Any]:
    """Count colors and cluster them by KMeans."""
    colors, counts, _ = distinct_colors(pixels)
    return scikit_rows(colors, k, counts, **settings)


def minibatch_colors(pixels: NDArray[np.uint8], k: int, **settings: Any) -> NDArray[Any]:
    """Count colors and cluster them by MiniBatchKMeans."""
    colors, counts, _ = distinct_colors(pixels)
    cluster = importlib.import_module("sklearn.cluster")
    model = cluster.MiniBatchKMeans(k, n_init=1, random_state=0, **settings)
    return np.asarray(model.fit(colors.astype(np.float32), sample_weight=counts).cluster_centers_)


def faiss_rows(
    rows: NDArray[Any], k: int, weights: NDArray[Any] | None = None, niter: int = 25, most: int = 1 << 40
) -> NDArray[Any]:
    """Cluster the rows of a table by faiss, from random rows; of more than `most` a generator it takes a part."""
    faiss = importlib.import_module("faiss")
    most = min(most, len(rows))
    model = faiss.Kmeans(rows.shape[1], k, niter=niter, seed=0, min_points_per_centroid=1, max_points_per_centroid=most)
    model.train(rows.astype(np.float32), weights=None if weights is None else weights.astype(np.float32))
    return np.asarray(model.centroids)


def faiss_colors(pixels: NDArray[np.uint8], k: int, niter: int) -> NDArray[Any]:
    """Count colors and cluster them by faiss."""
    colors, counts, _ = distinct_colors(pixels)
    return faiss_rows(colors, k, counts, niter)


def opencv_colors(pixels: NDArray[np.uint8], k: int, n_iter: int) -> NDArray[Any]:
    """Cluster all pixels by OpenCV, which takes no weights."""
    cv2 = importlib.import_module("cv2")
    cv2.setRNGSeed(0)
    rule = (cv2.TERM_CRITERIA_MAX_ITER, n_iter, 0.0)
    rows = pixels.reshape(-1, 3).astype(np.float32)
    return np.asarray(cv2.kmeans(rows, k, None, rule, 1, cv2.KMEANS_PP_CENTERS)[2])


def imagequant_colors(native: tuple[bytes, int, int], k: int, speed: int) -> NDArray[Any]:
    """Find a palette by the functions below imagequant's binding: it has no speed, and always maps."""
    library = importlib.import_module("imagequant._libimagequant")
    lib, ffi = library.lib, library.ffi
    settings = lib.liq_attr_create()
    settings.max_colors = k
    lib.liq_set_speed(settings, speed)
    lib.liq_set_quality(settings, 0, 100)
    image = lib.liq_image_create_rgba(settings, native[0], native[1], native[2], 0)
    result = ffi.new("liq_result**")
    if lib.liq_image_quantize(image, settings, result) != lib.LIQ_OK:
        raise RuntimeError("imagequant failed")
    entries = lib.liq_get_palette(result[0])
    palette = np.array([(color.r, color.g, color.b) for color in entries.entries[0 : entries.count]], np.uint8)
    lib.liq_result_destroy(result[0])
    lib.liq_image_destroy(image)
    lib.liq_attr_destroy(settings)
    return palette


def rgba_bytes(pixels: NDArray[np.uint8]) -> tuple[bytes, int, int]:
    """Append an opaque alpha channel."""
    return np.dstack([pixels, np.full(pixels.shape[:2], 255, np.uint8)]).tobytes(), pixels.shape[1], pixels.shape[0]


def pillow_colors(image: Image.Image, k: int) -> NDArray[Any]:
    """Find a palette by Pillow's median cut, which maps the pixels too."""
    palette = image.quantize(k, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).getpalette()
    return np.array(palette, np.uint8).reshape(-1, 3)[:k]


def settings_of(quick: bool) -> list[Setting]:
    """List what can run here, each rival from its shortest setting to its longest."""
    found = [Setting("cvtimg", effort, partial(cvtimg_colors, effort=effort)) for effort in EFFORTS]
    if has("sklearn"):
        counts: Sequence[int] = (1, 10) if quick else (1, 2, 5, 10, 30, 100)
        found += [Setting("scikit-learn KMeans", f"{n} iterations", partial(scikit_colors, max_iter=n)) for n in counts]
        name = "scikit-learn MiniBatchKMeans"
        found += [Setting(name, f"{n} epochs", partial(minibatch_colors, max_iter=n)) for n in (1, 5, 25)]
    if has("faiss"):
        counts = (1, 10) if quick else (1, 2, 5, 10, 25, 50)
        found += [Setting("faiss Kmeans", f"{n} iterations", partial(faiss_colors, niter=n)) for n in counts]
    if has("cv2"):
        counts = (2,) if quick else (2, 5, 10)
        found += [Setting("OpenCV kmeans", f"{n} iterations", partial(opencv_colors, n_iter=n)) for n in counts]
    if has("imagequant._libimagequant", "lib.liq_set_speed"):
        speeds = (10, 1) if quick else (10, 8, 6, 4, 3, 2, 1)
        found += [Setting("imagequant", f"speed {n}", partial(imagequant_colors, speed=n), rgba_bytes) for n in speeds]
    return [*found, Setting("Pillow", "median cut", pillow_colors, Image.fromarray)]


def has(module: str, attribute: str = "") -> bool:
    """Whether a module can be imported and holds what is named; what is missing is said."""
    try:
        here: Any = importlib.import_module(module)
        for name in filter(None, attribute.split(".")):
            here = getattr(here, name)
    except (ImportError, AttributeError) as error:
        print(f"- {module}: left out ({error})")
        return False
    return True


def energy(rows: NDArray[Any], generators: NDArray[Any], weights: NDArray[Any] | None = None) -> float:
    """Sum the squared distances of rows to their nearest generators, the same way for every rival."""
    centers = generators.astype(np.float32)
    middle = centers.mean(axis=0)
    centers = centers - middle
    half_norms = np.einsum("kd,kd->k", centers, centers) / 2
    total = 0.0
    for start in range(0, len(rows), 1 << 13):
        block = rows[start : start + (1 << 13)].astype(np.float32) - middle
        step = block - centers[np.argmin(half_norms - block @ centers.T, axis=1)]
        errors = np.einsum("nd,nd->n", step, step, dtype=np.float64)
        total += float(errors.sum() if weights is None else errors @ weights[start : start + (1 << 13)])
    return total


def clocked(call: Cluster) -> tuple[NDArray[Any], float]:
    """Return generators and seconds of the processor: the median of three times where that is short.

    With one thread these are the seconds of a machine that has nothing else to do, whatever else this one does.
    """
    generators, seconds = timed(call, time.process_time)
    if seconds > SHORT:
        return generators, seconds
    return generators, statistics.median([seconds, *(timed(call, time.process_time)[1] for _ in range(2))])


# ------------------------------------------------------------------------------------------- time against energy


def curves(pictures: Sequence[Picture], ks: Sequence[int], settings: Sequence[Setting]) -> list[Row]:
    """Measure all settings on all pictures, palettes rounded to 8 bits."""
    rows = []
    for picture in pictures:
        colors, counts, _ = distinct_colors(picture.pixels)
        for k in ks:
            for setting in settings:
                progress(f"{picture.name} k={k} {setting.rival} {setting.setting}")
                native = setting.prepare(picture.pixels)
                generators, seconds = clocked(partial(setting.run, native, k))
                error = energy(colors, to_8_bits(generators), counts) / counts.sum()
                rows.append(
                    {
                        "picture": picture.name,
                        "k": k,
                        "rival": setting.rival,
                        "setting": setting.setting,
                        "seconds": seconds,
                        "error": error,
                    }
                )
    progress("")
    return rows


def summary(rows: Sequence[Row]) -> list[Point]:
    """Bring pictures together: geometric mean of seconds, mean of the error relative to the best of the picture."""
    best = {key: min(row["error"] for row in some) for key, some in group(rows, _case).items()}
    points = []
    for (k, rival, setting), some in group(rows, lambda row: (row["k"], row["rival"], row["setting"])).items():
        seconds = statistics.geometric_mean(row["seconds"] for row in some)
        ratio = statistics.mean(row["error"] / best[_case(row)] for row in some)
        points.append(Point(k, rival, setting, seconds, (ratio - 1) * 100))
    return points


def _case(row: Row) -> tuple[str, int]:
    return row["picture"], row["k"]


def undominated(points: Sequence[Point]) -> list[Point]:
    """List the points of rivals than which no point of cvtimg is both as fast and as low, at the same k."""
    ours = [point for point in points if point.rival == "cvtimg"]
    return [
        point
        for point in points
        if point.rival != "cvtimg"
        and not any(own.k == point.k and own.seconds <= point.seconds and own.excess <= point.excess for own in ours)
    ]


def report_curves(points: Sequence[Point]) -> None:
    """Print the points, and where a rival is ahead."""
    ahead = undominated(points)
    cells: list[list[str]] = []
    for (rival, setting), some in group(points, lambda point: (point.rival, point.setting)).items():
        marks = [f"{p.seconds * 1e3:.0f} ms, +{p.excess:.2f} %" + (" *" if p in ahead else "") for p in some]
        cells.append([f"{rival}, {setting}", *marks])
    ks = list(dict.fromkeys(point.k for point in points))
    print_table(
        "Time against energy: seconds, and energy above the best known of each picture; * not dominated by cvtimg",
        ["clustering", *(f"k={k}" for k in ks)],
        cells,
    )


def draw_curves(points: Sequence[Point], n_pictures: int) -> None:
    """Write out/benchmarks/time_energy.png: a panel for each k, a curve for each rival."""
    matplotlib = importlib.import_module("matplotlib")
    matplotlib.use("Agg")
    pyplot = importlib.import_module("matplotlib.pyplot")
    panels = group(points, lambda point: point.k)
    figure, axes = pyplot.subplots(1, len(panels), figsize=(4.3 * len(panels), 4.4), sharey=True, squeeze=False)
    for axis, (k, some) in zip(axes[0], panels.items(), strict=True):
        for number, (rival, curve) in enumerate(group(some, lambda point: point.rival).items()):
            draw_curve(axis, rival, curve, number)
        axis.set(xscale="log", yscale="log", title=f"k = {k}", xlabel="seconds, one thread")
        axis.grid(which="major", color="0.9")
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0, 0].set_ylabel("energy above the best known, %")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=len(labels), frameon=False, fontsize=9)
    what = f"Time against energy: the mean of {n_pictures} photographs; lower and further left is better"
    figure.suptitle(what, fontsize=11)
    figure.tight_layout(rect=(0, 0.06, 1, 1))
    OUT.mkdir(parents=True, exist_ok=True)
    figure.savefig(OUT / "time_energy.png", dpi=110)
    pyplot.close(figure)


def draw_curve(axis: Any, rival: str, curve: Sequence[Point], number: int) -> None:
    """Draw the points of one rival; those of cvtimg are named and joined by steps: what it has at a budget."""
    seconds, excess = [point.seconds for point in curve], [max(point.excess, FLOOR) for point in curve]
    if rival != "cvtimg":
        axis.plot(seconds, excess, "o-", color=f"C{number - 1}", label=rival, markersize=3.5, linewidth=1.2)
        return
    axis.step(seconds, excess, where="post", color="black", label=rival, linewidth=1.2, zorder=5)
    axis.plot(seconds, excess, "D", color="black", markersize=6, zorder=6)
    for point, x, y in zip(curve, seconds, excess, strict=True):
        axis.annotate(point.setting, (x, y), (6, 5), textcoords="offset points", fontsize=9, zorder=7)


# ----------------------------------------------------------------------------------------------------- scaling


def blobs(n: int, n_dims: int, dtype: str = "float32") -> NDArray[Any]:
    """Draw rows from a mixture of 200 Gaussians, within 0 to 255; a block at a time, for many."""
    rng = np.random.default_rng(n_dims)
    centers = rng.uniform(30, 225, (200, n_dims)).astype(np.float32)
    rows = np.empty((n, n_dims), dtype)
    for start in range(0, n, 1 << 20):
        block = rows[start : start + (1 << 20)]
        steps = rng.standard_normal(block.shape, np.float32) * np.float32(10)
        block[:] = np.clip(centers[rng.integers(0, 200, len(block))] + steps, 0, 255)
    return rows


def scaling_cases(full: bool, quick: bool) -> list[tuple[str, int, int, int, str]]:
    """List what grows, n, k, D and the type."""
    sizes = [10**4, 10**5] if quick else [10**4, 10**5, 10**6]
    cases = [("n", n, 64, 3, "float32") for n in sizes]
    cases += [("n", n, 64, 3, "uint8") for n in (10**7, 5 * 10**7) if full]
    cases += [("k", 10**5, k, 3, "float32") for k in ((2, 256) if quick else (2, 16, 256, 4096))]
    return cases + [("D", 10**5, 64, n_dims, "float32") for n_dims in ((1, 16) if quick else (1, 4, 16, 64))]


def clusterings(rows: NDArray[Any], k: int, full: bool) -> dict[str, Cluster]:
    """List the clusterings to be compared on rows of a table."""
    found: dict[str, Cluster] = {f"cvtimg {effort}": partial(cvtimg_rows, rows, k, effort) for effort in EFFORTS[:2]}
    if importlib.util.find_spec("sklearn") and (full or rows.size * k <= HEAVY):
        found["scikit-learn"] = partial(scikit_rows, rows, k)
    if importlib.util.find_spec("faiss"):
        found["faiss, a part"] = partial(faiss_rows, rows, k, most=256)
        found["faiss, all"] = partial(faiss_rows, rows, k)
    return found


def scaling(cases: Sequence[tuple[str, int, int, int, str]], full: bool) -> list[Row]:
    """Measure all clusterings in all cases."""
    measured = []
    for axis, n, k, n_dims, dtype in cases:
        rows = blobs(n, n_dims, dtype)
        for name, call in clusterings(rows, k, full).items():
            progress(f"n={n} k={k} D={n_dims} {name}")
            generators, seconds = clocked(call)
            case = {"grows": axis, "n": n, "k": k, "D": n_dims, "type": dtype}
            measured.append({**case, "rival": name, "seconds": seconds, "energy": energy(rows, generators)})
    progress("")
    return measured


def report_scaling(measured: Sequence[Row]) -> None:
    """Print a table of seconds and energies for each thing that grows, with slopes, and where cvtimg is slowest."""
    names = list(dict.fromkeys(row["rival"] for row in measured))
    for axis, some in group(measured, lambda row: row["grows"]).items():
        cells = [scaling_cells(axis, value, case, names) for value, case in group(some, itemgetter(axis)).items()]
        by_name = group(some, lambda row: row["rival"])
        cells.append(["slope", *(f"{slope(by_name[name], axis):.2f}" for name in names)])
        held = ", ".join(f"{key}={some[0][key]}" for key in ("n", "k", "D") if key != axis)
        print_table(f"As {axis} grows, {held}: seconds (energy, by the lowest of the line)", [axis, *names], cells)


def scaling_cells(axis: str, value: int, case: Sequence[Row], names: Sequence[str]) -> list[str]:
    """Lay out one line."""
    least = min(row["energy"] for row in case)
    cells = {row["rival"]: f"{row['seconds']:.3g} ({row['energy'] / least:.4f})" for row in case}
    return [f"{axis}={value}", *(cells.get(name, "-") for name in names)]


def slope(rows: Sequence[Row], axis: str) -> float:
    """Fit the power by which seconds grow."""
    xs, ys = np.log([row[axis] for row in rows]), np.log([row["seconds"] for row in rows])
    return float(np.polyfit(xs, ys, 1)[0])


# -------------------------------------------------------------------------------------------------------- the run


def main() -> None:
    """Measure, print, write."""
    given = options()
    pin_threads(given.threads)
    warnings.filterwarnings("ignore", module="sklearn")  # few iterations are meant
    print(f"Engine. {machine()}. Threads: {given.threads or 'as each likes'}.\n")
    about = {"threads": given.threads}
    pictures = next(iter(picture_sets(given.data, None).values()))
    if "curves" in given.parts:
        run_curves(pictures if given.full else spread(pictures, given.pictures), given, about)
    if "scaling" in given.parts:
        warm_up(settings_of(quick=True), given.threads)
        measured = scaling(scaling_cases(given.full, given.quick), given.full)
        report_scaling(measured)
        write_results("engine_scaling", about, measured)


def run_curves(pictures: Sequence[Picture], given: argparse.Namespace, about: Row) -> None:
    """Measure, print, draw."""
    settings = settings_of(given.quick)
    warm_up(settings, given.threads)
    rows = curves(pictures, given.k, settings)
    points = summary(rows)
    report_curves(points)
    if has("matplotlib"):
        draw_curves(points, len(pictures))
        if given.docs:
            Image.open(OUT / "time_energy.png").convert("RGB").save(ROOT / "docs" / "time_energy.webp", lossless=True)
    named = {"points": [asdict(point) for point in points], "pictures": [picture.name for picture in pictures]}
    write_results("engine_curves", {**about, **named}, rows)


def warm_up(settings: Sequence[Setting], n_threads: int) -> None:
    """Let each clustering pay for its first call now; OpenCV takes no notice of the environment."""
    small = np.random.default_rng(0).integers(0, 256, (32, 32, 3), dtype=np.uint8)
    for setting in settings:
        if setting.rival == "OpenCV kmeans" and n_threads:
            importlib.import_module("cv2").setNumThreads(n_threads)
        setting.run(setting.prepare(small), 4)


if __name__ == "__main__":
    main()
