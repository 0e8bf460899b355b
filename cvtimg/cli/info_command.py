"""``cvtimg info``: what image files hold."""

import math
from dataclasses import asdict

from cvtimg.cli.running import Given, Row, Stopwatch, Task, Todo, plan_of, planned

EXAMPLES = "  cvtimg info photos/ --json\n  cvtimg info photos/ --noise"
COLUMNS = (
    *("input", "width", "height", "frames", "axes", "mode", "bands", "bits", "alpha", "distinct_colors"),
    *("channels", "pixel_size", "icc"),
)
NOISE_COLUMNS = ("noise", "noise_slope", "noise_neighbors")


def info(given: Given) -> Todo:
    """Show the size, format, bands, bit depth and number of distinct colors of images.

    For stacks and micrographs, show the axes, the names of channels and the size of a pixel, too.
    """
    return planned(plan_of(given), _info, COLUMNS + NOISE_COLUMNS * given.noise, given)


def _info(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    import numpy as np

    from cvtimg.colors import color_samples
    from cvtimg.pictures import image_info
    from cvtimg.pictures.stacks import read_whole

    info = image_info(task.source)
    header = asdict(info)
    header["channels"] = info.channels or None
    header["pixel_size"] = info.pixel_size and str(info.pixel_size)
    header["alpha"] = header.pop("has_alpha")
    if header["nodata"] is not None and not math.isfinite(header["nodata"]):
        header["nodata"] = str(header["nodata"])  # JSON has no such numbers
    image = read_whole(task.source)
    pixels = image.reshape(1, image.shape[0] * image.shape[1], -1)
    if header["alpha"] and pixels.shape[2] in (2, 4):
        pixels = pixels * (pixels[..., -1:] > 0)  # what is hidden is one color
    known = pixels[:, np.isfinite(pixels).all(axis=(0, 2))] if image.dtype.kind == "f" else pixels
    n_colors = color_samples(known).n_colors if known.size else 0
    row = {**header, "distinct_colors": n_colors}
    if given.noise:
        from cvtimg.restoration.evidence import prepare
        from cvtimg.restoration.versions import stack_versions, with_tables

        version, _ = stack_versions([with_tables(image, task.source)], nodata=info.nodata).distinct()
        evidence, unit = prepare(version, None, white=False), version.level("rgb")
        noise, lines = evidence.noise, evidence.noise_lines
        slope = 0.0 if lines is None else float(lines[:, 1].mean() / unit)
        values = float(noise.levels[0] / unit), slope, noise.shared.neighbors if noise.shared else 0.0
        row |= zip(NOISE_COLUMNS, (value if math.isfinite(value) else None for value in values), strict=True)
    return row
