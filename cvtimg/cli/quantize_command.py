"""``cvtimg quantize``: images reduced to few colors."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvtimg._shared.extras import needs
from cvtimg.batch import WrongUsageError, check_suffix, plan_each
from cvtimg.batch.report import reason
from cvtimg.cli import options
from cvtimg.cli import quantize_options as own
from cvtimg.cli.frame import run_plan
from cvtimg.cli.quantize_images import quantize_image
from cvtimg.cli.sharing import count_known, share

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.colors.samples import ColorSamples

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
    reading: options.InputOptions,
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
    if dither_strength is not None and dither == "none":
        raise WrongUsageError("--dither-strength needs --dither")
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
    finding = {"n_colors": colors, "space": space, "locked": _locked(lock) if lock else None, **engine.keywords}
    how = {
        **({"palette": _read("--palette", palette, read_palette), "space": space} if palette else finding),
        "psnr": psnr,
        "max_bytes": max_bytes,
        "dither": None if dither == "none" else dither,
        "dither_strength": dither_strength,
        "weights": weight_map and _read("--weight-map", weight_map, _read_weights),
        "mask": mask,
        "nodata": nodata,
        "depth": depth,
        "per_frame": per_frame,
        "keep_metadata": keep_metadata,
        "optimize": optimize,
        "max_pixels": max_pixels,
        "overwrite": common.overwrite,
    }
    if shared_palette:
        running = common.running(skip_existing=skip_existing, in_place=in_place)
        find = partial(_palette_of_all, options=finding)
        count = partial(count_known, depth=depth, mask=mask, nodata=nodata, max_pixels=max_pixels)
        shared = share(plan, find, reading.chosen(count), running=running)
        how = {"palette": shared, **{name: value for name, value in how.items() if name not in finding}, "space": space}
        if save_palette and shared is not None:
            write_palette(save_palette, shared, overwrite=running.overwrite or skip_existing)
            plan.joint = {}
    work = partial(quantize_image, options=how)
    columns = (*COLUMNS[:3], "elbow", *COLUMNS[3:]) if colors == "auto" else COLUMNS
    return run_plan(
        plan,
        reading.chosen(work),
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
        raise WrongUsageError(f"--optimize needs {needs('oxipng', 'oxipng')}")


def _palette_of_all(samples: ColorSamples, *, options: dict[str, Any]) -> NDArray[Any]:
    """Find a palette as `quantize` would for one image."""
    from cvtimg import find_palette
    from cvtimg.colors.spaces import to_depth

    locked = options["locked"]
    if locked is not None:
        locked = to_depth(locked, samples.colors.dtype)
    return find_palette(samples, **{**options, "locked": locked}).colors


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
