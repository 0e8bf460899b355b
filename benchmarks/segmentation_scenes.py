"""Segments of single scenes against what is known of them: nuclei, bone, and Europe by night.

Each part prints a table: of nuclei the foreground and the objects against their truth; of bone how two segments
agree with a threshold that was published for this slice, or where it is not there with the struts that were drawn in
the sample image; of Europe how much of the picture its segments are, and how they change from 2 to 4. Settings are
the same for all parts but for the number of segments: nothing is tuned to a picture.

    python benchmarks/segmentation_scenes.py [--sheets DIR]
"""

from __future__ import annotations

import argparse
import importlib.util
import statistics
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import DATA, SAMPLES, machine, parser, pin_threads, print_table, timed, write_results
from numpy.typing import NDArray
from skimage import __version__ as skimage_version
from skimage.filters import gaussian, threshold_multiotsu, threshold_otsu
from skimage.measure import label

import cvtimg
from cvtimg.plotting.sheets import Panel, contact_sheet, draw_edges
from cvtimg.segmentation import Objects
from cvtimg.segmentation.touching import BORDERS

#: Two-phase threshold of the slice of bone, as published with it.
BONE_THRESHOLD = 142
#: Objects below this many pixels are dust, whoever finds them.
DUST = 30
#: An object is found when it covers a true one to this share of their union.
MATCH = 0.5

Labels = NDArray[np.int32]


def options() -> argparse.Namespace:
    """Read the command line."""
    read = parser(__doc__)
    read.add_argument("--sheets", type=Path, metavar="DIR", help="write sheets to look at into this folder")
    return read.parse_args()


def main() -> None:
    """Measure the parts for which there are pictures."""
    asked = options()
    pin_threads(asked.threads)
    scenes = (asked.data or DATA) / "scenes"
    print(f"{machine()}, scikit-image {skimage_version}")
    rows: list[dict[str, Any]] = []
    for part in (nuclei, bone, europe):
        rows += part(scenes, asked.sheets)
    columns = dict.fromkeys(name for row in rows for name in row)
    write_results(
        "segmentation_scenes", {"threads": asked.threads}, [{name: row.get(name) for name in columns} for row in rows]
    )


def median_timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """Return what `call` returns, and the median seconds of five calls."""
    runs = [timed(call) for _ in range(5)]
    return runs[0][0], statistics.median(seconds for _, seconds in runs)


# Nuclei


def nuclei(scenes: Path, sheets: Path | None) -> list[dict[str, Any]]:
    """Find objects as the pieces of the foreground, which is all but the darkest segment."""
    if not (scenes / "dsb2018_nuclei_img2d.png").exists():
        print("\nnuclei: no picture")
        return []
    image = cvtimg.read_image(scenes / "dsb2018_nuclei_img2d.png")
    truth = np.load(scenes / "dsb2018_nuclei_mask2d.npz")["labels"]
    rows, panels = [], [Panel(bright(image), ("fluorescence",)), outlined(image, truth, "truth")]
    for name, find in nuclei_rivals(image):
        objects, seconds = median_timed(find)
        rows.append({"part": "nuclei", "rival": name, **score(objects, truth), "seconds": seconds})
        panels.append(outlined(image, objects, name))
    n_true, n_pieces = count(truth), count(label(truth > 0))
    print_table(
        f"Nuclei: {n_true} true objects, which touch and make {n_pieces} pieces",
        ["", "foreground IoU", "objects", "of them true", "F1", "ms"],
        [
            [
                row["rival"],
                f"{row['iou']:.3f}",
                str(row["objects"]),
                str(row["matched"]),
                f"{row['f1']:.3f}",
                f"{1e3 * row['seconds']:.0f}",
            ]
            for row in rows
        ],
    )
    write_sheet(sheets, "nuclei", panels)
    return rows


