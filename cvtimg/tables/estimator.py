"""The engine as a scikit-learn estimator; the only module that imports scikit-learn."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_count, check_needs, check_shape, check_that, refuse_masked, warn_if_rounded
from cvtimg._shared.choices import EffortName, InitName, MethodName
from cvtimg._shared.extras import needs
from cvtimg._shared.messages import warn
from cvtimg._shared.types import Array, Floats, Indices, Ints
from cvtimg.blocks.passes import Block, map_rows, over_blocks
from cvtimg.blocks.rows import Blocks, as_blocks, is_blocked
from cvtimg.engine.methods.probabilistic import meet
from cvtimg.engine.points import RowMoments, assign_rows, pack
from cvtimg.engine.seeding import TooFewSamplesError
from cvtimg.engine.tessellation import Tessellation, tessellate
from cvtimg.files.whole import StrPath

try:
    from scipy.spatial.distance import cdist
    from sklearn.base import BaseEstimator, ClassNamePrefixFeaturesOutMixin, ClusterMixin, TransformerMixin
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.utils import check_array, check_random_state
    from sklearn.utils.validation import check_is_fitted, validate_data
except ImportError as error:
    raise ImportError(f"cvtimg.CVT needs {needs('scikit-learn 1.6 or newer', 'sklearn')}") from error


class CVT(ClusterMixin, TransformerMixin, ClassNamePrefixFeaturesOutMixin, BaseEstimator):  # type: ignore[misc]
    """Centroidal Voronoi tessellation of the rows of a table.

    An estimator for scikit-learn's pipelines and searches; `cvtimg.tessellate` is the same as a function, with more
    options.

    Parameters
    ----------
    n_clusters : int
        Number of generators, at most the number of samples.
    method : str
        How generators move: a name in `cvtimg.engine.METHODS`.
    init : {"split", "k-means++", "random"} or (n_clusters, n_features) array
        Initial generators. From an array the iteration starts without a search.
    effort : {"fast", "balanced", "best"}
        How much work to spend on finding a low energy.
    checkpoint : path, optional
        For samples in blocks: a file that keeps the state of a long fit, as in `tessellate`.
    random_state : int, RandomState instance or None
        An int is the seed, like `rng` of `tessellate`. A RandomState draws a new seed for each fit; None uses NumPy's
        global one.

    Attributes
    ----------
    cluster_centers_ : (n_clusters, n_features) array
        Generators, sorted by their coordinates, or in the order of `init` if that is an array. There are fewer if there
        are fewer distinct samples of positive weight.
    labels_ : (n_samples,) int32 array
        Index of the nearest generator of each sample; a Dask array, not computed yet, for samples in blocks.
    masses_ : (n_clusters,) float64 array
        Sum of the weights of the samples of each cluster.
    inertia_ : float
        Energy: sum of weight times squared distance to the nearest generator. If the method "transfer" stops before it
        converges, this is lower than the last of `energies_`, in which a sample may belong to another cell.
    energies_ : (n_iter_ + 1,) array
        Energy before each step of the iteration and at the end; it never rises.
    n_iter_ : int
        Number of steps of the iteration.
    n_features_in_ : int
        Number of columns of the samples.
    feature_names_in_ : (n_features_in_,) array of str
        Names of the columns, if they have names.

    Warns
    -----
    ConvergenceWarning
        If there are fewer distinct samples than clusters. Each is then its own generator, and the energy is 0.

    Notes
    -----
    In scikit-learn's terms, generators are cluster centers, a tessellation is a clustering, a cell is a cluster, the
    density is the sample weight, and the energy is the inertia.

    Samples in blocks are Dask and zarr arrays, and files from `cvtimg.blocks.open_blocks`. They are never loaded as a
    whole: `fit` and `score` pass over the blocks, and `predict` and `transform` return Dask arrays in the same blocks.

    Samples are compared in float32, and in float64 where two generators are equally far but for rounding: labels and
    energies are those of the centers, whatever the range of the samples. Centers are float32 if the samples are.

    References
    ----------
    Q. Du, V. Faber, M. Gunzburger, SIAM Review 41 (1999) 637-676, doi 10.1137/S0036144599352836.

    Examples
    --------
    >>> from cvtimg import CVT
    >>> cvt = CVT(n_clusters=2).fit([[0, 0], [0, 2], [9, 0], [9, 2]])
    >>> cvt.cluster_centers_.tolist(), cvt.labels_.tolist(), cvt.inertia_
    ([[0.0, 1.0], [9.0, 1.0]], [0, 0, 1, 1], 4.0)
    >>> cvt.predict([[8, 8]]).tolist(), cvt.transform([[9, 5]])[0, 1].item()
    ([1], 4.0)
    """

    def __init__(
        self,
        n_clusters: int = 8,
        *,
        method: MethodName = "lloyd",
        init: InitName | ArrayLike = "split",
        effort: EffortName = "balanced",
        checkpoint: StrPath | None = None,
        random_state: object = 0,
    ) -> None:
        self.n_clusters = n_clusters
        self.method = method
        self.init = init
        self.effort = effort
        self.checkpoint = checkpoint
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None) -> CVT:  # noqa: N803
        """Compute the tessellation of finite samples, an array or in blocks, with (n_samples,) weights >= 0."""
        if is_blocked(X):
            blocks = as_blocks(X, sample_weight, weights_name="sample_weight")
            result = self._tessellate(blocks, None, self.n_clusters, checkpoint=self.checkpoint)
            self.n_features_in_ = blocks.n_dims
            order = self._keep(result, np.float32 if blocks.rows.dtype == np.float32 else np.float64)
            self.labels_ = self.predict(blocks)
            self.inertia_, self.masses_ = result.energy, result.masses[order]
            return self
        check_needs("checkpoint", self.checkpoint is not None, "samples in blocks", False)
        rows = self._rows(X, reset=True)
        weights = _weights(sample_weight, len(rows))
        check_count("n_clusters", self.n_clusters, len(rows), f"for n_samples={len(rows)}")
        try:
            result = self._tessellate(rows, weights, self.n_clusters)
        except TooFewSamplesError:  # the engine sees differences from the place nearest to 0
            places = pack(rows, weights, exact=True).rows(np.flatnonzero(weights > 0))
            n_distinct = len(np.unique(places, axis=0))
            fewer = f"there are {n_distinct} clusters"
            of = f"the {n_distinct} distinct samples of positive weight"
            warn(f"n_clusters={self.n_clusters} is more than {of}: {fewer}", ConvergenceWarning)
            result = self._tessellate(rows, weights, n_distinct)
        order = self._keep(result, rows.dtype)
        self.labels_, self.inertia_ = _measure(self.cluster_centers_, rows, weights)
        self.masses_ = np.bincount(self.labels_, weights, len(order)).astype(np.float64, copy=False)
        return self

    def _keep(self, result: Tessellation, dtype: Any) -> Indices:
        """Keep what is the same for all kinds of samples; return the order in which the generators are kept."""
        order = np.arange(len(result.generators))
        if isinstance(self.init, str):
            # By their coordinates: labels do not depend on how the engine finds generators.
            size = np.abs(result.generators).max() or 1.0
            order = np.lexsort((result.generators / size).astype(np.float32).T[::-1])
        self.cluster_centers_ = result.generators[order].astype(dtype)
        self.energies_, self.n_iter_ = np.array(result.energies), result.n_iter
        return order

    def partial_fit(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None) -> CVT:  # noqa: N803
        """Let the generators meet more samples, one by one, and move: MacQueen's online method.

        A generator is always the mean of the samples that it has met. The first samples, at least as many distinct ones
        as there are clusters, are fitted as a whole; generators from `fit` go on as they are. `labels_` and `inertia_`
        are those of these samples, by the generators after they have met them.

        References
        ----------
        J. MacQueen, Proc. 5th Berkeley Symposium on Mathematical Statistics and Probability 1 (1967) 281-297.

        Examples
        --------
        >>> from cvtimg import CVT
        >>> cvt = CVT(n_clusters=2).partial_fit([[0.0], [9.0]])
        >>> cvt.partial_fit([[2.0], [9.0], [4.0]]).cluster_centers_.tolist(), cvt.masses_.tolist()
        ([[2.0], [9.0]], [3.0, 2.0])
        """
        if not hasattr(self, "cluster_centers_"):
            return self.fit(X, y, sample_weight)
        rows = self._rows(X)
        weights = _weights(sample_weight, len(rows))
        centers = self.cluster_centers_
        points = pack(rows, weights, exact=True)
        moving, masses = points.frame.inward(centers), self.masses_.copy()
        meet(points, np.arange(len(rows)), weights, moving, masses)
        self.cluster_centers_ = points.frame.outward(moving).astype(centers.dtype)
        self.masses_ = masses
        self.labels_, self.inertia_ = _measure(self.cluster_centers_, rows, weights)
        return self

    def predict(self, X: Any) -> Any:  # noqa: N803
        """Label each sample with its nearest generator, (n_samples,) int32; a Dask array for samples in blocks."""
        check_is_fitted(self)
        if is_blocked(X):
            return map_rows(self._blocks(X), partial(_nearest, self.cluster_centers_), np.int32)
        return _nearest(self.cluster_centers_, self._rows(X))

    def transform(self, X: Any) -> Any:  # noqa: N803
        """Measure the (n_samples, n_clusters) distances to the generators; a Dask array for samples in blocks."""
        check_is_fitted(self)
        if is_blocked(X):
            distances = partial(_distances, self.cluster_centers_)
            return map_rows(self._blocks(X), distances, self.cluster_centers_.dtype, self._n_features_out)
        return _distances(self.cluster_centers_, self._rows(X))

    def score(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None) -> float:  # noqa: N803
        """Return the energy of samples, negative, so that more is better."""
        check_is_fitted(self)
        if is_blocked(X):
            blocks = self._blocks(X, sample_weight)
            return -float(over_blocks(blocks, _energy_of_block, math.fsum, self.cluster_centers_))
        rows = self._rows(X)
        return -_measure(self.cluster_centers_, rows, _weights(sample_weight, len(rows)))[1]

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags

    @property
    def _n_features_out(self) -> int:
        return len(self.cluster_centers_)

    def _rows(self, samples: ArrayLike, *, reset: bool = False) -> Array:
        refuse_masked("X", samples)
        warn_if_rounded("X", samples)
        return validate_data(self, samples, reset=reset, dtype=[np.float64, np.float32], order="C")

    def _blocks(self, samples: object, sample_weight: object = None) -> Blocks:
        """Return samples in blocks that have as many columns as those of `fit`."""
        blocks = as_blocks(samples, sample_weight, weights_name="sample_weight")
        fits = blocks.n_dims == self.n_features_in_
        check_shape("X", blocks.rows.shape, fits, f"(N, {self.n_features_in_}), as the samples of fit")
        return blocks

    def _tessellate(self, rows: Any, weights: Any, n_generators: int, **options: Any) -> Tessellation:
        seed = self.random_state
        if not isinstance(seed, (int, np.integer)):
            seed = check_random_state(seed).randint(np.iinfo(np.int32).max)
        how: dict[str, Any] = {"method": self.method, "init": self.init, "effort": self.effort, **options}
        return tessellate(rows, n_generators, density=weights, rng=int(seed), **how)


def _measure(centers: Array, rows: Array, weights: Floats) -> tuple[Ints, float]:
    """Return the index of the nearest generator of each sample, and the energy."""
    labels = _nearest(centers, rows)
    return labels, float(RowMoments.of(rows, weights, centers.astype(np.float64), labels).energies.sum())


def _nearest(centers: Array, rows: Array) -> Ints:
    # The middle depends only on the generators, so that a label does not depend on the other samples.
    middle: Floats = np.mean(centers, axis=0, dtype=np.float64)
    return assign_rows(rows, centers.astype(np.float64), pack(rows, np.ones(len(rows)), center=middle))


def _distances(centers: Array, rows: Array) -> Array:
    # Differences first: scikit-learn's own way through scalar products finds a generator 6e-8 away from itself.
    distances: Array = cdist(rows, centers)
    return distances.astype(rows.dtype if rows.dtype.kind == "f" else centers.dtype, copy=False)


def _energy_of_block(block: Block, centers: Array) -> float:
    return math.fsum(_measure(centers, rows, weights)[1] for rows, weights in block.pieces())


def _weights(sample_weight: ArrayLike | None, n_samples: int) -> Floats:
    if sample_weight is None:
        return np.ones(n_samples)
    weights: Floats = check_array(sample_weight, ensure_2d=False, dtype=np.float64, input_name="sample_weight")
    check_shape("sample_weight", weights.shape, weights.shape == (n_samples,), f"({n_samples},), one per sample")
    check_that("sample_weight", weights.min() >= 0 and weights.any(), "be >= 0, and not zero for all samples")
    return weights
