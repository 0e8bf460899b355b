"""What ``cvtimg quantize`` does to each input."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any

from cvtimg.batch import Row, Stopwatch, Task

__all__ = ["quantize_image"]

#: Options by their names in Python, where these differ.
_FLAGS = {"weights": "--weight-map", "n_colors='auto'": "-k auto", "depth='16'": "--depth 16"}


def quantize_image(task: Task, stopwatch: Stopwatch, *, options: Mapping[str, Any]) -> Row:
    """Quantize an input, and write the outputs; the options are those of `quantize_file`."""
    from cvtimg.quantization import UnfitOptionError, quantize_file

    saved = task.outputs.get("--save-palette")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        try:
            result = quantize_file(task.source, task.output, **options, save_palette=saved, on_stage=stopwatch.lap)
        except UnfitOptionError as error:
            flag = _FLAGS.get(error.option, "--" + error.option.replace("_", "-"))
            raise ValueError(error.reason.format(flag)) from error
    is_one = result.kind in ("picture", "tiles")
    return {
        "width": result.shape[1],
        "height": result.shape[0],
        "channels": result.palette.shape[1],
        **({} if is_one else {result.kind: result.n_images}),
        "left_out": result.n_left_out,
        "distinct_colors": result.n_distinct,
        **({"exact": result.exact} if result.kind == "tiles" else {}),
        "k": result.n_colors,
        **({} if result.kind == "tiles" else {"elbow": result.curve.elbows() if result.curve else None}),
        "energy": result.energy,
        "mse": result.mse,
        "psnr": result.psnr if math.isfinite(result.psnr) else None,  # JSON has no infinity
        "n_iter": max((one.n_iter for one in result.tessellations), default=0),
        "converged": all(one.converged for one in result.tessellations),
        **({"warning": "; ".join(str(one.message) for one in caught)} if caught else {}),
    }
