"""Reduced bases: few modes in which many snapshots, and others like them, are nearly contained."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import MAX_COLORS, ROUNDING
from cvtimg._shared.checks import check_choice, check_count, check_in_range, check_shape, check_that, check_weights
from cvtimg._shared.choices import Row
from cvtimg._shared.iteration import Stopping, iterate
from cvtimg._shared.records import Claims, ReadOnly, never_rises
from cvtimg._shared.types import Array, Floats, Ints64
from cvtimg.bases.snapshots import EXACT_RANK, Sketch, as_snapshots, sketch
from cvtimg.elbow.rules import CHORD_ENDS, chord_linear
from cvtimg.engine.seeding import TooFewSamplesError
from cvtimg.engine.tessellation import tessellate
from cvtimg.files.arrays import load_arrays, save_arrays
from cvtimg.files.whole import StrPath

#: Centers, axes, labels and medoids in the coordinates of a sketch, as `Basis` has them.
_Subspaces: TypeAlias = tuple[Floats, Floats, Ints64, Ints64]
_KIND = "reduced basis"

#: Coordinates beyond those that are used: with more, these are more precise, and passes take longer.
_OVERSAMPLING = 24
#: Coordinates for each mode of all cells of a CVOD: with more, modes are more precise, and passes take longer.
_COORDINATES_PER_MODE = 2
#: Share of the largest to which coordinates are rounded, some thousand roundings: with more, near ones become one.
_ROUNDED = 2.0**-40
#: Starts of a CVOD, and when each rests: with more, it takes longer and ends lower.
_STARTS = 4
_RESTING = Stopping(tolerance=1e-6, max_iterations=100)


def _settled(rows: Floats) -> Floats:
    """Round coordinates, so that equal snapshots have equal ones: these are sums, and differ in their last bits."""
    step = np.abs(rows).max() * _ROUNDED or 1.0
    return np.rint(rows / step) * step


def distances(rows: Floats, centers: Floats, axes: Floats) -> Floats:
    """(N, C) squared distances of rows to affine subspaces."""
    columns = []
    for center, directions in zip(centers, axes, strict=True):
        apart = rows - center
        along = apart @ directions.T
        columns.append(np.einsum("nr,nr->n", apart, apart) - np.einsum("na,na->n", along, along))
    return np.maximum(np.stack(columns, axis=1), 0.0)


def principal_axes(rows: Floats, n_axes: int) -> tuple[Floats, Floats]:
    """Mean of (N, R) rows, and their (n_axes, R) axes of greatest variance, padded by zeros."""
    center = rows.mean(axis=0)
    right = np.linalg.svd(rows - center, full_matrices=False)[2][:n_axes]
    axes = np.zeros((n_axes, rows.shape[1]))
    n_found = min(len(right), len(rows) - 1)
    axes[:n_found] = right[:n_found]
    return center, axes


def _descended(rows: Floats, labels: Ints64, n_cells: int, n_axes: int) -> tuple[float, Ints64]:
    """Fit each cell's subspace and assign each row to the nearest, in turns; return the energy and the cells."""
    apart: Floats

    def step() -> float:
        nonlocal apart, labels
        fitted = [principal_axes(rows[labels == cell], n_axes) for cell in range(n_cells)]
        apart = distances(rows, *(np.stack(parts) for parts in zip(*fitted, strict=True)))
        labels = _without_empty_cells(apart, apart.argmin(axis=1))
        return float(apart.min(axis=1).sum())

    history = iterate(step(), step, _RESTING)
    return history.energies[-1], apart.argmin(axis=1)


def _without_empty_cells(apart: Floats, labels: Ints64) -> Ints64:
    """Give each empty cell the row that is farthest from its own subspace, of a cell that keeps others."""
    sizes = np.bincount(labels, minlength=apart.shape[1])
    order = np.argsort(-apart.min(axis=1), kind="stable")
    for cell in np.flatnonzero(sizes == 0):
        farthest = next(row for row in order if sizes[labels[row]] > 1)
        sizes[labels[farthest]] -= 1
        labels[farthest], sizes[cell] = cell, 1
    return labels


