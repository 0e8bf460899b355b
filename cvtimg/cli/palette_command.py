"""``cvtimg palette``: the colors of images and their shares."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from cvtimg.cli.running import Given, Report, Row, Stopwatch, Task, Todo, plan_of, planned
from cvtimg.options.quantize_options import DEFAULT_COLORS, MAIN_COLORS

if TYPE_CHECKING:
    from cvtimg._shared.types import Array, Ints64

EXAMPLES = """\
  cvtimg palette photo.jpg -k 8
  cvtimg palette sprite.png --save-palette sprite.hex
  cvtimg palette photo.jpg --main --save-palette main.svg
  cvtimg palette photo.jpg -k 12 --sort hue
  cvtimg palette photos/ --json
"""
_MOST_OWN = 256


def palette(given: Given) -> Todo:
    """Print the palette of images, and the share of the pixels of each color.

    An image with at most 256 colors, or at most N, has its own colors listed. Others are reduced first, as by
    cvtimg quantize. With --main, the few colors that stand out are listed, such as a small red flower in a green
    field. A palette file, such as game.gpl, has its colors in their order.
    """
    return planned(plan_of(given), _palette, _Palettes((), as_json=given.as_json, quiet=given.quiet), given)


def _palette(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    import numpy as np

    from cvtimg import quantize, write_palette
    from cvtimg.colors import color_samples
    from cvtimg.colors.spaces import to_depth
    from cvtimg.palettes import color_order, read_palette
    from cvtimg.palettes.files import PALETTE_FORMATS
    from cvtimg.pictures.stacks import read_whole
    from cvtimg.quantization import main_palette, map_to_palette
    from cvtimg.quantization.images import as_seen

    # A palette file is an image of one pixel for each color.
    is_palette = task.source.suffix.lower() in PALETTE_FORMATS.keys() - {".png"}
    image = read_palette(task.source)[None] if is_palette else read_whole(task.source)
    stopwatch.lap("read")
    if image.ndim == 3 and image.shape[2] not in (3, 4):
        raise ValueError(f"has {image.shape[2]} bands, which are not colors")
    image = as_seen(image)
    if image.dtype.kind in "iu" and image.dtype.itemsize > 2:
        raise ValueError(f"has {image.dtype} samples, of which nothing tells which is white: save 8 or 16 bits")
    known = np.isfinite(image)
    image = to_depth(image if known.all() else np.where(known, image, 0).view(type(image)), np.dtype(np.uint8))
    image = image if known.all() else np.ma.masked_array(image, ~known)
    n_distinct = color_samples(image).n_colors
    locked = given.arguments.get("locked")
    if given.main:
        colors = main_palette(image, given.number or MAIN_COLORS, locked=locked).colors
        result = map_to_palette(image, colors, space="oklab")
    elif is_palette and given.number is None:
        result = map_to_palette(image, image[0])  # in the order of the file
    else:
        wanted = given.number or (_MOST_OWN if n_distinct <= _MOST_OWN else DEFAULT_COLORS)
        result = quantize(image, wanted, space=given.space, locked=locked)
    labels = result.indices if result.inside is None else result.indices[result.inside]
    counts = np.bincount(labels.ravel(), minlength=len(result.palette))
    order = color_order(result.palette, given.sort, density=counts)
    colors, counts = result.palette[order], counts[order]
    stopwatch.lap("cluster")
    if "--save-palette" in task.outputs:
        write_palette(task.outputs["--save-palette"], colors, density=counts, overwrite=given.overwrite)
        stopwatch.lap("write")
    return {"distinct_colors": n_distinct, "k": len(colors), "colors": _entries(colors, counts)}


def _entries(palette: Array, counts: Ints64) -> list[Row]:
    channels = {1: [0, 0, 0], 2: [0, 0, 0, 1]}.get(palette.shape[1], slice(None))
    return [
        {
            "hex": f"#{color.tobytes().hex()}",
            "rgb": color[:3].tolist(),
            **({"alpha": int(color[3])} if len(color) == 4 else {}),
            "share": count / counts.sum(),
            "pixels": int(count),
        }
        for color, count in zip(palette[:, channels], counts, strict=True)
    ]


class _Palettes(Report):
    """Prints the colors of each image as it is done, as blocks of color on a terminal."""

    def show(self, row: Row) -> None:
        self.say(f"{row['input']}: {row['k']} of {row['distinct_colors']} colors".encode(errors="replace").decode())
        if sys.stdout.isatty():
            from rich.console import Console
            from rich.table import Table
            from rich.text import Text

            table = Table(box=None, pad_edge=False, show_header=False)
            largest = max(color["share"] for color in row["colors"])
            for color in row["colors"]:
                rgb = color["hex"][:7]
                bar = Text("█" * max(round(30 * color["share"] / largest), 1), style=rgb)
                table.add_row(Text(" " * 8, style=f"on {rgb}"), color["hex"], f"{color['share']:7.2%}", bar)
            Console(highlight=False).print(table)
        else:
            self.say(*(f"{color['hex']}\t{color['share']:.6f}\t{color['pixels']}" for color in row["colors"]))
