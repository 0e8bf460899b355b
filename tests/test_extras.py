"""cvtimg works without its optional dependencies; what needs one says how to install it."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from picture_files import rgb_profile
from PIL import Image

from cvtimg import read_image, write_image

pytestmark = pytest.mark.usefixtures("here")
ROOT = Path(__file__).parents[1]
#: What the extras install.
OPTIONAL = (
    *("aiohttp", "astropy", "dask", "distributed", "fsspec", "imagecodecs", "matplotlib", "meshio", "netCDF4"),
    *("numexpr", "oxipng", "psutil", "pyarrow", "pythoncdt", "rawpy", "roifile", "sklearn"),
    *("starlette", "trimesh", "uvicorn", "websockets", "zarr"),
)
#: An installation without them.
BARE = """
import sys

class Missing:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] in OPTIONAL:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Missing)
# find_spec would pass the error on.
import importlib.util
found = importlib.util.find_spec
importlib.util.find_spec = lambda name, *more: None if name.partition(".")[0] in OPTIONAL else found(name, *more)
""".replace("OPTIONAL", repr(OPTIONAL))

RNG = np.random.default_rng(3)
RGB = RNG.integers(0, 256, (8, 12, 3), np.uint8)
DEEP = RNG.integers(0, 65536, (8, 12, 3), np.uint16)


def bare(script: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a script in an installation without extras."""
    env = {**os.environ, "PYTHONWARNINGS": "error"}
    return subprocess.run(
        [sys.executable, "-P", "-c", BARE + script, *words], capture_output=True, text=True, check=False, env=env
    )


def commands(*lines: str) -> dict[str, tuple[int, str]]:
    """Run commands one after the other; return the status of each and what it complains of."""
    script = """
import contextlib, io, json
from cvtimg.cli.app import main
outcomes = []
for line in sys.argv[1:]:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as error:
        status = main(line.split())
    outcomes.append((status, error.getvalue()))
print(json.dumps(outcomes))
"""
    done = bare(script, *lines)
    assert (done.returncode, done.stderr) == (0, "")
    return dict(zip(lines, map(tuple, json.loads(done.stdout)), strict=True))


@pytest.mark.slow
def test_every_module_imports_without_extras() -> None:
    """All but those that are a class of scikit-learn's, or the server of the page."""
    script = """
import importlib, pkgutil, cvtimg
for module in pkgutil.walk_packages(cvtimg.__path__, "cvtimg."):
    try:
        importlib.import_module(module.name)
    except ImportError as error:
        print(module.name, error)
"""
    done = bare(script)
    assert done.returncode == 0, done.stderr
    failed = dict(line.split(" ", 1) for line in done.stdout.splitlines())
    assert failed.pop("cvtimg.tables.estimator").endswith("pip install 'cvtimg[sklearn]'")
    assert all(name.startswith("cvtimg.explore.") for name in failed), failed


def test_quantize_needs_no_extra() -> None:
    Path("folder").mkdir()
    for path in ("a.png", "a.jpg", "a.tif", "folder/b.png"):
        write_image(path, RGB)
    for path in ("deep.png", "deep.tif"):
        write_image(path, DEEP)
    Image.fromarray(RGB).save("lzw.tif", compression="tiff_lzw")
    names = ["a.png", "a.jpg", "a.tif", "lzw.tif", "deep.png", "deep.tif", "folder"]
    done = commands(*(f"quantize {name} -k 4 --quiet --out-dir out/{name}" for name in names))
    assert set(done.values()) == {(0, "")}, done
    assert [len(list(Path("out", name).iterdir())) for name in names] == [1] * len(names)


