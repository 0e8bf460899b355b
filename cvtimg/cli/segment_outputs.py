"""The files that ``cvtimg segment`` writes for images: how each is drawn, and the table of all inputs."""

import csv
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from cvtimg import find_contours, find_edges, write_image
from cvtimg._shared.extras import optional
from cvtimg._shared.types import Array
from cvtimg.batch.plans import Plan
from cvtimg.batch.report import Report
from cvtimg.batch.tasks import Row, Task, WrongUsageError
from cvtimg.files.remote import exists, local_copy
from cvtimg.labels import mean_picture, region_table, write_contours, write_labels, write_table
from cvtimg.labels.formats import Drawing
from cvtimg.options.record import Given
from cvtimg.options.segment_options import OF_LINES, kind_of
from cvtimg.pictures import ImageInfo, Pages, open_stack, read_scale, write_pages
from cvtimg.pictures.formats.encoding import as_stored
from cvtimg.pictures.formats.opening import selected, selecting
from cvtimg.pictures.formats.stored import place_of
from cvtimg.pictures.pages import PAGE_SUFFIXES
from cvtimg.pictures.showing import limits_to_show, shown
from cvtimg.plotting import contour_drawing
from cvtimg.plotting.sheets import draw_edges
from cvtimg.segmentation import RegionHierarchy, file_table
from cvtimg.segmentation.counting import at_edges
from cvtimg.segmentation.files import DividedStack

#: Kinds of output that are images, one of each page, and those that hold a single page.
_IMAGES, _OF_ONE = ("labels", "mean", "edges", "overlay", "strengths", "masks"), ("tree", "strengths")


@dataclass(frozen=True, eq=False)
class Subject:
    """A segmented image, or a page of a stack, and its source."""

    source: Path
    image: Array
    labels: Array
    header: ImageInfo
    given: Given  # how edges and contours are drawn
    measured: Array  # (H, W) or (H, W, C) channels that tables measure ...
    channels: Sequence[str]  # ... and their names
    hierarchy: RegionHierarchy | None = None
    place: Mapping[str, int] = field(default_factory=dict)  # of the page in its stack: ``{"t": 1, "z": 3}``
    in_volume: bool = False  # whether segments are those of a volume, of which the page is a plane

    @property
    def tree(self) -> RegionHierarchy:
        """The tree of regions; what needs one is refused without --hierarchy."""
        assert self.hierarchy is not None
        return self.hierarchy

    @property
    def ignore(self) -> int | None:
        """The label whose borders are not drawn: 0, unless that is the background of objects."""
        return None if self.given.objects else 0

    @cached_property
    def drawing(self) -> Drawing:
        """The borders of the segments, in the coordinates of the file."""
        image, off = self.image if self.given.subpixel else None, self.given.simplify
        contours = find_contours(self.labels, image, tolerance=off)
        drawing = contour_drawing(contours, self.labels, self.image)
        if self.given.chosen(*OF_LINES):
            least = {} if self.given.chance is None else {"chance": self.given.chance}
            chosen = self.tree.find_lines(**least, n_lines=self.given.strongest, image=image, tolerance=off)
            drawing = replace(drawing, lines=chosen.lines, chances=chosen.chances)
        drawing = replace(drawing, place=self.place, channels=self.header.channels)
        if place := self.header.geo_transform:
            return replace(drawing, transform=[place[:3], place[3:]], epsg=self.header.epsg)
        if size := self.header.pixel_size:
            return replace(drawing, transform=[[size.x, 0, 0], [0, size.y, 0]], unit=size.unit)
        return drawing

    @property
    def table(self) -> dict[str, Array]:
        """The segments in rows, with their place in the stack."""
        how = {"channels": self.channels, "objects": self.given.objects, "info": self.header}
        table = file_table(self.source, self.labels, self.measured, self.given.properties or (), **how)
        n_rows = len(table["label"])
        return {name: np.full(n_rows, at) for name, at in self.place.items()} | table


def check_room(outputs: Mapping[str, Path], n_pages: int) -> None:
    """Refuse outputs that hold one page alone, before several are segmented."""
    if n_pages == 1:
        return
    for option, path in outputs.items():
        kind = kind_of(option)
        if kind in _OF_ONE or path.suffix.lower() == ".svg":
            raise ValueError(f"has {n_pages} pages, and {option} holds one; --page, --t or --z selects one")
        if (kind in _IMAGES) and path.suffix.lower() not in PAGE_SUFFIXES:
            way = f"--write {kind}.tif" if option.startswith("--write") else f"{option} FILE.tif"
            raise ValueError(f"has several pages: name an output that can hold them, {way}, and not {path.name}")


