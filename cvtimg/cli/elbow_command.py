"""``cvtimg elbow``: energy curves of images and tables, and the number of generators that they suggest."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from cvtimg.cli.cluster_command import reading, told_left_out
from cvtimg.cli.running import Given, Report, Row, Stopwatch, Task, Todo, WrongUsageError, plan_of, planned, plot
from cvtimg.files.finding import find_images

if TYPE_CHECKING:
    from cvtimg._shared.types import Array
    from cvtimg.elbow.curves import EnergyCurve
    from cvtimg.plotting.energy_curves import Plotted

EXAMPLES = """\
  cvtimg elbow photo.jpg
  cvtimg elbow photos/ --k-max 32 --csv curves.csv --plot curves.png
  cvtimg elbow photo.jpg --rule psnr --target 30
"""
COLUMNS = ("input", "k", "energy", "explained", "seconds", "elbow", "verdict")


def elbow(given: Given) -> Todo:
    """Suggest how many colors or clusters images and tables need, by the elbow of the energy.

    The energy falls with each generator: fast up to the number of colors that an image really has, slowly beyond it.
    Each input has a line with the number that the rule picks, and those of the other rules. One input is followed by
    its whole curve. Tables are read as by cvtimg cluster -k auto.
    """
    given.read = reading(given)
    if given.rule == "psnr" and given.space != "rgb":
        raise WrongUsageError(f"--rule psnr needs --space rgb: distances in {given.space} have no peak")
    plan = plan_of(given, expand=_inputs_of, joined=("--csv", "--plot"))
    return planned(plan, _measure, _Curves(given), given)


def _inputs_of(path: str) -> list[Path]:
    """Find images, or the tables of a folder that has none."""
    try:
        return find_images(path)
    except FileNotFoundError:
        from cvtimg.tables.files import find_tables, is_table

        with suppress(FileNotFoundError):
            if tables := list(filter(is_table, find_tables(path))):
                return tables
        raise


class _Curves(Report):
    """Keeps the curve of each input, and writes and draws all of them at the end."""

    def __init__(self, given: Given) -> None:
        super().__init__(COLUMNS, as_json=given.as_json, quiet=given.quiet)
        self._given, self._plotted = given, list["Plotted"]()

    def done(self, row: Row) -> None:
        self._plotted.append(row["_plotted"])
        super().done(row)

    def finish(self) -> None:
        given, plotted = self._given, self._plotted
        if plotted and given.csv:
            from cvtimg.files.whole import write_csv

            lines = [
                (each.name, k, float(energy), float(share), int(k == each.k))
                for each in plotted
                for k, (energy, share) in enumerate(zip(each.curve.energies, each.curve.explained, strict=True), 1)
            ]
            write_csv(given.csv, ("input", "k", "energy", "explained", "chosen"), lines, overwrite=given.overwrite)
        if plotted:
            plot(given.plot, given, "draw_curves", plotted, rule=given.rule)

    def close(self) -> int:
        status = super().close()
        if len(self._plotted) == 1 and not (self.as_json or self.quiet):
            curve = self._plotted[0].curve
            self.say(*_curve_lines(curve, {**curve.elbows(), self._given.rule: self._plotted[0].k}))
        return status


def _measure(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from cvtimg import energy_curve
    from cvtimg.plotting.energy_curves import Plotted

    samples, image, weights, left_out = _read(task.source, given)
    stopwatch.lap("read")
    result = energy_curve(samples, density=weights, **given.arguments)
    row = result.summary(given.rule, given.target)
    stopwatch.lap("cluster")
    plotted = Plotted(task.source.stem, result, row["k"], image if given.plot else None, given.space)
    return {**row, **told_left_out(left_out), "_plotted": plotted}


def _read(source: Path, given: Given) -> tuple[Array, Array | None, Array | None, Mapping[str, str]]:
    """Read the samples, the image if the file is one, the weights of rows, and why columns were left out."""
    from cvtimg.blocks import Spread
    from cvtimg.pictures.stacks import read_whole
    from cvtimg.tables.files import is_table, open_table, sample_rows

    if not is_table(source):
        if wrong := given.chosen("columns", "weight", "standardize"):
            raise ValueError(f"{' and '.join(wrong)} must not be given for images, only for tables")
        image = read_whole(source)
        return image, image, None, {}
    if given.space != "rgb":
        raise ValueError(f"--space {given.space} is for images; a table has no color space")
    table = open_table(source, given.dialect, **given.read)
    rows, weights = sample_rows(table, given.seed)
    rows = Spread.of(rows, weights).scaling.apply(rows) if given.standardize else rows
    return rows, None, weights, table.left_out


def _curve_lines(curve: EnergyCurve, picks: Mapping[str, int]) -> Iterator[str]:
    psnr = curve.psnr
    yield (f"\n{'k':>5}  {'energy':>11}  {'explained':>9}  {'psnr':>6}  picked by")
    for k, (energy, share) in enumerate(zip(curve.energies, curve.explained, strict=True), 1):
        decibels = "" if psnr is None else f"{psnr[k - 1]:.2f}" if math.isfinite(psnr[k - 1]) else "exact"
        by = ", ".join(name for name, pick in picks.items() if pick == k)
        yield f"{k:>5}  {energy:>11.5g}  {share:>9.2%}  {decibels:>6}  {by}".rstrip()
