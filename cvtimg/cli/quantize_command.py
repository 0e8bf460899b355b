"""``cvtimg quantize``: pictures to few colors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

from cvtimg.batch import Report, Row, Running, Task, WrongUsageError, check_choice, check_outputs, find, reason, run
from cvtimg.cli import options
from cvtimg.cli.animations import quantize_animation, stays_animated
from cvtimg.cli.batch_options import for_many
from cvtimg.cli.sharing import share
from cvtimg.cli.tiled import check_fit, goes_by_tiles, quantize_by_tiles

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.colors.samples import ColorSamples
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
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "distinct_colors", "k", "energy", "psnr", "seconds", "output")

#: Options of `quantize` that are for one picture and not for a palette.
ONLY_OF_ONE = ("psnr", "weights", "dither", "dither_strength")

_COUNT = options.count_or_auto(1, options.MAX_COLORS)
Colors = Annotated[
    Any, Option("--colors", "-k", metavar="N|auto", parser=_COUNT, help="Colors to keep, at most 65536; see elbow.")
]
Psnr = Annotated[
    float | None,
    Option("--psnr", metavar="DB", parser=options.number(0), help="Keep the fewest colors that reach this quality."),
]
MaxBytes = Annotated[
    int | None,
    Option(
        metavar="N",
        parser=options.whole_number(1, 1 << 62),
        help="Keep the most colors, up to 256 or -k, whose file has no more bytes.",
    ),
]
PaletteFile = Annotated[
    Path | None, Option("--palette", metavar="FILE", help="Take the colors of a palette file or of a picture.")
]
Lock = Annotated[
    list[str] | None,
    Option("--lock", metavar="COLOR", parser=options.color, help="Keep a color, '#rrggbb' or '#rrggbbaa', as it is."),
]
Space = Annotated[str, Option(metavar="NAME", help=f"Where distances are measured: {options.SPACE_NAMES}.")]
Dither = Annotated[str, Option(metavar="NAME", help=f"How colors are mixed: {options.DITHER_NAMES}.")]
DitherStrength = Annotated[
    float | None, Option(metavar="S", parser=options.number(0, 1), help="How much of that is done, 0 to 1.")
]
WeightMap = Annotated[
    Path | None, Option(metavar="FILE", help="Grey picture of the same size: how much each pixel counts.")
]
Depth = Annotated[
    str | None, Option(metavar="BITS", help="Work and write with 8 or 16 bits a sample; as the picture has by default.")
]
SharedPalette = Annotated[bool, Option("--shared-palette", help="Find one palette for all pictures together.")]
SavePalette = Annotated[
    Path | None,
    Option(metavar="FILE", help=f"Write the colors, {options.PALETTE_NAMES}; for one input."),
]
KeepMetadata = Annotated[
    bool,
    Option("--keep-metadata", help="Keep color profile, pixels an inch, EXIF and place, as far as they stay true."),
]
Optimize = Annotated[bool, Option("--optimize", help="Make PNG files smaller with oxipng; takes longer.")]
PerFrame = Annotated[
    bool, Option("--palette-per-frame", help="Find a palette for each frame of an animation, not one for all.")
]


@dataclass(frozen=True, slots=True)
class _How:
    """What is done to each picture: options of `quantize`, and what needs its file or its depth.

    Attributes
    ----------
    options : dict
        For `quantize`.
    colors : dict
        Options of `quantize` that are 8-bit colors, to be brought to the depth of the picture.
    depth : {"8", "16"} or None
        Bits a sample to work with.
    max_bytes : int or None
        Size of the file.
    keep_metadata, optimize, per_frame : bool
        As the options of these names.
    """

    options: Mapping[str, Any]
    colors: Mapping[str, Any]
    depth: str | None
    max_bytes: int | None
    keep_metadata: bool
    optimize: bool
    per_frame: bool


@for_many
def quantize(
    inputs: options.Pictures,
    colors: Colors = None,
    psnr: Psnr = None,
    max_bytes: MaxBytes = None,
    palette: PaletteFile = None,
    lock: Lock = None,
    space: Space = "rgb",
    dither: Dither = "none",
    dither_strength: DitherStrength = None,
    weight_map: WeightMap = None,
    depth: Depth = None,
    shared_palette: SharedPalette = False,
    output: options.Output = None,
    out_dir: options.OutDir = None,
    effort: options.Effort = "balanced",
    method: options.Method = None,
    volume_power: options.VolumePower = 0,
    init: options.Init = "split",
    seed: options.Seed = 0,
    save_palette: SavePalette = None,
    keep_metadata: KeepMetadata = False,
    optimize: Optimize = False,
    per_frame: PerFrame = False,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
    *,
    running: Running,
) -> None:
    """Reduce pictures to the N colors that stand best for them.

    N is given by -k (auto: by the elbow of the energy, see cvtimg elbow), or follows from --psnr or --max-bytes, with
    -k for the most; or --palette gives the colors.
    Without -o and --out-dir, one input gives NAME-quantized.png beside it. Up to 256 colors of 8 bits make an indexed
    PNG of the fewest bits. A picture that has no more than N colors comes back exactly. The output of -o can also end
    in .tif, .webp, .gif, .bmp, .ppm, .pgm or .npy. The same seed gives the same file. From TIFF to .tif a picture of
    over 2^26 pixels goes by tiles, as does Zarr: its memory is bounded, whatever its size.
    An animation stays one in .gif, .png and .webp, with one palette for all frames.
    """
    from cvtimg import find_images, read_palette
    from cvtimg.palettes.files import PALETTE_FORMATS, write_palette
    from cvtimg.pictures.files import lossless_suffixes

    _check_aims(
        {"-k": colors, "--psnr": psnr, "--max-bytes": max_bytes, "--lock": lock, "--weight-map": weight_map},
        palette,
        shared_palette,
    )
    engine = options.engine(effort=effort, method=method, init=init, volume_power=volume_power, seed=seed)
    mapping = _mapping(space, dither, dither_strength)
    if depth:
        check_choice("--depth", depth, ("8", "16"))
    columns = (*COLUMNS[:3], "elbow", *COLUMNS[3:]) if colors == "auto" else COLUMNS
    report = Report(columns, as_json=as_json, quiet=quiet)
    sources, missing = find(inputs, find_images, out_dir)
    single = {"-o": output} if shared_palette else {"-o": output, "--save-palette": save_palette}
    check_outputs(len(sources) + len(missing), out_dir, single)
    if output:
        check_choice("-o", output.suffix.lower(), [*lossless_suffixes(), ".zarr"])
    if optimize:
        _check_optimize(output)
    if save_palette and per_frame:
        raise WrongUsageError("--save-palette and --palette-per-frame exclude each other")
    if save_palette:
        check_choice("--save-palette", save_palette.suffix.lower(), PALETTE_FORMATS)
    extra = {"palette": save_palette} if save_palette and not shared_palette else {}
    name = "{}.png" if out_dir else "{}-quantized.png"
    tasks = [
        Task(source, {"picture": output or folder / name.format(source.stem), **extra})
        for source, folder in sources.items()
    ]
    files = (keep_metadata, optimize, per_frame)
    if palette:
        how = _How(mapping, {"palette": _read("--palette", palette, read_palette)}, depth, None, *files)
    else:
        weights = _read("--weight-map", weight_map, _read_weights) if weight_map else None
        sought = {"n_colors": colors, "psnr": psnr, "weights": weights, **mapping, **engine}
        how = _How(sought, {"locked": _locked(lock)} if lock else {}, depth, max_bytes, *files)
    if shared_palette:
        tasks, shared = share(tasks, missing, partial(_palette_of_all, how=how), depth, running)
        how = _How(mapping, {"palette": shared}, depth, None, *files)
        if save_palette and shared is not None:
            write_palette(save_palette, shared, overwrite=overwrite or running.skip_existing)
    work = partial(_quantize, overwrite=overwrite, how=how, max_pixels=running.max_pixels)
    raise typer.Exit(run(tasks, missing, work, report, out_dir=out_dir, overwrite=overwrite, running=running))


def _check_aims(aims: Mapping[str, Any], palette: Path | None, shared: bool) -> None:
    """Refuse aims that exclude each other, and none at all."""
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


def _palette_of_all(samples: ColorSamples, *, how: _How) -> NDArray[Any]:
    """Find a palette as `quantize` would for one picture."""
    from cvtimg import find_palette
    from cvtimg.colors.spaces import to_depth

    given: dict[str, Any] = {name: to_depth(colors, samples.colors.dtype) for name, colors in how.colors.items()}
    sought = {name: value for name, value in how.options.items() if name not in ONLY_OF_ONE}
    return find_palette(samples, **sought, **given).colors


def _mapping(space: str, dither: str, strength: float | None) -> dict[str, Any]:
    """Check the options of mapping to a palette, and name them as `quantize` does."""
    from cvtimg.colors import SPACES
    from cvtimg.quantization import DITHERS

    check_choice("--space", space, SPACES)
    check_choice("--dither", dither, ["none", *DITHERS])
    if dither == "none" and strength is not None:
        raise WrongUsageError("--dither-strength needs --dither")
    if dither == "none":
        return {"space": space}
    return {"space": space, "dither": dither, **({} if strength is None else {"dither_strength": strength})}


def _locked(colors: list[str]) -> NDArray[np.uint8]:
    """(L, 3) colors, or (L, 4) if some have transparency."""
    import numpy as np

    rgba = np.array([list(bytes.fromhex(color)) for color in colors], np.uint8)
    return rgba if (rgba[:, 3] < 255).any() else rgba[:, :3]


def _read(option: str, path: Path, reader: Callable[[Path], NDArray[Any]]) -> NDArray[Any]:
    """Read a file that all inputs need."""
    try:
        return reader(path)
    except (OSError, ValueError) as error:
        raise WrongUsageError(f"{option}: {path}: {reason(path, error)}") from error


def _read_weights(path: Path) -> NDArray[Any]:
    """Read a grey picture, one channel or the same in all."""
    from cvtimg import read_image

    weights = read_image(path)
    if weights.ndim == 2:
        return weights
    if weights.shape[2] > 4 or (weights[..., :1] != weights[..., :3]).any():
        raise ValueError("must be a grey picture")
    return weights[..., 0]


def _quantize(task: Task, *, overwrite: bool, how: _How, max_pixels: int | None) -> Row:
    from cvtimg import read_image
    from cvtimg.pictures import read_metadata

    if stays_animated(task):
        return _quantize_animation(task, overwrite, how)
    if goes_by_tiles(task.source, task.outputs["picture"]):
        return _by_tiles(task, overwrite, how, max_pixels)
    start = perf_counter()
    image = read_image(task.source)
    file = {"metadata": read_metadata(task.source) if how.keep_metadata else None, "optimize": how.optimize}
    read = perf_counter()
    result = _result(image, how, task.outputs["picture"].suffix, file)
    clustered = perf_counter()
    _write(task.outputs, result, overwrite, file)
    written = perf_counter()
    tessellation = result.tessellation  # None: the picture had no more colors than asked for
    return {
        "input": str(task.source),
        "output": str(task.outputs["picture"]),
        "width": image.shape[1],
        "height": image.shape[0],
        "channels": result.palette.shape[1],
        "distinct_colors": result.n_distinct,
        "k": len(result.palette),
        "elbow": result.curve.elbows() if result.curve else None,
        "energy": result.energy,
        "mse": result.mse,
        "psnr": result.psnr if math.isfinite(result.psnr) else None,  # JSON has no infinity
        "n_iter": tessellation.n_iter if tessellation else 0,
        "converged": tessellation.converged if tessellation else True,
        "seconds": {"read": read - start, "cluster": clustered - read, "write": written - clustered},
    }


def _by_tiles(task: Task, overwrite: bool, how: _How, max_pixels: int | None) -> Row:
    unfit = {"--psnr": how.options.get("psnr"), "--weight-map": how.options.get("weights")}
    unfit |= {"--dither": how.options.get("dither"), "-k auto": how.options.get("n_colors") == "auto"}
    unfit |= {"--depth": how.depth, "--max-bytes": how.max_bytes}
    unfit |= {"--keep-metadata": how.keep_metadata, "--optimize": how.optimize}
    check_fit(task.source, unfit, max_pixels)
    options = {name: value for name, value in how.options.items() if name not in ONLY_OF_ONE}
    return quantize_by_tiles(task, {**options, **how.colors}, overwrite=overwrite)


def _quantize_animation(task: Task, overwrite: bool, how: _How) -> Row:
    """Quantize all frames, if what is asked for can be done to them."""
    aims = {"--psnr": how.options.get("psnr"), "--max-bytes": how.max_bytes, "--weight-map": how.options.get("weights")}
    aims |= {"-k auto": True if how.options.get("n_colors") == "auto" else None}
    aims |= {"--depth 16": how.depth == "16" or None, "--optimize": how.optimize or None}
    for option, value in aims.items():
        if value is not None:
            raise ValueError(f"is an animation, which {option} cannot be used for")
    given = {name: value for name, value in how.options.items() if name not in ("psnr", "weights")}
    return quantize_animation(
        task,
        {**given, **how.colors},
        per_frame=how.per_frame,
        keep_metadata=how.keep_metadata,
        overwrite=overwrite,
    )


def _result(image: NDArray[Any], how: _How, suffix: str, file: Mapping[str, Any]) -> Quantized:
    """Quantize a picture as its file and its depth need."""
    import numpy as np

    from cvtimg import quantize
    from cvtimg.colors.spaces import to_depth
    from cvtimg.pictures.formats.encoding import encode_image
    from cvtimg.quantization import quantize_to_size

    if how.depth:
        image = to_depth(image, np.dtype(f"uint{how.depth}"))
    given: dict[str, Any] = {name: to_depth(colors, image.dtype) for name, colors in how.colors.items()}
    if how.max_bytes is None:
        return quantize(image, **how.options, **given)

    def size(result: Quantized) -> int:
        pixels, palette = result.content
        return len(encode_image(suffix, pixels, palette=palette, **file))

    sought = {name: value for name, value in how.options.items() if value is not None}
    return quantize_to_size(image, how.max_bytes, size, **sought, **given)


def _write(outputs: Mapping[str, Path], result: Quantized, overwrite: bool, file: Mapping[str, Any]) -> None:
    from cvtimg import write_image
    from cvtimg.palettes.files import write_palette

    pixels, palette = result.content
    write_image(outputs["picture"], pixels, palette=palette, overwrite=overwrite, **file)
    if "palette" in outputs:
        import numpy as np

        n_pixels = np.bincount(result.indices.ravel(), minlength=len(result.palette))
        write_palette(outputs["palette"], result.palette, density=n_pixels, overwrite=overwrite)