def write_outputs(task: Task, divided: DividedStack, given: Given, *, in_volume: bool) -> dict[str, Array] | None:
    """Write what was asked for; of several pages, all into one file. Return the table for that of all inputs."""
    places = [{}] if divided.pages is None else divided.pages.places
    tree = divided.results[0].hierarchy if divided.pages is None else None
    header = divided.header
    measured, names = _channels(task.source, given) if given.measure else (divided.images, header.channels)
    subjects = []
    for image, labels, bands, at in zip(divided.images, divided.labels, measured, places, strict=True):
        subjects.append(Subject(task.source, image, labels, header, given, bands, names, tree, at, in_volume))
    for option, path in task.outputs.items():
        kind = kind_of(option)
        if kind == "tree":
            subjects[0].tree.save(path, overwrite=given.overwrite)
        elif kind == "contours":
            write_contours(path, [subject.drawing for subject in subjects], overwrite=given.overwrite)
        elif kind == "table":
            write_table(path, _table_of(subjects), image=_text(task.source.name), overwrite=given.overwrite)
        elif divided.pages is not None:
            _write_pages(kind, subjects, path, divided.pages, given.overwrite)
        elif kind == "labels":
            scale = read_scale(task.source, nodata=0)
            write_labels(path, subjects[0].labels, metadata=scale, overwrite=given.overwrite)
        else:
            stored, _ = as_stored(_drawn(kind, subjects[0], path), path.suffix)
            write_image(path, stored, alpha=False, metadata=read_scale(task.source), overwrite=given.overwrite)
    return _table_of(subjects) if given.table else None


def _channels(source: Path, given: Given) -> tuple[Sequence[Array], Sequence[str]]:
    """Read the channels that --measure names, of all pages, whichever channel is segmented."""
    with selecting(replace(selected(), channel=None, composite=None)):
        stack = open_stack(source, frames=False)
    images = [image.reshape(*image.shape[:2], -1) for image in stack.images]
    assert stack.header is not None  # in tiles, there is none
    n_bands, named = images[0].shape[2], tuple(stack.header.channels)
    names = named if len(named) == n_bands else tuple(str(band) for band in range(1, n_bands + 1))
    chosen = [*range(n_bands)]
    if given.measure != ("all",):
        chosen = [place_of(it, n_bands, names, "channel") for it in given.measure]
    return [image[..., chosen] for image in images], [names[band] for band in chosen]


def _write_pages(kind: str, subjects: Sequence[Subject], path: Path, pages: Pages, overwrite: bool) -> None:
    if kind == "labels":
        dtype = np.min_scalar_type(max(int(subject.labels.max()) for subject in subjects))
        images = [subject.labels.astype(dtype) for subject in subjects]
    else:
        if kind == "overlay" and subjects[0].image.dtype != np.uint8:  # pages stay as bright beside each other
            bands = [each.image.reshape(*each.labels.shape, -1) for each in subjects]
            counted = [values[each.labels != each.ignore] for values, each in zip(bands, subjects, strict=True)]
            limits = limits_to_show(counted)
            subjects = [replace(each, image=shown(band, limits)) for each, band in zip(subjects, bands, strict=True)]
        images = [_drawn(kind, subject, path) for subject in subjects]
    is_joined = pages.is_joined and kind == "mean"
    write_pages(path, replace(pages, images=tuple(images), has_alpha=False, is_joined=is_joined), overwrite=overwrite)


def _drawn(kind: str, subject: Subject, path: Path) -> Array:
    given, image, labels = subject.given, subject.image, subject.labels
    if kind == "mean":
        return mean_picture(labels, image)
    if kind == "edges":
        return find_edges(labels, mode=given.edge_mode, ignore=subject.ignore)
    if kind == "masks":  # 16 bits, without colors that would show them
        if (most := int(labels.max())) > 65535:
            raise ValueError(f"has {most} segments, and --masks holds 65535; -o FILE.tif holds more")
        return labels.astype(np.uint16)
    if kind == "strengths":  # how likely a person draws each edge
        chances = subject.tree.find_edges(strength=True)
        return np.rint(255 * chances).astype(np.uint8) if path.suffix.lower() == ".png" else chances
    # The fourth of four bands is not alpha: that has been removed.
    image = image[..., :3] if image.shape[2:] == (4,) else image
    color = tuple(bytes.fromhex(given.line_color)[:3])
    return draw_edges(image, labels, color=color, thickness=given.line_width, ignore=subject.ignore)