@pytest.mark.slow
def test_commands_need_no_extra_for_their_own_job() -> None:
    Path("folder").mkdir()
    write_image("a.png", RGB)
    for name in ("b", "c", "d"):
        write_image(f"folder/{name}.png", RGB[::-1] if name == "c" else RGB)
    Path("table.csv").write_text("x,y\n0,0\n0,1\n9,9\n9,8\n")
    page = Image.fromarray(RGB).resize((90, 60))
    page.save("pages.tif", compression="tiff_lzw", save_all=True, append_images=[page])
    done = commands(
        "palette a.png -k 4",
        "quantize pages.tif -k 4 -o few.tif",
        "segment a.png -k 3 -o segments.png",
        "restore a.png -k 4 -o restored.png",
        "elbow a.png",
        "stipple a.png -n 20 -o dots.svg",
        "mosaic a.png -n 9 -o tiles.png",
        "sphere -n 42 -o grid.csv",
        "design -n 8 -d 2 -o points.csv",
        "cluster table.csv -k 2 -o clusters.csv",
        "basis folder -n 2 -o basis.npz",
        "info a.png",
    )
    assert set(done.values()) == {(0, "")}, done


#: Commands that need an extra, the status with which they end without it, and what they say.
NEED_EXTRAS = [
    ("quantize a.png -k 4 --optimize", 2, "--optimize needs oxipng: pip install 'cvtimg[oxipng]'"),
    ("quantize a.fits -k 4", 1, "a.fits: is a FITS file, which needs astropy: pip install 'cvtimg[fits]'"),
    ("restore a.dng -o b.png", 1, "a.dng: needs rawpy: pip install 'cvtimg[raw]'"),
    (
        "quantize lzw.tif -k 4",
        1,
        "lzw.tif: is compressed in a way that needs imagecodecs: pip install 'cvtimg[codecs]'",
    ),
    (
        "quantize profile.png -k 4",
        1,
        "profile.png: has a color profile at 16 bits, which needs imagecodecs: pip install 'cvtimg[codecs]'",
    ),
    ("quantize http://localhost/a.png -k 4", 1, "needs fsspec: pip install 'cvtimg[remote]'"),
    ("quantize a.png -k 4 --dask local", 2, "--dask needs distributed: pip install 'cvtimg[dask]'"),
    ("elbow a.png --plot plot.svg", 2, "--plot needs matplotlib: pip install 'cvtimg[plot]'"),
    ("mesh mask.png --edge-length 4", 1, "mask.png: meshes need pythoncdt: pip install 'cvtimg[mesh]'"),
    ("surface a.stl -n 20", 1, "a.stl: needs trimesh: pip install 'cvtimg[surfaces]'"),
    ("explore a.png", 2, "explore needs starlette: pip install 'cvtimg[explore]'"),
    ("basis a.zarr -n 2 -o a.npz", 1, "a.zarr: needs zarr: pip install 'cvtimg[zarr]'"),
]


@pytest.mark.slow
def test_a_command_names_the_extra_that_it_needs() -> None:
    write_image("a.png", RGB)
    mask = np.zeros((20, 20), np.uint8)
    mask[4:16, 4:16] = 255
    write_image("mask.png", mask)
    tifffile.imwrite("lzw.tif", DEEP, photometric="rgb", compression="lzw")
    Path("a.fits").write_bytes(b"SIMPLE  =                    T".ljust(2880))
    for name in ("a.stl", "a.dng", "a.mp4"):
        Path(name).write_bytes(b"solid\n")
    Path("a.zarr").mkdir()
    profile: Any = rgb_profile(value=1.0)
    from cvtimg.pictures.files import Metadata

    write_image("profile.png", DEEP, metadata=Metadata(icc=profile))
    lines = [f"{words} --out-dir out" if words.startswith("quantize") else words for words, _, _ in NEED_EXTRAS]
    done = commands(*lines)
    for line, (_, status, error) in zip(lines, NEED_EXTRAS, strict=True):
        assert done[line][0] == status, line
        assert error in done[line][1]
        assert done[line][1].count("\n") == 1, done[line]


def test_floats_of_a_bare_installation_come_back() -> None:
    values = RNG.normal(size=(9, 7, 5)).astype(np.float32)
    np.save("a.npy", values)
    script = """
import numpy as np
from cvtimg import read_image, write_image
write_image("a.tif", np.load("a.npy"))
assert (read_image("a.tif") == np.load("a.npy")).all()
"""
    done = bare(script)
    assert done.returncode == 0, done.stderr
    np.testing.assert_array_equal(read_image("a.tif"), values, strict=True)
