"""Tagged arrays come back as they were, and nothing else does."""

from pathlib import Path

import numpy as np
import pytest

from cvtimg.bases import read_basis, reduced_basis
from cvtimg.engine.block_descent import Checkpoint
from cvtimg.files.arrays import UnfitArraysError, load_arrays, save_arrays
from cvtimg.segmentation import RegionHierarchy, segment_hierarchy


def test_arrays_come_back_and_a_file_that_exists_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    save_arrays(path, "list", {"numbers": np.arange(3), "name": "x"}, compressed=True)
    found = load_arrays(path, "list", ["name", "numbers"])
    assert (str(found["name"]), found["numbers"].tolist()) == ("x", [0, 1, 2])
    with pytest.raises(FileExistsError):
        save_arrays(path, "list", {})


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\3\4 cut off"])
def test_a_file_of_something_else_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.npz"
    path.write_bytes(content)
    with pytest.raises(UnfitArraysError, match=r"a\.npz: is not a list"):
        load_arrays(path, "list", ["numbers"])


def test_another_kind_a_newer_version_and_a_missing_array_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    save_arrays(path, "list", {"numbers": [1]})
    with pytest.raises(UnfitArraysError, match="is not a tree that this version reads, but a cvtimg list 1"):
        load_arrays(path, "tree", ["numbers"])
    with pytest.raises(UnfitArraysError, match="names is not a file in the archive"):
        load_arrays(path, "list", ["names"])
    np.savez(path, format="cvtimg list 2", numbers=[1])
    with pytest.raises(UnfitArraysError, match="but a cvtimg list 2"):
        load_arrays(path, "list", ["numbers"])
    with pytest.raises(FileNotFoundError):
        load_arrays(tmp_path / "none.npz", "list", [])


def test_what_is_saved_at_a_url_is_read_back_from_there() -> None:
    fsspec = pytest.importorskip("fsspec")
    basis, tree = reduced_basis(np.eye(4), 2), segment_hierarchy(np.eye(30))
    basis.save("memory://kept/basis.npz")
    np.testing.assert_array_equal(read_basis("memory://kept/basis.npz").modes, basis.modes)
    tree.save("memory://kept/tree.npz")
    np.testing.assert_array_equal(RegionHierarchy.load("memory://kept/tree.npz").merges, tree.merges)
    state = Checkpoint("memory://kept/state.npz", "job")
    assert state.load() is None
    state.save(np.ones((2, 3)), [3.0, 2.0])
    found = state.load()
    assert found is not None
    assert found[1] == [3.0, 2.0]
    fsspec.filesystem("memory").rm("/kept", recursive=True)