def nuclei_rivals(image: NDArray[Any]) -> Iterator[tuple[str, Callable[[], Labels]]]:
    """Name the ways to find objects, ours and scikit-image's."""

    def ours(n_segments: int) -> Labels:
        return pieces(cvtimg.segment(image, n_segments, edge_weight="auto", min_size=DUST).labels > 1)

    def otsu(sigma: float, n_classes: int) -> Labels:
        smooth = gaussian(image, sigma, preserve_range=True) if sigma else image
        level = threshold_otsu(smooth) if n_classes == 2 else threshold_multiotsu(smooth, n_classes)[0]
        return pieces(smooth > level)

    def split(n_segments: int, border: str) -> Labels:
        options = {"edge_weight": "auto", "min_size": DUST, "objects": Objects(border=border)}
        return cvtimg.segment(image, n_segments, **options).labels

    for border in BORDERS:
        for n_segments in (2, 3):
            name = f"cvtimg, {n_segments} segments, objects, border {border}"
            yield name, partial(split, n_segments, border)
    yield "cvtimg, 2 segments, edge weight auto", lambda: ours(2)
    yield "cvtimg, 3 segments, edge weight auto", lambda: ours(3)
    yield "Otsu", lambda: otsu(0, 2)
    yield "Gaussian 1, Otsu", lambda: otsu(1, 2)
    yield "Gaussian 1, Otsu in 3 classes", lambda: otsu(1, 3)


def pieces(foreground: NDArray[np.bool_]) -> Labels:
    """List the connected pieces of the foreground by number, without dust."""
    numbers = label(foreground, connectivity=1)
    kept = np.bincount(numbers.ravel()) >= DUST
    kept[0] = False
    return np.where(kept[numbers], numbers, 0)


def count(objects: Labels) -> int:
    """Count objects."""
    return len(np.unique(objects[objects > 0]))


def score(objects: Labels, truth: Labels) -> dict[str, Any]:
    """Compare objects with the truth: union of the foregrounds, and matched pairs."""
    both, either = (objects > 0) & (truth > 0), (objects > 0) | (truth > 0)
    pairs, common = np.unique(np.stack([objects[both], truth[both]]), axis=1, return_counts=True)
    union = np.bincount(objects.ravel())[pairs[0]] + np.bincount(truth.ravel())[pairs[1]] - common
    matched = int((common > MATCH * union).sum())
    n_found, n_true = count(objects), count(truth)
    f1 = 2 * matched / (n_found + n_true)
    return {"iou": both.sum() / either.sum(), "objects": n_found, "matched": matched, "f1": f1}


# Bone


def bone(scenes: Path, sheets: Path | None) -> list[dict[str, Any]]:
    """Compare two segments with what is known to be bone, and show three."""
    path = scenes / "bone_trabecular_lhdl_slice060.png"
    if path.exists():
        image, what = cvtimg.read_image(path), f"the published threshold {BONE_THRESHOLD}"
        known = image >= BONE_THRESHOLD
    else:
        image, what = cvtimg.read_image(SAMPLES / "bone_texture.png"), "the struts that were drawn"
        known = drawn_struts()
    rows = []
    panels = [Panel(image, (path.stem,)), outlined_edges(image, known + 1, what)]
    settings: list[tuple[str, dict[str, Any]]] = [
        ("cvtimg, plain", {}),
        ("cvtimg, edge weight auto", {"edge_weight": "auto"}),
        ("cvtimg, averaging before", {"averaging": "before"}),
        ("cvtimg, averaging after", {"averaging": "after"}),
    ]
    for name, how in settings:
        result, seconds = median_timed(lambda how=how: cvtimg.segment(image, 2, **how))
        rows.append({"part": "bone", "rival": name, **agreement(result.labels > 1, known), "seconds": seconds})
        panels.append(outlined_edges(image, result.labels, f"2 segments, {name.partition(', ')[2]}"))
    level = threshold_otsu(image)
    rows.append({"part": "bone", "rival": f"Otsu ({level})", **agreement(image > level, known)})
    brightest = cvtimg.segment(image, 3).labels > 2
    rows.append({"part": "bone", "rival": "cvtimg, the brightest of 3", **agreement(brightest, known)})
    for how in ({}, {"edge_weight": "auto"}):
        labels = cvtimg.segment(image, 3, **how).labels
        panels.append(outlined_edges(image, labels, f"3 segments{', edge weight auto' if how else ''}"))
    print_table(
        f"Bone in two segments or three beside {what}, which makes {known.mean():.1%} of it bone",
        ["", "bone", "pixels that agree", "IoU of bone"],
        [[row["rival"], f"{row['share']:.1%}", f"{row['agree']:.1%}", f"{row['iou']:.3f}"] for row in rows],
    )
    write_sheet(sheets, "bone", panels)
    return rows


