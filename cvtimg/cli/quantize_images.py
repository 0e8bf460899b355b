"""What ``cvtimg quantize`` does to each input."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Row, Stopwatch, Task
from cvtimg.cli.animations import quantize_animation, stays_animated
from cvtimg.cli.known_pixels import known_pixels
from cvtimg.cli.pages import has_pages, quantize_pages
from cvtimg.cli.quantize_options import QuantizeOptions
from cvtimg.cli.sample_types import as_stored
from cvtimg.cli.tiled import check_fit, needs_tiles, quantize_in_tiles

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.pictures import ImageInfo, Metadata
    from cvtimg.quantization.remapping import Quantized

__all__ = ["quantize_image"]


def quantize_image(
    task: Task, stopwatch: Stopwatch, *, how: QuantizeOptions, overwrite: bool, max_pixels: int | None
) -> Row:
    """Quantize an input, in the way that suits its file, and write the outputs."""
    from cvtimg import read_image
    from cvtimg.pictures import image_info, open_bands

    if needs_tiles(task.source, task.output):
        unfit = ("--psnr", "--weight-map", "--dither", "-k auto", "--depth", "--max-bytes")
        check_fit(task.source, how.unfit(*unfit, "--keep-metadata", "--optimize"), max_pixels)
        form = open_bands(task.source).form
        given = {**how.of_palette, **how.colors_of(form.dtype)}
        given |= {"mask": how.mask, "nodata": form.nodata if how.nodata is None else how.nodata}
        return quantize_in_tiles(task, stopwatch, given, overwrite=overwrite)
    header = image_info(task.source)
    if stays_animated(task, header):
        return _quantize_animation(task, stopwatch, header, how, overwrite)
    if has_pages(header):
        return _quantize_pages(task, stopwatch, header, how, overwrite)
    keep_profile = how.keep_metadata and not how.colors  # colors that are given are in sRGB
    image = read_image(task.source, keep_profile=keep_profile)
    known = known_pixels(image, header, how.mask, how.nodata)
    mask = None if known.all() else known
    nodata = None if mask is None or how.nodata is not None or how.depth else header.nodata
    file = {"metadata": _metadata(task, how.keep_metadata, keep_profile, nodata), "optimize": how.optimize}
    stopwatch.lap("read")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        result = _result(task, image, mask, how, file)
    stopwatch.lap("cluster")
    changed = _write(task.outputs, result, overwrite, file)
    stopwatch.lap("write")
    notes = [*(str(warning.message) for warning in caught), *changed]
    tessellation = result.tessellation  # None: the image had no more colors than asked for
    return {
        "width": image.shape[1],
        "height": image.shape[0],
        "channels": result.palette.shape[1],
        "left_out": 0 if mask is None else int((~mask).sum()),
        "distinct_colors": result.n_distinct,
        "k": len(result.palette),
        "elbow": result.curve.elbows() if result.curve else None,
        "energy": result.energy,
        "mse": result.mse,
        "psnr": result.psnr if math.isfinite(result.psnr) else None,  # JSON has no infinity
        "n_iter": tessellation.n_iter if tessellation else 0,
        "converged": tessellation.converged if tessellation else True,
        **({"warning": "; ".join(notes)} if notes else {}),
    }


def _metadata(task: Task, keep_all: bool, keep_profile: bool, nodata: float | None) -> Metadata | None:
    """Return what to keep of a file: in any case its georeference and nodata, which tell what the pixels are."""
    from cvtimg.pictures import Metadata, read_metadata

    tiffs = {path.suffix.lower() for path in (task.source, task.output)} <= {".tif", ".tiff"}
    if keep_all:
        kept = read_metadata(task.source, keep_profile=keep_profile)
        return replace(kept, nodata=nodata if tiffs else None)
    return Metadata(geo=read_metadata(task.source).geo, nodata=nodata) if tiffs else None


def _quantize_pages(task: Task, stopwatch: Stopwatch, header: ImageInfo, how: QuantizeOptions, overwrite: bool) -> Row:
    """Quantize all pages, or refuse options that pages cannot have."""
    for option in how.unfit("--psnr", "--max-bytes", "--weight-map", "-k auto", "--depth", "--optimize"):
        raise ValueError(f"has several pages, which {option} cannot be used for")
    return quantize_pages(task, stopwatch, header, how, overwrite=overwrite)


def _quantize_animation(
    task: Task, stopwatch: Stopwatch, header: ImageInfo, how: QuantizeOptions, overwrite: bool
) -> Row:
    """Quantize all frames, or refuse options that animations cannot have."""
    for option in how.unfit("--weight-map", "-k auto", "--depth 16", "--optimize"):
        raise ValueError(f"is an animation, which {option} cannot be used for")
    return quantize_animation(task, stopwatch, header, how, overwrite=overwrite)


def _result(
    task: Task, image: NDArray[Any], mask: NDArray[np.bool_] | None, how: QuantizeOptions, file: Mapping[str, Any]
) -> Quantized:
    """Quantize one image, with regard to its file and depth."""
    import numpy as np

    from cvtimg import quantize
    from cvtimg.colors.spaces import to_depth
    from cvtimg.pictures.formats.encoding import encode_image
    from cvtimg.quantization import quantize_to_size
    from cvtimg.quantization.own_palettes import own_palette

    if how.depth:
        image = to_depth(image, np.dtype(f"uint{how.depth}"))
    given = {"mask": mask, **how.target, **how.search, **how.mapping, **how.colors_of(image.dtype)}
    given = {name: value for name, value in given.items() if value is not None}
    if how.max_bytes is None:
        result = quantize(image, **given)
        own = None if how.colors else own_palette(task.source, result, how.search.get("n_colors"))
        return result if own is None else quantize(image, palette=own, mask=mask, **how.mapping)

    def size(result: Quantized) -> int:
        pixels, how_stored = _content(result, file)
        return len(encode_image(task.output.suffix, as_stored(pixels, task.output)[0], **how_stored))

    return quantize_to_size(image, how.max_bytes, size, **given)


def _content(result: Quantized, file: Mapping[str, Any]) -> tuple[NDArray[Any], dict[str, Any]]:
    """Return the pixels of a file, and how they are stored; where nodata is kept, they are not indexed."""
    pixels, palette = result.content
    metadata: Metadata | None = file["metadata"]
    if metadata and metadata.nodata is not None:
        if (result.palette == metadata.nodata).all(axis=1).any():  # a color would become nodata
            metadata = replace(metadata, nodata=None)
        else:
            n_channels = result.palette.shape[1]
            pixels, palette = result.image, None
            pixels = pixels[..., 0] if pixels.ndim == 3 and n_channels == 1 else pixels
    alpha = result.alpha if palette is None and pixels.ndim == 3 else None
    return pixels, {**file, "metadata": metadata, "palette": palette, "alpha": alpha}


def _write(outputs: Mapping[str, Path], result: Quantized, overwrite: bool, file: Mapping[str, Any]) -> list[str]:
    """Write the image and its palette; return what there is to say about it."""
    from cvtimg import write_image, write_palette

    pixels, how_stored = _content(result, file)
    stored, notes = as_stored(pixels, outputs["-o"])
    write_image(outputs["-o"], stored, **how_stored, overwrite=overwrite)
    if "--save-palette" in outputs:
        import numpy as np

        n_pixels = np.bincount(result.indices.ravel(), minlength=len(result.palette))
        write_palette(outputs["--save-palette"], result.palette, density=n_pixels, overwrite=overwrite)
    return notes
