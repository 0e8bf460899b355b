"""The files that ``cvtimg segment`` can write for an image: their names, and how each is drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from cvtimg.batch import WrongUsageError, check_suffix
from cvtimg.options.record import Given
from cvtimg.options.segment_options import HIERARCHY_KINDS, KINDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cvtimg.labels.contours import Contours
    from cvtimg.pictures import Metadata
    from cvtimg.pictures.files import ImageInfo
    from cvtimg.segmentation import RegionHierarchy

#: Numbers of regions on a sheet of cuts.
_SHOWN_CUTS = (5, 10, 20, 50)


class Style(NamedTuple):
    """How edges and contours are drawn."""

    edge_mode: str
    line_color: tuple[int, ...]
    line_width: int
    subpixel: bool
    simplify: float
    #: The label whose borders are not drawn: 0, unless that is the background of objects.
    ignore: int | None
    #: More columns of the table.
    properties: tuple[str, ...]

    @classmethod
    def of(cls, given: Given) -> Style:
        """Take the style from the options of the command."""
        return cls(
            given.edge_mode,
            tuple(bytes.fromhex(given.line_color)[:3]),
            given.line_width,
            given.subpixel,
            given.simplify,
            None if given.objects else 0,
            tuple(filter(None, (name.strip() for name in (given.properties or "").split(",")))),
        )


def outputs_of(given: Given) -> dict[str, Path | str]:
    """Name the outputs of each image, by option."""
    kinds = KINDS | HIERARCHY_KINDS if given.hierarchy else KINDS
    outputs: dict[str, Path | str] = {}
    for item in filter(None, (part.strip() for part in (given.write or "").split(","))):
        kind, dot, end = item.partition(".")
        if kind not in kinds:
            needs = " without --hierarchy" if kind in HIERARCHY_KINDS else ""
            raise WrongUsageError(f"--write: {kind!r} must be one of {', '.join(kinds)}{needs}")
        suffix = dot + end.lower() if dot else kinds[kind][0]
        check_suffix(f"--write {kind}", Path(f"{kind}{suffix}"), kinds[kind])
        outputs[f"--write {kind}{suffix}"] = f"{{}}-{kind}{suffix}"
    for kind in kinds:
        if path := given.output if kind == "labels" else getattr(given, kind):
            outputs["-o" if kind == "labels" else f"--{kind}"] = path
    return outputs or {"-o": "{}-labels.png"}


def kind_of(option: str) -> str:
    """Return the kind of output that an option names: "--mean", "--write mean.png", or "-o" for labels."""
    return "labels" if option == "-o" else option.removeprefix("--").removeprefix("write ").partition(".")[0]


@dataclass(frozen=True, eq=False)
class Subject:
    """A segmented image and its source."""

    source: Path
    image: NDArray[Any]
    labels: NDArray[Any]
    header: ImageInfo
    style: Style
    overwrite: bool
    hierarchy: RegionHierarchy | None = None

    @cached_property
    def contours(self) -> Contours:
        """The borders of the segments."""
        from cvtimg import find_contours

        image = self.image if self.style.subpixel else None
        return find_contours(self.labels, image, tolerance=self.style.simplify)

    def place(self, nodata: float | None = None) -> Metadata | None:
        """Return where and how large pixels are: the georeference of a GeoTIFF, with a value for no data, or a size."""
        from cvtimg.pictures import Metadata, read_metadata
        from cvtimg.pictures.formats.metadata import dpi_of

        if self.header.geo_transform:
            geo = read_metadata(self.source).geo
            return Metadata(geo=geo, nodata=nodata) if geo else None
        scale = self.header.pixel_size.scale() if self.header.pixel_size else {}
        return Metadata(dpi=dpi_of(scale), scale=scale) if scale else None

    def write(self, outputs: Mapping[str, Path]) -> None:
        """Write what was asked for, by option."""
        for option, path in outputs.items():
            _WRITERS[kind_of(option)](self, path)


def _write_labels(subject: Subject, path: Path) -> None:
    from cvtimg.labels.files import write_labels

    write_labels(path, subject.labels, metadata=subject.place(nodata=0), overwrite=subject.overwrite)


def _write_mean(subject: Subject, path: Path) -> None:
    from cvtimg import write_image
    from cvtimg.labels import mean_picture
    from cvtimg.pictures.formats.encoding import as_stored

    mean, _ = as_stored(mean_picture(subject.labels, subject.image), path.suffix)
    write_image(path, mean, alpha=False, metadata=subject.place(), overwrite=subject.overwrite)


def _write_edges(subject: Subject, path: Path) -> None:
    from cvtimg import find_edges, write_image

    edges = find_edges(subject.labels, mode=subject.style.edge_mode, ignore=subject.style.ignore)
    write_image(path, edges, metadata=subject.place(), overwrite=subject.overwrite)


def _without_fourth(image: NDArray[Any]) -> NDArray[Any]:
    """Drop the fourth of four bands, which is not alpha: that has been removed."""
    return image[..., :3] if image.shape[2:] == (4,) else image


def _write_overlay(subject: Subject, path: Path) -> None:
    from cvtimg import write_image
    from cvtimg.plotting.sheets import draw_edges

    style = subject.style
    color, thickness = style.line_color, style.line_width
    drawn = draw_edges(
        _without_fourth(subject.image), subject.labels, color=color, thickness=thickness, ignore=style.ignore
    )
    write_image(path, drawn, metadata=subject.place(), overwrite=subject.overwrite)


def _write_contours(subject: Subject, path: Path) -> None:
    from cvtimg.labels import write_contours
    from cvtimg.plotting import contour_drawing

    drawing = contour_drawing(subject.contours, subject.labels, subject.image)
    if subject.header.geo_transform:
        place = subject.header.geo_transform
        drawing = replace(drawing, transform=[place[:3], place[3:]], epsg=subject.header.epsg)
    elif size := subject.header.pixel_size:
        drawing = replace(drawing, transform=[[size.x, 0, 0], [0, size.y, 0]], unit=size.unit)
    write_contours(path, drawing, overwrite=subject.overwrite)


def _write_table(subject: Subject, path: Path) -> None:
    from cvtimg.labels import region_table
    from cvtimg.labels.files import write_table

    table = region_table(
        subject.labels,
        subject.image,
        subject.style.properties,
        pixel_size=subject.header.pixel_size,
        channels=subject.header.channels,
    )
    write_table(path, table, overwrite=subject.overwrite)


def _write_coco(subject: Subject, path: Path) -> None:
    from cvtimg.labels import write_coco

    write_coco(path, subject.labels, subject.source.name, overwrite=subject.overwrite)


def _tree_of(subject: Subject) -> RegionHierarchy:
    assert subject.hierarchy is not None  # the kinds of output that need a tree are refused without one
    return subject.hierarchy


def _write_tree(subject: Subject, path: Path) -> None:
    _tree_of(subject).save(path, overwrite=subject.overwrite)


def _write_strengths(subject: Subject, path: Path) -> None:
    """Write the strengths of borders: as they are, or as a picture in 8 bits with 1 and more in white."""
    import numpy as np

    from cvtimg import write_image

    strengths = _tree_of(subject).contour_map()
    if path.suffix.lower() == ".png":
        strengths = np.rint(255 * np.minimum(strengths, 1)).astype(np.uint8)
    write_image(path, strengths, metadata=subject.place(), overwrite=subject.overwrite)


def _write_cuts(subject: Subject, path: Path) -> None:
    """Write a sheet of cuts: their borders over the image, and the regions in their mean colors."""
    import numpy as np

    from cvtimg import write_image
    from cvtimg.labels import region_means
    from cvtimg.plotting.sheets import Panel, contact_sheet, draw_edges, shown_colors

    tree, image, drawn, flat = _tree_of(subject), subject.image, [], []
    for number in sorted({min(max(n, tree.n_parts), tree.n_leaves) for n in _SHOWN_CUTS}):
        labels = tree.cut(number)
        colors = shown_colors(np.nan_to_num(region_means(labels, image)), image, labels, ignore=0)
        drawn.append(Panel(draw_edges(image, labels, ignore=0), (f"{number} regions",)))
        flat.append(Panel(colors[labels]))
    write_image(path, contact_sheet([drawn, flat]), overwrite=subject.overwrite)


_WRITERS: dict[str, Callable[[Subject, Path], None]] = {
    "labels": _write_labels,
    "mean": _write_mean,
    "edges": _write_edges,
    "overlay": _write_overlay,
    "contours": _write_contours,
    "table": _write_table,
    "coco": _write_coco,
    "tree": _write_tree,
    "strengths": _write_strengths,
    "cuts": _write_cuts,
}