@dataclass(frozen=True, slots=True, eq=False)
class Projection:
    """Snapshots in a basis.

    Attributes
    ----------
    coordinates : (m, n) float64 array
        Along the modes of the cell.
    cells : (m,) int64 array
        Index of the nearest affine subspace; 0 for a basis of one cell.
    residuals : (m,) float64 array
        Distance to the subspace over distance to the mean of the training snapshots, in 0..1 for what resembles them:
        near 1 the basis says nothing about this snapshot.
    """

    coordinates: Floats
    cells: Ints64
    residuals: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Basis(ReadOnly):
    """A reduced basis: C affine subspaces of n dimensions in the space of snapshots.

    Attributes
    ----------
    kind : {"pod", "cvt", "cvod"}
        How it was made. C is 1 for "pod" and "cvt".
    shape : tuple of int
        Shape of a snapshot; it has D values.
    mean : (D,) float64 array
        Mean of the training snapshots.
    centers : (C, D) float64 array
        Where each subspace begins: the mean of its cell.
    modes : (C, n, D) array
        Orthonormal modes of each cell, the most important first; zeros where a cell has fewer.
    labels : (N,) int64 array
        Cell of each training snapshot; for "cvt" that of the tessellation, 0..n - 1.
    medoids : (k,) int64 array
        Of the cells of "cvt" and "cvod", the training snapshot nearest to the mean of each; empty for "pod".
    energies : (n + 1,) float64 array
        Sum of squared distances of the training snapshots to the subspaces of the first 0, 1, .. n modes.
    variance : float
        The same to their mean.
    """

    kind: str
    shape: tuple[int, ...]
    mean: Floats
    centers: Floats
    modes: Array
    labels: Ints64
    medoids: Ints64
    energies: Floats
    variance: float

    def _claims(self) -> Claims:
        yield "energies never rise", never_rises(self.energies)

    def summary(self) -> Row:
        """Return what a table says of the result, by column."""
        return {
            "snapshots": len(self.labels),
            "shape": list(self.shape),
            "kind": self.kind,
            "n": self.n_modes,
            "cells": self.n_cells,
            "explained": self.explained,
            "energy": self.energy,
            "energies": self.energies.tolist(),
            "medoids": self.medoids.tolist(),
        }

    def __repr__(self) -> str:
        cells = f" in each of {self.n_cells} cells" if self.n_cells > 1 else ""
        modes = f"{self.n_modes} modes{cells} of shape {self.shape}"
        return f"Basis(kind={self.kind!r}, {modes}, {self.explained:.2%} explained)"

    @property
    def n_cells(self) -> int:
        """Number of affine subspaces, C."""
        return len(self.centers)

    @property
    def n_modes(self) -> int:
        """Number of modes per cell, n."""
        return int(self.modes.shape[1])

    @property
    def energy(self) -> float:
        """Sum of squared distances of the training snapshots to the subspaces."""
        return float(self.energies[-1])

    @property
    def explained(self) -> float:
        """Share of the variance of the training snapshots that the basis explains."""
        return 1 - self.energy / self.variance if self.variance else 1.0

    def project(self, snapshots: object) -> Projection:
        """Project snapshots of the same shape, of any kind that `as_snapshots` takes, onto the nearest subspace."""
        source = as_snapshots(snapshots)
        check_shape("snapshots", source.shape, source.shape == self.shape, f"{self.shape}, as the basis has")
        parts = zip(*(self._project_block(block) for _, block in source.blocks()), strict=True)
        return Projection(*map(np.concatenate, parts))

    def _project_block(self, block: Array) -> tuple[Floats, Ints64, Floats]:
        rows = block.astype(np.float64)
        apart = distances(rows, self.centers, self.modes)
        cells = apart.argmin(axis=1)
        coordinates = np.empty((len(rows), self.n_modes))
        for cell in np.unique(cells):
            coordinates[cells == cell] = (rows[cells == cell] - self.centers[cell]) @ self.modes[cell].T
        sizes = ((rows - self.mean) ** 2).sum(axis=1)
        residuals = np.divide(apart.min(axis=1), sizes, out=np.zeros(len(rows)), where=sizes > 0)
        return coordinates, cells, np.sqrt(residuals)

    def reconstruct(self, projection: Projection) -> Floats:
        """(m, ...) snapshots of which only the projections are known."""
        rows = np.empty((len(projection.cells), self.mean.size))
        for cell in np.unique(projection.cells):
            in_cell = projection.cells == cell
            rows[in_cell] = self.centers[cell] + projection.coordinates[in_cell] @ self.modes[cell]
        return rows.reshape(-1, *self.shape)

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the basis to a NumPy .npz file, whole or not at all; `read_basis` reads it."""
        check_choice("suffix", Path(path).suffix.lower(), (".npz",))
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        save_arrays(path, _KIND, arrays, overwrite=overwrite)


def read_basis(path: StrPath) -> Basis:
    """Read a basis that `Basis.save` wrote to a .npz file; an OSError if it holds none.

    Examples
    --------
    >>> import tempfile
    >>> basis = reduced_basis(np.eye(4), 2)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     basis.save(f"{folder}/basis.npz")
    ...     read_basis(f"{folder}/basis.npz")
    Basis(kind='pod', 2 modes of shape (4,), 66.67% explained)
    """
    values: dict[str, Any] = load_arrays(path, _KIND, [field.name for field in fields(Basis)])
    values |= {"kind": str(values["kind"]), "variance": float(values["variance"])}
    return Basis(**{**values, "shape": tuple(int(side) for side in values["shape"])})


def reduced_basis(
    snapshots: object,
    n_modes: int | float | Literal["auto"],
    *,
    kind: str = "pod",
    n_cells: int = 8,
    centered: bool = True,
    weights: ArrayLike | None = None,
    rng: int | np.random.Generator = 0,
) -> Basis:
    """Find few modes that nearly contain many snapshots.

    Parameters
    ----------
    snapshots : array-like, Frames, path, or sequence of paths
        (N, ...) frames, fields or images, as `as_snapshots` takes them. They may be larger than memory.
    n_modes : int, float or "auto"
        Modes n, at most N - 1 and D (for "cvt" at most N). A number in 0..1, both excluded, takes as few modes of "pod"
        as explain this share of the variance, at most 1024. "auto" takes the elbow of the energy, at most 32.
    kind : {"pod", "cvt", "cvod"}
        "pod", proper orthogonal decomposition: principal components, the modes that leave the least energy. "cvt":
        generators of a tessellation of the snapshots, orthonormalized, the heaviest cell first. "cvod": a tessellation
        whose generators are affine subspaces of n dimensions, each cell with modes of its own.
    n_cells : int
        Cells of "cvod", at most N; other kinds take no account of it.
    centered : bool
        Whether "pod" describes the differences from the mean; without, its modes pass through 0, and its mean is 0.
    weights : (N,) array, optional
        Weight of each snapshot in "pod", >= 0: energies and the mean are weighted.
    rng : int or numpy.random.Generator
        Seed of what is drawn.

    Returns
    -------
    Basis

    Notes
    -----
    At equal storage "pod" has the least error. "cvod" stores C times as many modes and has a much smaller error at
    equal online dimension n, for snapshots of several regimes. No basis describes snapshots that are unlike those it
    was made from: `Projection.residuals` tells. Arrays of up to 2^25 values and of 2^10 snapshots or values in each are
    read twice, and "pod" is exact; others are read four times.

    References
    ----------
    M. Gunzburger, J. Peterson, J. Shadid, Comput. Methods Appl. Mech. Engrg. 196 (2007) 1030-1047,
    doi 10.1016/j.cma.2006.08.004 (POD and CVT bases). Q. Du, M. Gunzburger, doi 10.1007/978-3-0348-8001-5_9 (CVOD).

    Examples
    --------
    >>> from cvtimg import reduced_basis
    >>> times = np.linspace(0, 1, 40)[:, None]
    >>> waves = np.sin(6 * np.linspace(0, 1, 200)) * times + np.cos(9 * np.linspace(0, 1, 200)) * times**2
    >>> basis = reduced_basis(waves, 2)
    >>> basis
    Basis(kind='pod', 2 modes of shape (200,), 100.00% explained)
    >>> bool(np.allclose(basis.reconstruct(basis.project(waves)), waves))
    True
    """
    make = KINDS[check_choice("kind", kind, KINDS)]
    source = as_snapshots(snapshots)
    most = source.n_snapshots if kind == "cvt" else max(1, min(source.n_snapshots - 1, source.n_dims))
    asked = min(CHORD_ENDS, most)
    share = float(n_modes) if isinstance(n_modes, float) and 0 < n_modes < 1 else None
    if share:
        check_in_range("n_modes", n_modes, kind == "pod", "a whole number or 'auto', unless kind is 'pod'")
        asked = min(EXACT_RANK, most)
    elif n_modes != "auto":
        limit = f"for {source.n_snapshots} snapshots of {source.n_dims} values"
        asked = check_count("n_modes", cast("int", n_modes), most, limit)
    n_cells = check_count("n_cells", n_cells, MAX_COLORS, "the most cells")
    cells = min(n_cells, source.n_snapshots) if kind == "cvod" else 1
    rank = _COORDINATES_PER_MODE * asked * cells + _OVERSAMPLING
    generator = np.random.default_rng(rng)
    for name, is_given in (("centered=False", not centered), ("weights", weights is not None)):
        check_that(name, not is_given or kind == "pod", "be given with kind='pod'")
    heavy = None if weights is None else check_weights("weights", weights, (source.n_snapshots,), "snapshot")
    sketched = sketch(source, rank, generator, centered=centered, weights=heavy)
    rows, directions = sketched.coordinates, sketched.directions
    if share:
        asked = _fewest(sketched, share, asked)
    if n_modes == "auto":
        try:
            trial = make(rows, asked, cells, generator)
        except TooFewSamplesError as error:
            trial = make(rows, min(asked, error.n_distinct), min(cells, error.n_distinct), generator)
        energies = _energies(rows, *trial[:3])
        asked = chord_linear(energies[1:] + sketched.missed) if energies[0] > 0 else 1
    try:
        centers, axes, labels, medoids = make(rows, asked, cells, generator)
    except TooFewSamplesError as error:
        wrong = f"n_modes={n_modes}" if kind == "cvt" else f"n_cells={n_cells}"
        raise ValueError(f"{wrong} must be in 1..{error.n_distinct}, the number of snapshots that differ") from error
    energies = _energies(rows, centers, axes, labels) + sketched.missed
    centers, modes = sketched.mean + centers @ directions, (axes @ directions).astype(source.dtype)
    parts = centers, modes, labels, medoids, energies
    return Basis(kind, source.shape, sketched.mean, *parts, sketched.variance)


def _fewest(snapshots: Sketch, share: float, most: int) -> int:
    """Return the fewest modes of POD, 1 at least, that explain a share of the variance."""
    explained = np.cumsum((snapshots.coordinates**2).sum(axis=0))[:most]
    n_modes = int(np.searchsorted(explained, share * snapshots.variance * (1 - ROUNDING))) + 1
    reached = explained[-1] / snapshots.variance if snapshots.variance else 1.0
    if n_modes > len(explained) and snapshots.variance:
        raise ValueError(f"n_modes={share:g} must be at most {reached:.4g}, the share that {most} modes explain")
    return min(n_modes, len(explained))


def _pod(rows: Floats, n_modes: int, n_cells: int, rng: np.random.Generator) -> _Subspaces:
    centers, axes = np.zeros((1, rows.shape[1])), np.eye(n_modes, rows.shape[1])[None]
    return centers, axes, np.zeros(len(rows), np.int64), np.zeros(0, np.int64)


def _cvt(rows: Floats, n_modes: int, n_cells: int, rng: np.random.Generator) -> _Subspaces:
    cells = tessellate(_settled(rows), n_modes, init="k-means++", effort="best", rng=rng)
    heaviest = np.argsort(-cells.masses, kind="stable")
    axes = np.zeros((1, n_modes, rows.shape[1]))
    orthonormal = np.linalg.qr(cells.generators[heaviest].T)[0].T
    axes[0, : len(orthonormal)] = orthonormal
    labels = np.argsort(heaviest, kind="stable")[cells.labels]
    return np.zeros((1, rows.shape[1])), axes, labels, _nearest_members(rows, labels, cells.generators[heaviest])


def _cvod(rows: Floats, n_modes: int, n_cells: int, rng: np.random.Generator) -> _Subspaces:
    """Tessellate (N, R) rows by affine subspaces of their own, the best of a few starts.

    Q. Du, M. Gunzburger, Centroidal Voronoi tessellation based proper orthogonal decomposition analysis, in: Control
    and Estimation of Distributed Parameter Systems, Birkhauser (2003) 137-150, doi 10.1007/978-3-0348-8001-5_9.
    """
    ends = []
    for _ in range(_STARTS):
        start = tessellate(_settled(rows), n_cells, init="k-means++", effort="fast", rng=rng).labels
        ends.append(_descended(rows, start.astype(np.int64), n_cells, n_modes))
    cells = min(ends, key=lambda end: end[0])[1]
    # Axes are those of the final cells, so that their order is that of the variance in them.
    fitted = [principal_axes(rows[cells == cell], n_modes) for cell in np.unique(cells)]
    centers, axes = (np.stack(parts) for parts in zip(*fitted, strict=True))
    labels = distances(rows, centers, axes).argmin(axis=1)
    return centers, axes, labels, _nearest_members(rows, labels, centers)


#: Kinds of bases, by the names of `kind`.
KINDS = {"pod": _pod, "cvt": _cvt, "cvod": _cvod}


def _energies(rows: Floats, centers: Floats, axes: Floats, labels: Ints64) -> Floats:
    """Return the energies of the first 0, 1, .. n axes."""
    apart = rows - centers[labels if len(centers) > 1 else 0]
    along = np.einsum("nr,nar->na", apart, axes[labels]) if len(axes) > 1 else apart @ axes[0].T
    taken = np.concatenate([[0.0], np.cumsum((along**2).sum(axis=0))])
    return np.maximum((apart**2).sum() - taken, 0.0)


def _nearest_members(rows: Floats, labels: Ints64, centers: Floats) -> Ints64:
    """(k,) for each cell that has rows, the index of the row nearest to its center."""
    apart = ((rows - centers[labels]) ** 2).sum(axis=1)
    order = np.lexsort((apart, labels))
    return order[np.unique(labels[order], return_index=True)[1]]
