import numpy as np

from cvtimg.halfedges import EdgeTable, boundary_edges, edges_around, unique_edges


def test_edges_are_listed_once_in_order_and_counted() -> None:
    triangles = np.array([[3, 1, 0], [1, 3, 2]], np.int32)
    around = edges_around(triangles)
    edges, which, counts = unique_edges(around)
    assert edges.tolist() == [[0, 1], [0, 3], [1, 2], [1, 3], [2, 3]]
    assert (edges[which] == np.sort(around, axis=1)).all()
    assert counts.tolist() == [1, 1, 1, 2, 1]
    assert boundary_edges(triangles).tolist() == [[1, 0], [0, 3], [3, 2], [2, 1]]


def test_edges_are_found_by_their_ends_in_either_direction() -> None:
    table = EdgeTable(np.array([[3, 1], [0, 4], [1, 3]], np.int32), 5)
    assert table.find(np.array([[1, 3], [4, 0], [0, 4], [4, 4], [0, 0], [-1, 3]])).tolist() == [0, 1, 1, -1, -1, -1]
    assert EdgeTable(np.empty((0, 2), np.int32), 5).find(np.array([[1, 3]])).tolist() == [-1]
