"""What every surface can tell."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from cvtimg.surfaces.halves import HalfEdges

Points = NDArray[np.float64]
Triangles = NDArray[np.int32]


class Surface(ABC):
    """A surface in space, with triangles that are on it or near to it."""

    __slots__ = ()

    @property
    @abstractmethod
    def triangulation(self) -> HalfEdges:
        """Triangles that have the shape of the surface, as coarse as that allows."""

    @abstractmethod
    def on_surface(self, places: Points) -> Points:
        """Move (N, 3) places in triangles of `triangulation`, or in parts of these, to the surface."""

    @abstractmethod
    def nearest(self, places: Points, faces: Triangles, fine: HalfEdges) -> tuple[Points, Points, Triangles]:
        """Move (N, 3) places near triangles of `fine`, whose vertices are on the surface, to the surface.

        Returns the points, their outward unit normals, and the triangles of `fine` near to them.
        """
