"""Masks of regions as COCO annotations: training data and results of detectors."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_labels
from cvtimg.files.whole import StrPath, write_text
from cvtimg.labels.figures import run_lengths


def write_coco(path: StrPath, labels: ArrayLike, name: str, *, overwrite: bool = False) -> None:
    """Write a COCO data set of one image, or of the pages of a stack, as pycocotools reads it.

    Parameters
    ----------
    path : str or path-like
        Ends in .json.
    labels : (H, W) or (P, H, W) integer array
        Region of each pixel, or of those of P pages; 0 is none.
    name : str
        File name of the image. Pages are images of their own, whose member "page" counts from 1.
    overwrite : bool
        Replace an existing file.

    Notes
    -----
    Each region is an annotation whose mask is stored as uncompressed run lengths. Its id is its label, or counts on
    from page to page. All are in one category, "segment". None is marked as a crowd, because tools leave crowds out.

    Examples
    --------
    >>> import json
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_coco(f"{folder}/coco.json", [[1, 1, 2]], "photo.png")
    ...     annotation = json.loads(Path(folder, "coco.json").read_text())["annotations"][1]
    >>> annotation["segmentation"], annotation["bbox"]
    ({'size': [1, 3], 'counts': [2, 1]}, [2, 0, 1, 1])
    """
    given = np.asarray(labels)
    several = given.ndim == 3
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for number, one in enumerate(given if several else [given], start=1):
        page = check_labels("labels", one)
        size = {"width": page.shape[1], "height": page.shape[0]}
        images.append({"id": number, "file_name": name, **({"page": number} if several else {}), **size})
        annotations += _annotations(page, number, len(annotations) if several else None)
    categories = [{"id": 1, "name": "segment", "supercategory": "segment"}]
    whole = {"images": images, "annotations": annotations, "categories": categories}
    write_text(path, [json.dumps(whole, separators=(",", ":")), "\n"], overwrite=overwrite)


def _annotations(labels: NDArray[np.int32], image: int, first: int | None) -> list[dict[str, Any]]:
    """Return the annotations of an image; their ids are labels, or count on from the first."""
    from scipy.ndimage import find_objects

    boxes = find_objects(labels)
    return [
        {
            "id": label if first is None else first + number,
            "image_id": image,
            "category_id": 1,
            "segmentation": {"size": list(labels.shape), "counts": counts},
            "area": sum(counts[1::2]),
            "bbox": _box(*boxes[label - 1]),
            "iscrowd": 0,
        }
        for number, (label, counts) in enumerate(run_lengths(labels).items(), start=1)
    ]


def _box(rows: slice, columns: slice) -> list[int]:
    """Left, top, width and height of a box."""
    return [columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start]
