"""How good a mesh is: the measures of its Voronoi cells and of its triangles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_have_area, check_places, check_triangles
from cvtimg._shared.extras import shapely
from cvtimg.halfedges import TriangleMeasures, measure_triangles
from cvtimg.placement import PolygonRegion
from cvtimg.placement.cells import measure_cells

__all__ = ["MeshMeasures", "TriangleMeasures", "measure_mesh", "measure_triangles"]


@dataclass(frozen=True, slots=True)
class MeshMeasures:
    """Measures of a triangulation; the smaller the first eight are, the more regular it is.

    Write h_i for the greatest distance from vertex i to a point of its Voronoi cell, clipped to the mesh, gamma_i for
    that to the nearest other vertex, and R and r for the radii of the circumcircle and the incircle of a triangle.

    Attributes
    ----------
    h, chi : float
        The largest h_i, and the largest 3^(1/2) h_i / gamma_i; 1 for regular hexagons.
    tau, d : float
        The largest deviation of the trace of the second moments of a cell, by its area, from the mean of all, and the
        largest determinant of their deviatoric part.
    alpha : float
        The largest area of a triangle by the mean one.
    beta : float
        60 degrees by the least angle.
    q, p : float
        The largest R / (2 r), 1 for equilateral triangles; and the standard deviation of R by its mean.
    least_angle : float
        In degrees.
    mean_quality : float
        Mean of 2 r / R; 1 for equilateral triangles.
    below_30 : float
        Share of the triangles that have an angle below 30 degrees.

    References
    ----------
    L. Nguyen, J. Burkardt, M. Gunzburger, L. Ju, Y. Saka, Constrained CVT meshes and a comparison of triangular mesh
    generators, Computational Geometry 42 (2009) 1-19, doi 10.1016/j.comgeo.2008.04.002.
    """

    h: float
    chi: float
    tau: float
    d: float
    alpha: float
    beta: float
    q: float
    p: float
    least_angle: float
    mean_quality: float
    below_30: float


def measure_mesh(points: ArrayLike, triangles: ArrayLike) -> MeshMeasures:
    """Measure any triangulation, with Voronoi cells that are clipped exactly to it.

    Parameters
    ----------
    points : (N, 2) array
        Vertices; those that no triangle has are left out.
    triangles : (T, 3) integer array
        Indices of points. They may touch but not overlap.

    Examples
    --------
    >>> from cvtimg.meshes import measure_mesh
    >>> measures = measure_mesh([[0, 0], [1, 0], [0.5, 0.75**0.5]], [[0, 1, 2]])
    >>> round(measures.alpha, 9), round(measures.beta, 9), round(measures.q, 9), round(measures.chi, 9)
    (1.0, 1.0, 1.0, 1.0)
    """
    places = check_places("points", points, 2)
    corners = check_triangles("triangles", triangles, len(places))
    used, inverse = np.unique(corners, return_inverse=True)
    places, corners = places[used], inverse.reshape(-1, 3).astype(np.int32)
    each = measure_triangles(places, corners)
    check_have_area("triangles", each.areas)
    domain = shapely.coverage_union_all(shapely.polygons(places[corners]))
    cells = measure_cells(places, PolygonRegion(domain))
    return MeshMeasures(
        h=cells.h,
        chi=cells.chi * 0.75**0.5,
        tau=cells.tau,
        d=cells.d,
        alpha=float(each.areas.max() / each.areas.mean()),
        beta=60 / float(each.least_angles.min()),
        q=1 / float(each.qualities.min()),
        p=float(each.circumradii.std() / each.circumradii.mean()),
        least_angle=float(each.least_angles.min()),
        mean_quality=float(each.qualities.mean()),
        below_30=float((each.least_angles < 30).mean()),
    )