def _table_of(subjects: Sequence[Subject]) -> dict[str, Array]:
    in_volume = subjects[0].in_volume
    tables = _tables_of_volumes(subjects) if in_volume else [subject.table for subject in subjects]
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}


def _tables_of_volumes(subjects: Sequence[Subject]) -> list[dict[str, Array]]:
    """Measure the objects of each frame, in rows with its number."""
    frames: dict[int | None, list[Subject]] = {}
    for subject in subjects:
        frames.setdefault(subject.place.get("t"), []).append(subject)
    tables = []
    for frame, planes in frames.items():
        volume, image = (np.stack([getattr(plane, name) for plane in planes]) for name in ("labels", "measured"))
        more, size = planes[0].given.properties or (), planes[0].header.pixel_size
        table = region_table(volume, image, more, pixel_size=size, channels=planes[0].channels)
        table["touches_edge"] = at_edges(volume)[table["label"]].astype(int)
        tables.append(({} if frame is None else {"t": np.full(len(table["label"]), frame)}) | table)
    return tables


Table = Mapping[str, Array]


class JointTable(Report):
    """Collects the table of each input, which comes with its row, and writes all as one when the run ends."""

    def __init__(self, path: Path, plan: Plan, columns: Sequence[str], given: Given) -> None:
        super().__init__(columns, as_json=given.as_json, quiet=given.quiet)
        self._path, self._replaces = path, given.overwrite or given.skip_existing
        self._tables: dict[str, Table] = {}
        times = Counter(task.source.name for task in plan.tasks)
        #: The name of each input in the table: that of its file, or its path where files have the same name.
        named = [(task.name, task.source.name) for task in plan.tasks]
        self._names = {name: file if times[file] == 1 else name for name, file in named}
        if given.skip_existing and not given.overwrite and exists(path):
            try:
                self._tables |= _by_image(_read(path))
            except (KeyError, ValueError) as error:
                raise WrongUsageError(f"--table: {path} has no rows of images to go on with; --overwrite") from error
            plan.known = [name for name, image in self._names.items() if image in self._tables]

    def done(self, row: Row) -> None:
        """Keep a table beside recording the input."""
        name = str(row["input"])
        self._tables[_text(self._names.get(name, name))] = row["_table"]
        super().done(row)

    def finish(self) -> None:
        """Write the table."""
        places = {_text(name): place for place, name in enumerate(self._names.values())}
        order = sorted(self._tables, key=lambda name: places.get(name, -1))  # what only an earlier run had comes first
        tables = [{"image": np.full(_n_rows(self._tables[name]), name), **self._tables[name]} for name in order]
        if tables:
            columns = dict.fromkeys(column for table in tables for column in table)
            whole: dict[str, Array] = {}
            for column in columns:
                parts = [table.get(column, np.full(_n_rows(table), np.nan)) for table in tables]
                whole[column] = np.concatenate(parts)
            write_table(self._path, whole, overwrite=self._replaces)


def _text(name: str) -> str:
    """Return a name of a file, which need not be valid text, as text."""
    return os.fsencode(name).decode(errors="replace")


def _n_rows(table: Table) -> int:
    return len(next(iter(table.values())))


def _read(path: Path) -> Table:
    """Read a table that was written here."""
    with local_copy(path) as copy:
        if path.suffix.lower() == ".parquet":
            parquet = optional("pyarrow.parquet", "parquet", "tables in .parquet need")
            return {name: np.array(column) for name, column in parquet.read_table(copy).to_pydict().items()}
        with copy.open(newline="", encoding="utf-8") as file:
            names, *rows = csv.reader(file)
    columns = dict(zip(names, zip(*rows, strict=True), strict=False))
    return {name: np.array(column, None if name == "image" else float) for name, column in columns.items()}


def _by_image(table: Table) -> dict[str, Table]:
    """Divide a table by its column of images, which the parts do not have."""
    others = {name: column for name, column in table.items() if name != "image"}
    images = dict.fromkeys(table["image"].tolist()) if table else {}
    return {image: {name: column[table["image"] == image] for name, column in others.items()} for image in images}
