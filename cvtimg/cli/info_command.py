"""``cvtimg info``: what is in pictures."""

from __future__ import annotations

import math
from dataclasses import asdict

import typer

from cvtimg.batch import Report, Row, Running, Task, find, run
from cvtimg.cli import options
from cvtimg.cli.batch_options import for_many

EXAMPLES = "Example:  cvtimg info photos/ --json"
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "width", "height", "mode", "bands", "bits", "alpha", "distinct_colors", "icc")


@for_many
def info(inputs: options.Pictures, as_json: options.AsJson = False, *, running: Running) -> None:
    """Tell size, format, bands, depth and number of distinct colors of pictures."""
    from cvtimg import find_images

    report = Report(COLUMNS, as_json=as_json)
    sources, missing = find(inputs, find_images)
    raise typer.Exit(run([Task(source) for source in sources], missing, _info, report, running=running))


def _info(task: Task) -> Row:
    import numpy as np

    from cvtimg import read_image
    from cvtimg.colors import color_samples
    from cvtimg.pictures import image_info

    header = asdict(image_info(task.source))
    header["alpha"] = header.pop("has_alpha")
    if header["nodata"] is not None and not math.isfinite(header["nodata"]):
        header["nodata"] = str(header["nodata"])  # JSON has no such numbers
    image = read_image(task.source)
    pixels = image.reshape(1, image.shape[0] * image.shape[1], -1)
    known = pixels[:, np.isfinite(pixels).all(axis=(0, 2))] if image.dtype.kind == "f" else pixels
    n_colors = color_samples(known).n_colors if known.size else 0
    return {"input": str(task.source), **header, "distinct_colors": n_colors}
