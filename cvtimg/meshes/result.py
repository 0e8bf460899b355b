"""A mesh as a value."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_that
from cvtimg._shared.choices import Row
from cvtimg._shared.notebooks import drawn
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.types import Floats, Ints
from cvtimg.files.whole import StrPath
from cvtimg.halfedges import measure_triangles
from cvtimg.meshes.files import TAKEN, MeshContent, suffixes, write_mesh
from cvtimg.meshes.measures import MeshMeasures, measure_mesh
from cvtimg.meshes.polygons import OutlineChanges
from cvtimg.meshes.projection import LocalProjection
from cvtimg.meshes.quadratic import QuadraticTriangles


@dataclass(frozen=True, slots=True, eq=False)
class Mesh(ReadOnly):
    """Triangles of the plane whose vertices are generators of a centroidal Voronoi tessellation.

    Attributes
    ----------
    points : (N, 2) float64 array
        Vertices (x, y), those on borders first.
    triangles : (T, 3) int32 array
        Indices of points, counter-clockwise where y points up.
    tags : (T,) int32 array
        Label of the segment that each triangle is in; 1 in a region.
    edges : (E, 2) int32 array
        Edges on the boundary and between segments, each once.
    energies : tuple of float
        At the start and after each move, in the metric of the sizes; they may rise a little, for sizes vary.
    converged : bool
        Whether vertices came to rest before the moves of the effort were spent.
    n_wanted : int or None
        The number of vertices that was asked for; `len(points)` is this number, unless it says otherwise.
    edge_tags : (E,) int32 array or None
        Of each of `edges`: 1 where it has no name, otherwise a number beyond all `tags`, for readers mix them up.
    names : dict
        Names of (1, tag) of edges and of (2, tag) of triangles, as `named` gives them.
    quadratic : QuadraticTriangles or None
        The triangles with six nodes, if ``order=2`` was asked for.
    pairs : (P, 2) int32 array or None
        Vertices on periodic sides: on the right or at greater y, and, moved by the period, on the left or at less y.
    changes : OutlineChanges or None
        What polygons lost before they were meshed.
    projection : LocalProjection or None
        That by which outlines in degrees were meshed in km.
    """

    points: Floats
    triangles: Ints
    tags: Ints
    edges: Ints
    energies: tuple[float, ...]
    converged: bool
    n_wanted: int | None
    edge_tags: Ints | None = None
    names: Mapping[tuple[int, int], str] = field(default_factory=dict)
    quadratic: QuadraticTriangles | None = None
    pairs: Ints | None = None
    changes: OutlineChanges | None = None
    projection: LocalProjection | None = None

    def _claims(self) -> Claims:
        first, second, third = self.points[self.triangles].transpose(1, 0, 2)
        (along, up), (across, over) = (second - first).T, (third - first).T
        yield "triangles are counter-clockwise", along * over > up * across
        yield "each vertex is one of a triangle", len(np.unique(self.triangles)) == len(self.points)

    @property
    def energy(self) -> float:
        """The energy at the end."""
        return self.energies[-1]

    @property
    def area(self) -> float:
        """Area of all triangles, with sides that bend if they have six nodes."""
        measures = measure_triangles(self.points, self.triangles) if self.quadratic is None else self.quadratic
        return float(measures.areas.sum())

    @property
    def qualities(self) -> Floats:
        """2 r / R of each triangle (T,), for the radii of its incircle and circumcircle; 1 if it is equilateral."""
        return measure_triangles(self.points, self.triangles).qualities

    @property
    def boundary(self) -> Ints:
        """Indices of the vertices on borders, in rising order."""
        return np.unique(self.edges)

    def measures(self) -> MeshMeasures:
        """Measure how good the mesh is; Voronoi cells are clipped exactly to it."""
        return measure_mesh(self.points, self.triangles)

    def named(
        self,
        *,
        regions: Mapping[int, str] | None = None,
        borders: Mapping[str, Callable[[Floats], ArrayLike]] | None = None,
    ) -> Mesh:
        """Name regions and parts of the borders, for files that solvers read: .msh, .vtu and .inp (see `save`).

        Parameters
        ----------
        regions : dict, optional
            From labels in `tags` to names.
        borders : dict, optional
            From names to functions that tell which of the middles (E, 2) of border edges belong to them; the first that
            takes an edge has it.

        Examples
        --------
        >>> from cvtimg import mesh_region
        >>> mesh = mesh_region([[0, 0], [2, 0], [2, 1], [0, 1]], n=60)
        >>> mesh = mesh.named(regions={1: "water"}, borders={"inlet": lambda p: p[:, 0] == 0})
        >>> mesh.names
        {(2, 1): 'water', (1, 2): 'inlet'}
        """
        names = {(2, tag): name for tag, name in (regions or {}).items()}
        words = [*names.values(), *(borders or {})]
        for word in words:
            is_free = re.fullmatch(r"[^\W\d][\w-]*", word) and word not in TAKEN and words.count(word) == 1
            check_that(f"the name {word!r}", bool(is_free), f"be a word, given once, and none of {', '.join(TAKEN)}")
        for _, tag in names:
            check_that(f"regions has {tag}, which", bool((self.tags == tag).any()), "be a label in tags")
        middles = self.points[self.edges].mean(axis=1)
        tags, unnamed = np.ones(len(self.edges), np.int32), np.ones(len(self.edges), bool)
        for tag, (name, tells) in enumerate((borders or {}).items(), int(self.tags.max()) + 1):
            chosen = np.asarray(tells(middles), bool) & unnamed
            check_that(f"borders has {name!r}, which", bool(chosen.any()), "be true for the middle of some edge")
            tags[chosen], unnamed[chosen], names[1, tag] = tag, False, name
        return replace(self, edge_tags=tags, names=names)

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the mesh to a file; the suffix picks the format.

        Parameters
        ----------
        path : str or path-like
            .vtu (tags and qualities of triangles), .msh (Gmsh's 2.2; tags as physical groups, borders as lines), .obj
            (a group for each tag), or by meshio .inp, .ply, .stl and others. .vtu, .msh and .inp have the names of
            `named`. With six nodes, .vtu, .msh or what meshio writes them to.
        overwrite : bool
            Replace an existing file.
        """
        six = self.quadratic
        points, of = (self.points, self) if six is None else (six.nodes, six)
        content = MeshContent(points, of.triangles, self.tags, of.edges, self.qualities, self.edge_tags, self.names)
        write_mesh(path, content, overwrite, suffixes(content.kind))

    def _repr_png_(self) -> bytes | None:
        return drawn(repr(self), self.points, self.triangles, y_down=True)

    def summary(self) -> Row:
        """Return what a table says of the result, by column."""
        local = self.projection  # in which lengths are kilometers
        each = measure_triangles(self.points if local is None else local.to_km(self.points), self.triangles)
        return {
            "n": len(self.points),
            "n_wanted": self.n_wanted,
            "triangles": len(self.triangles),
            "area": self.area if self.projection is None else float(each.areas.sum()),
            "least_angle": float(each.least_angles.min()),
            "mean_quality": float(each.qualities.mean()),
            "below_30": float((each.least_angles < 30).mean()),
            "energy": self.energy,
            "n_iter": len(self.energies) - 1,
            **({} if self.changes is None else asdict(self.changes)),
            **({} if self.pairs is None else {"pairs": len(self.pairs)}),
            **({} if self.quadratic is None else {"n_straight": self.quadratic.n_straight}),
            **({"names": {name: tag for (_, tag), name in self.names.items()}} if self.names else {}),
        }

    def __repr__(self) -> str:
        asked = "" if self.n_wanted in (None, len(self.points)) else f" ({self.n_wanted} wanted)"
        return f"Mesh({len(self.points)} vertices{asked}, {len(self.triangles)} triangles)"
