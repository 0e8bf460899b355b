"""Masks of regions as COCO annotations: training data and results of detectors."""

from __future__ import annotations

import json

from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_labels
from cvtimg.files.whole import StrPath, write_text
from cvtimg.labels.figures import run_lengths


def write_coco(path: StrPath, labels: ArrayLike, name: str, *, overwrite: bool = False) -> None:
    """Write a COCO data set of one image, as pycocotools reads it.

    Parameters
    ----------
    path : str or path-like
        Ends in .json.
    labels : (H, W) integer array
        Region of each pixel; 0 is none.
    name : str
        File name of the image.
    overwrite : bool
        Replace an existing file.

    Notes
    -----
    Each region is an annotation whose id is its label and whose mask is stored as uncompressed run lengths. All are
    in one category, "segment". None is marked as a crowd, because tools leave crowds out.

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
    from scipy.ndimage import find_objects

    numbers = check_labels("labels", labels)
    height, width = numbers.shape
    boxes = find_objects(numbers)
    annotations = [
        {
            "id": label,
            "image_id": 1,
            "category_id": 1,
            "segmentation": {"size": [height, width], "counts": counts},
            "area": sum(counts[1::2]),
            "bbox": _box(*boxes[label - 1]),
            "iscrowd": 0,
        }
        for label, counts in run_lengths(numbers).items()
    ]
    picture = {"id": 1, "file_name": name, "width": width, "height": height}
    categories = [{"id": 1, "name": "segment", "supercategory": "segment"}]
    whole = {"images": [picture], "annotations": annotations, "categories": categories}
    write_text(path, [json.dumps(whole, separators=(",", ":")), "\n"], overwrite=overwrite)


def _box(rows: slice, columns: slice) -> list[int]:
    """Left, top, width and height of a box."""
    return [columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start]
