"""``cvtimg quantize``: images reduced to few colors."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Row, Stopwatch, Task, WrongUsageError, check_suffix, plan_each, reason
from cvtimg.cli import options
from cvtimg.cli import quantize_options as own
from cvtimg.cli.animations import quantize_animation, stays_animated
from cvtimg.cli.frame import run_plan
from cvtimg.cli.known_pixels import known_pixels
from cvtimg.cli.pages import has_pages, quantize_pages
from cvtimg.cli.quantize_options import QuantizeOptions
from cvtimg.cli.sharing import count_known, share
from cvtimg.cli.tiled import check_fit, needs_tiles, quantize_in_tiles

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.colors.samples import ColorSamples
    from cvtimg.pictures import Metadata
    from cvtimg.quantization.remapping import Quantized

EXAMPLES = """Examples:

\b
  cvtimg quantize photo.jpg -k 16 -o small.png
  cvtimg quantize photos/ 'scans/*.tif' -k 256 --out-dir small
  cvtimg quantize logo.png -k 8 --lock '#ffffff' --lock '#e4002b'
  cvtimg quantize photo.jpg --psnr 38
  cvtimg quantize drawing.png -k auto
  cvtimg quantize frames/ -k 32 --shared-palette --out-dir small
  cvtimg quantize sprite.png --palette game.gpl --dither blue-noise
  cvtimg quantize film.gif -k 64 -o smaller.gif
  cvtimg quantize icons/*.png --psnr 40 --in-place --skip-if-larger
  curl -s example.org/photo.jpg | cvtimg quantize - -k 32 > small.png
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "distinct_colors", "k", "energy", "psnr", "input_bytes", "output_bytes", "seconds", "output")


def quantize(
    inputs: options.Images,
    colors: own.Colors = None,
    psnr: own.Psnr = None,
    max_bytes: own.MaxBytes = None,
    palette: own.PaletteFile = None,
    lock: own.Lock = None,
    space: options.Space = "rgb",
    dither: own.Dither = "none",
    dither_strength: own.DitherStrength = None,
    weight_map: own.WeightMap = None,
    mask: options.Mask = None,
    nodata: options.NoData = None,
    depth: own.Depth = None,
    shared_palette: own.SharedPalette = False,
    output: options.Output = None,
    out_dir: options.OutDir = None,
    ext: own.Ext = None,
    in_place: own.InPlace = False,
    skip_if_larger: own.SkipIfLarger = False,
    save_palette: own.SavePalette = None,
    keep_metadata: own.KeepMetadata = False,
    optimize: own.Optimize = False,
    per_frame: own.PerFrame = False,
    skip_existing: options.SkipExisting = False,
    max_pixels: options.MaxPixels = None,
    *,
    engine: options.EngineOptions,
    common: options.BatchOptions,
) -> int:
    """Reduce images to the N colors that represent them with the least error.

    Give the number of colors by -k, or let it follow from --psnr or --max-bytes (-k is then the largest number), or
    take all colors from --palette.

    Without -o and --out-dir, the output of one input is NAME-quantized.png beside it. Images of up to 256 colors
    become indexed PNG files of the fewest bits. Images with at most N colors are reproduced exactly. The name after
    -o can also end in .tif, .webp, .gif, .bmp, .ppm, .pgm or .npy. The same seed gives the same file.

    TIFF files of over 2^26 pixels with -o FILE.tif, and Zarr arrays, are read in tiles: memory stays bounded.
    Animations stay animations in .gif, .png and .webp, with one palette for all frames; so do TIFF files of several
    pages, with -o FILE.tif.
    """
    from cvtimg import find_images, read_palette, write_palette
    from cvtimg.palettes.files import PALETTE_FORMATS
    from cvtimg.pictures.files import lossless_suffixes

    _check_aims(
        {"-k": colors, "--psnr": psnr, "--max-bytes": max_bytes, "--lock": lock, "--weight-map": weight_map},
        palette,
        shared_palette,
    )
    mapping = _mapping(space, dither, dither_strength)
    check_suffix("-o", output, [*lossless_suffixes(), ".zarr"])
    check_suffix("--save-palette", save_palette, PALETTE_FORMATS)
    if optimize:
        _check_optimize(output)
    if save_palette and per_frame:
        raise WrongUsageError("--save-palette and --palette-per-frame exclude each other")
    _check_names(output, out_dir, ext, in_place, lossless_suffixes())
    saved = {"--save-palette": save_palette}
    plan = plan_each(
        inputs,
        find_images,
        {
            "-o": output or partial(_name, out_dir=out_dir, ext=ext, in_place=in_place),
            **({} if shared_palette else saved),
        },
        out_dir=out_dir,
        beside=in_place or ext is not None,
        also_read=[palette, weight_map, mask, *(one for one in lock or [] if isinstance(one, Path))],
        joint=saved if shared_palette else None,
    )
    given: dict[str, Any] = {"palette": _read("--palette", palette, read_palette)} if palette else {}
    if lock:
        given["locked"] = _locked(lock)
    how = QuantizeOptions(
        mapping=mapping,
        search={} if palette else {"n_colors": colors, **engine.keywords},
        target={"psnr": psnr, "weights": weight_map and _read("--weight-map", weight_map, _read_weights)},
        colors=given,
        depth=depth,
        max_bytes=max_bytes,
        keep_metadata=keep_metadata,
        optimize=optimize,
        per_frame=per_frame,
        mask=mask,
        nodata=nodata,
    )
    if shared_palette:
        running = common.running(skip_existing=skip_existing, in_place=in_place)
        find = partial(_palette_of_all, how=how)
        count = partial(count_known, depth=depth, mask=mask, nodata=nodata, max_pixels=max_pixels)
        shared = share(plan, find, count, running=running)
        how = replace(how, search={}, colors={"palette": shared})
        if save_palette and shared is not None:
            write_palette(save_palette, shared, overwrite=running.overwrite or skip_existing)
            plan.joint = {}
    work = partial(_quantize, how=how, overwrite=common.overwrite, max_pixels=max_pixels)
    columns = (*COLUMNS[:3], "elbow", *COLUMNS[3:]) if colors == "auto" else COLUMNS
    return run_plan(
        plan,
        work,
        columns,
        common,
        max_pixels=max_pixels,
        skip_existing=skip_existing,
        in_place=in_place,
        skip_if_larger=skip_if_larger,
    )


def _check_names(output: Path | None, out_dir: Path | None, ext: str | None, in_place: bool, known: list[str]) -> None:
    """Refuse naming options that exclude each other, and formats that cannot be written."""
    ways = {"-o": output, "--out-dir": out_dir, "--ext": ext, "--in-place": in_place}
    given = [option for option, value in ways.items() if value]
    if len(given) > 1 and given != ["--out-dir", "--ext"]:
        raise WrongUsageError(f"{given[0]} and {given[1]} exclude each other")
    if ext is not None:
        check_suffix("--ext", Path(f"NAME{ext}"), known)
        if os.sep in ext or "{" in ext or "}" in ext:
            raise WrongUsageError(f"--ext: {ext!r} must be the end of a file name")


def _name(source: Path, *, out_dir: Path | None, ext: str | None, in_place: bool) -> str:
    """Return the name pattern of the output; GIF stays GIF, because it may be an animation."""
    if in_place:
        return f"{{}}{source.suffix}"
    suffix = ".gif" if source.suffix.lower() == ".gif" else ".png"
    return f"{{}}{ext or ('' if out_dir else '-quantized') + suffix}"


def _check_aims(aims: Mapping[str, Any], palette: Path | None, shared: bool) -> None:
    """Require a target, and refuse targets that exclude each other."""
    given = [option for option, value in aims.items() if value not in (None, [])]
    if palette and given:
        raise WrongUsageError(f"--palette and {given[0]} exclude each other")
    if aims["-k"] == "auto" and {"--psnr", "--max-bytes"} & set(given):
        raise WrongUsageError("-k auto and --psnr or --max-bytes exclude each other")
    if shared and (palette or given not in (["-k"], ["-k", "--lock"])):
        raise WrongUsageError("--shared-palette needs -k, and goes with no other aim but --lock")
    if "--psnr" in given and "--max-bytes" in given:
        raise WrongUsageError("--psnr and --max-bytes exclude each other")
    if not palette and not {"-k", "--psnr", "--max-bytes"} & set(given):
        raise WrongUsageError("one of -k, --psnr, --max-bytes and --palette must be given")


def _check_optimize(output: Path | None) -> None:
    from importlib.util import find_spec

    if output and output.suffix.lower() != ".png":
        raise WrongUsageError(f"--optimize is for .png, and not for {output}")
    if find_spec("oxipng") is None:
        raise WrongUsageError("--optimize needs oxipng: pip install 'cvtimg[oxipng]'")


def _palette_of_all(samples: ColorSamples, *, how: QuantizeOptions) -> NDArray[Any]:
    """Find a palette as `quantize` would for one image."""
    from cvtimg import find_palette

    return find_palette(samples, **how.of_palette, **how.colors_of(samples.colors.dtype)).colors


def _mapping(space: str, dither: str, strength: float | None) -> dict[str, Any]:
    """Return the options of mapping to a palette, by their names in `quantize`."""
    if dither != "none":
        return {"space": space, "dither": dither, **({} if strength is None else {"dither_strength": strength})}
    if strength is not None:
        raise WrongUsageError("--dither-strength needs --dither")
    return {"space": space}


def _locked(colors: list[str | Path]) -> NDArray[np.uint8]:
    """(L, 3) colors, or (L, 4) if some have transparency, each once."""
    import numpy as np

    from cvtimg import read_palette

    rgba: list[tuple[int, ...]] = []
    for color in colors:
        rows = [bytes.fromhex(color)] if isinstance(color, str) else _read("--lock", color, read_palette).tolist()
        rgba += [(*row, 255)[:4] for row in rows]
    distinct = np.array(list(dict.fromkeys(rgba)), np.uint8)
    return distinct if (distinct[:, 3] < 255).any() else distinct[:, :3]


def _read(option: str, path: Path, reader: Callable[[Path], NDArray[Any]]) -> NDArray[Any]:
    """Read a file that all inputs need."""
    try:
        return reader(path)
    except (OSError, ValueError) as error:
        raise WrongUsageError(f"{option}: {path}: {reason(path, error)}") from error


def _read_weights(path: Path) -> NDArray[Any]:
    """Read a gray image: one channel, or the same in all."""
    from cvtimg import read_image

    weights = read_image(path)
    if weights.ndim == 2:
        return weights
    if weights.shape[2] > 4 or (weights[..., :1] != weights[..., :3]).any():
        raise ValueError("must be a gray image")
    return weights[..., 0]


def _quantize(
    task: Task, stopwatch: Stopwatch, *, how: QuantizeOptions, overwrite: bool, max_pixels: int | None
) -> Row:
    from cvtimg import read_image
    from cvtimg.pictures import image_info, open_bands

    if needs_tiles(task.source, task.output):
        unfit = ("--psnr", "--weight-map", "--dither", "-k auto", "--depth", "--max-bytes", "--mask", "--nodata")
        check_fit(task.source, how.unfit(*unfit, "--keep-metadata", "--optimize"), max_pixels)
        form = open_bands(task.source).form
        given = {**how.of_palette, **how.colors_of(form.dtype)}
        row = quantize_in_tiles(task, stopwatch, given, overwrite=overwrite)
        return row | _counted(form.nodata, "tiles")
    header = image_info(task.source)
    if stays_animated(task, header):
        return _quantize_animation(task, stopwatch, how, overwrite)
    if has_pages(header):
        return _quantize_pages(task, stopwatch, how, overwrite)
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
    _write(task.outputs, result, overwrite, file)
    stopwatch.lap("write")
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
        **({"warning": "; ".join(str(warning.message) for warning in caught)} if caught else {}),
    }


def _counted(nodata: float | None, where: str) -> Row:
    """Warn that the nodata value of a file is not left out."""
    return {} if nodata is None else {"warning": f"pixels of the nodata value {nodata:g} count in {where}"}


def _metadata(task: Task, keep_all: bool, keep_profile: bool, nodata: float | None) -> Metadata | None:
    """Return what to keep of a file: in any case its georeference and nodata, which tell what the pixels are."""
    from cvtimg.pictures import Metadata, read_metadata

    tiffs = {path.suffix.lower() for path in (task.source, task.output)} <= {".tif", ".tiff"}
    if keep_all:
        kept = read_metadata(task.source, keep_profile=keep_profile)
        return replace(kept, nodata=nodata if tiffs else None)
    return Metadata(geo=read_metadata(task.source).geo, nodata=nodata) if tiffs else None


def _quantize_pages(task: Task, stopwatch: Stopwatch, how: QuantizeOptions, overwrite: bool) -> Row:
    """Quantize all pages, or refuse options that pages cannot have."""
    from cvtimg.pictures import image_info, read_pages

    for option in how.unfit(
        "--psnr", "--max-bytes", "--weight-map", "-k auto", "--depth", "--optimize", "--mask", "--nodata"
    ):
        raise ValueError(f"has several pages, which {option} cannot be used for")
    given = how.colors_of(read_pages(task.source).images[0].dtype) if how.colors else {}
    options = {**how.search, **how.mapping, **given}
    row = quantize_pages(task, stopwatch, options, per_page=how.per_frame, overwrite=overwrite)
    return row | _counted(image_info(task.source).nodata, "files of several pages")


def _quantize_animation(task: Task, stopwatch: Stopwatch, how: QuantizeOptions, overwrite: bool) -> Row:
    """Quantize all frames, or refuse options that animations cannot have."""
    for option in how.unfit("--weight-map", "-k auto", "--depth 16", "--optimize", "--mask", "--nodata"):
        raise ValueError(f"is an animation, which {option} cannot be used for")
    return quantize_animation(
        task,
        stopwatch,
        {**how.search, **how.mapping, **how.colors},
        psnr=how.target.get("psnr"),
        max_bytes=how.max_bytes,
        per_frame=how.per_frame,
        keep_metadata=how.keep_metadata,
        overwrite=overwrite,
    )


def _result(
    task: Task, image: NDArray[Any], mask: NDArray[np.bool_] | None, how: QuantizeOptions, file: Mapping[str, Any]
) -> Quantized:
    """Quantize one image, with regard to its file and depth."""
    import numpy as np

    from cvtimg import quantize
    from cvtimg.colors.spaces import to_depth
    from cvtimg.pictures.formats.encoding import encode_image
    from cvtimg.quantization import quantize_to_size

    if how.depth:
        image = to_depth(image, np.dtype(f"uint{how.depth}"))
    given = {"mask": mask, **how.target, **how.search, **how.mapping, **how.colors_of(image.dtype)}
    given = {name: value for name, value in given.items() if value is not None}
    if how.max_bytes is None:
        result = quantize(image, **given)
        own = _own_palette(task.source, result, how)
        return result if own is None else quantize(image, palette=own, mask=mask, **how.mapping)

    def size(result: Quantized) -> int:
        pixels, how_stored = _content(result, file)
        return len(encode_image(task.output.suffix, pixels, **how_stored))

    return quantize_to_size(image, how.max_bytes, size, **given)


def _own_palette(source: Path, result: Quantized, how: QuantizeOptions) -> NDArray[Any] | None:
    """Return the palette of an indexed image that is reproduced exactly, so that its indices keep their meaning."""
    n_colors = how.search.get("n_colors")
    if result.energy or not isinstance(n_colors, int) or how.colors or result.palette.dtype.itemsize > 1:
        return None
    from cvtimg import read_palette
    from cvtimg.pictures import image_info

    if image_info(source).mode != "P":
        return None
    own = read_palette(source)
    return own if len(own) <= n_colors and own.shape[1] == result.palette.shape[1] else None


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


def _write(outputs: Mapping[str, Path], result: Quantized, overwrite: bool, file: Mapping[str, Any]) -> None:
    from cvtimg import write_image, write_palette

    pixels, how_stored = _content(result, file)
    write_image(outputs["-o"], pixels, **how_stored, overwrite=overwrite)
    if "--save-palette" in outputs:
        import numpy as np

        n_pixels = np.bincount(result.indices.ravel(), minlength=len(result.palette))
        write_palette(outputs["--save-palette"], result.palette, density=n_pixels, overwrite=overwrite)