def agreement(found: NDArray[np.bool_], known: NDArray[np.bool_]) -> dict[str, float]:
    """Compare two masks."""
    return {
        "share": float(found.mean()),
        "agree": float((found == known).mean()),
        "iou": float((found & known).sum() / (found | known).sum()),
    }


def drawn_struts() -> NDArray[np.bool_]:
    """Draw again what is bone in the sample image."""
    spec = importlib.util.spec_from_file_location("draw", SAMPLES / "draw.py")
    assert spec is not None
    assert spec.loader is not None
    draw = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(draw)
    struts: NDArray[np.bool_] = draw.bone_struts(np.random.default_rng(draw.BONE_SEED))
    return struts


# Europe


def europe(scenes: Path, sheets: Path | None) -> list[dict[str, Any]]:
    """Segment Europe by night in 2, 3 and 4."""
    path = scenes / "europe_night_nasa.png"
    image = cvtimg.read_image(path if path.exists() else SAMPLES / "europe_night.png")
    rows, panels = [], [Panel(bright(image), ("Europe by night", "brightened to be seen"))]
    for n_segments in (2, 3, 4):
        for how in ({}, {"edge_weight": "auto"}):
            result, seconds = median_timed(lambda n=n_segments, how=how: cvtimg.segment(image, n, **how))
            name = f"{n_segments} segments{', edge weight auto' if how else ''}"
            shares = np.bincount(result.labels.ravel(), minlength=n_segments + 1)[1:] / result.labels.size
            edges = float(cvtimg.find_edges(result.labels).mean())
            mse = result.energy / image.size
            rows.append(
                {"part": "europe", "rival": name, "shares": shares.tolist(), "edges": edges, "mse": mse}
                | {"seconds": seconds}
            )
            means = cvtimg.labels.region_means(result.labels, image)[1:]
            panels.append(Panel(bright(means[result.labels - 1]), (name,)))
    print_table(
        "Europe by night",
        ["", "shares, dark to bright", "edge points", "ms"],
        [
            [
                row["rival"],
                " ".join(f"{share:.1%}" for share in row["shares"]),
                f"{row['edges']:.1%}",
                f"{1e3 * row['seconds']:.0f}",
            ]
            for row in rows
        ],
    )
    write_sheet(sheets, "europe", panels)
    return rows


# Sheets


def bright(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Brighten a dark picture so that it can be looked at."""
    return np.rint(255 * np.sqrt(image / image.max())).astype(np.uint8)


def outlined(image: NDArray[np.uint8], objects: Labels, name: str) -> Panel:
    """Show objects by their outlines."""
    return Panel(draw_edges(bright(image), objects), (name, f"{count(objects)} objects"))


def outlined_edges(image: NDArray[np.uint8], labels: Labels, name: str) -> Panel:
    """Show segments by their edges."""
    return Panel(draw_edges(image, labels), (name,))


def write_sheet(folder: Path | None, name: str, panels: list[Panel]) -> None:
    """Write the panels, three in a row."""
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
        sheet = contact_sheet([panels[i : i + 3] for i in range(0, len(panels), 3)], panel_width=512)
        cvtimg.write_image(folder / f"{name}.png", sheet, overwrite=True)


if __name__ == "__main__":
    main()
