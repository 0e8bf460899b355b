"""What cannot be is said in one line before any work, with the right status, and leaves no file behind.

What a function of Python refuses is claimed by the tests of its package: one row here shows that it becomes one line.
"""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import tifffile
from commands import Run
from PIL import Image
from scipy.io import netcdf_file

from cvtimg import write_image
from cvtimg.cli.overview import COMMANDS

RGB = np.random.default_rng(3).integers(0, 256, (24, 32, 3), np.uint8)

#: Command lines that are wrong by themselves, and what is said of them: exit status 2.
WRONG = """
quantize -k 4 | Missing argument 'INPUT...'
quantize a.png -k 4 --colour red | No such option: --colour
help quantise | No such command 'quantise'; did you mean quantize?
quantize a.png -k abc | '-k': 'abc' must be auto or a whole number in 1..65536
quantize a.png -k 0 | '0' must be auto or a whole number in 1..65536
quantize a.png -k 4 --seed -1 | '--seed': '-1' must be a whole number in 0..
quantize a.png --psnr -1 | '-1' must be a number >= 0
quantize a.png -k 2 --volume-power nan | 'nan' must be a number >= 0
quantize a.png -k 4 --dither bayer --dither-strength 2 | '2' must be a number in 0..1
quantize a.png -k 4 --space hsv | '--space': 'hsv' must be one of rgb, linear, lab, oklab
quantize a.png --max-bytes 0 | '0' must be a number of bytes >= 1
quantize a.png --color-bits 0 | '0' must be a number of bits in 1..8, or three such as 5,6,5
quantize a.png -k 4 --lock loud | 'loud' must be a color such as '#rgb', '#rrggbb' or '#rrggbbaa', or a name
quantize a.png --goal error | one of -k, --quality, --psnr, --max-bytes and --palette must be given
quantize a.png -k 4 -o out.xyz | 'out.xyz' must end in one of .png,
quantize a.png -k 4 --save-palette p.xyz | 'p.xyz' must end in one of .gpl, .json
quantize a.png -k 4 --ext .jpg | 'NAME.jpg' must end in one of .png,
quantize a.png -k 4 -o - --json | --json needs standard output for itself; name the output by -o FILE
quantize a.png -k 4 -o xyz:- | '-.xyz' must end in one of .png,
quantize - -k 4 --shared-palette -o x.png | --shared-palette reads each input twice
quantize a.png -k 4 --optimize -o a.tif | --optimize is for .png, and not for a.tif
quantize a.png b.png -k 4 | 2 inputs need --out-dir DIR
quantize a.png b.png -k 4 -o x.png | -o is for one input, and these are 2: use --out-dir DIR for several
quantize a.png b.png -k 4 --out-dir out --save-palette p.gpl | --save-palette is for one input
quantize a.png more/a.tif -k 4 --out-dir out --overwrite | a.png and more/a.tif would both become out/a.png
quantize a.png --palette wrong.gpl | --palette: wrong.gpl:
quantize a.png --palette b.png -o b.png --overwrite | b.png is an input, which is never replaced
quantize a.png -k 4 -o a.png --overwrite | a.png is an input, which is never replaced
quantize a.png -k 4 -o more/../a.png --overwrite | is an input, which is never replaced
quantize a.png -k 4 -o link.png --overwrite | is an input, which is never replaced
quantize a.png -k 4 --out-dir . --overwrite | is an input, which is never replaced
quantize a.png b.png -k 4 --out-dir more/.. --overwrite | is an input, which is never replaced
quantize a.png -k 5 --lock house.hex --save-palette house.hex --overwrite | an input, which is never replaced
palette a.png -k 5 --lock house.hex --save-palette house.hex --overwrite | an input, which is never replaced
quantize twins -k 4 --in-place --yes | twins/a.png and twins/b.png would both become
quantize proj -k 4 --in-place --yes | proj/a.png is a link to
quantize proj/*.png -k 4 --in-place | orig/a.png, a file elsewhere
quantize proj/a.png -k 4 --in-place | orig/a.png, a file elsewhere
quantize a.png -k 4 --overwrite --out-dir proj | a file elsewhere, which is not replaced
quantize a.png -k 4 --overwrite -o proj/a.png | a file elsewhere, which is not replaced
quantize a.png -k 4 --overwrite -o c.png --report proj/r.csv | a file elsewhere, which is not replaced
quantize a.png -o nothing | nothing is a folder, and must be a file; for a folder there is --out-dir
quantize a.png -o new/ | for a folder there is --out-dir
quantize a.png --palette gameboy | gameboy: is no file, and no known palette: cga, game-boy
quantize orig/x/a.png orig/y/a.png -k 4 --out-dir o | give orig, which has both, to keep their folders
quantize a.png -k 4 --weight-map none.png | --weight-map: none.png: no such file
quantize a.png -k 3 --weight-map pages.tif | has 3 pages, where one image is expected
quantize a.png -k 4 --weight-map a.png | --weight-map: a.png: must be a gray image
palette a.png --lock #ff00ff | --lock needs -k
segment pages.tif --objects --volume -k 2 -o l.tif | takes no -k
segment a.png -k 2 --write labels,borders | --write: 'borders' must be one of labels, mean, edges, overlay, contours
segment a.png -k 2 --mask land.png -o land.png --overwrite | land.png is an input
segment a.png -k 2 --write table.xls | .xls' must end in one of .csv
segment a.png -k 2 --contours a.dxf | .dxf' must end in one of .svg, .geojson
segment a.png -k 2 -o a.jpg | .jpg' must end in one of .png, .tif, .tiff, .npy
segment a.png b.png -k 2 --overlay a.png | --overlay is for one input
restore a.png b.png -k 2 -o out.png --weights 1,-2 | '1,-2' must be numbers > 0
restore a.png b.png -k 2 -o out.png --edge-weight x | 'x' must be auto or a number >= 0
restore a.png b.png -k 2 -o out.png --mask black.png | --mask is given 1 times, for 2 versions
restore a.png b.png -k 2 -o b.png --overwrite | b.png is an input
restore a.png b.png -k 2 -o out.png --labels out.png | would both become out.png
cluster trees.csv | Missing option '--clusters' / '-k'
cluster trees.csv -k 3 --columns a,,b | --columns: 'a,,b' must be names with commas between them
cluster trees.csv -k 3 -o labels.txt | 'labels.txt' must end in one of .csv, .npy
cluster trees.csv -k 3 --generators g.npy | 'g.npy' must end in one of .csv
cluster trees.csv -k 3 -o x.csv --generators x.csv | two outputs of trees.csv would both become x.csv
cluster trees.csv -k 3 -o trees.csv --overwrite | trees.csv is an input, which is never replaced
elbow a.png --rule psnr --space lab | --rule psnr needs --space rgb
elbow a.png --csv x.csv --report x.csv | --csv and --report would both become x.csv
design -n 3 | give one of -d, --bounds and --axis
design -n 3 -d 2 --bounds box.csv | give one of -d, --bounds and --axis
design -n 3 --axis heat,9,1 | heat
design -n 3 --axis alloy,A|A | alloy
sphere -n 100 | Missing option '--output' / '-o'
sphere -n 100 -o a.txt | must end in
sphere -n 100 -o a.nc --refine 10,50 | must be LON,LAT,RADIUS,RATIO, all numbers, or IMAGE,RATIO
sphere -o a.nc --cell-width 30km --refine 1,2,3 | must be LON,LAT,RADIUS,WIDTH
sphere -n 99 -o a.nc --plot a.png --view 10 100 | '100' must be a number in -90..90; two are needed
sphere -n 99 -o a.nc --region 1,2 | --region 1,2 must be WEST,SOUTH,EAST,NORTH
sphere -n 99 -o a.nc --radius moon | 'moon' must be a number > 0, or mpas, cesm
segment a.png --edge-weight 3 | --edge-weight needs -k
segment a.png -k 3 --write tree | 'tree' must be one of
segment a.png --hierarchy --strongest 3 --contours a.zip | --strongest needs --contours as .svg or .geojson
segment a.png --hierarchy --strongest 3 --overlay c.png | --strongest needs --contours as .svg or .geojson
segment a.png -k 3 --hierarchy --threshold 0.4 | --threshold and -k N exclude each other
mesh a.png -n 9 -o a.txt | .vtu
mesh a.png --edge-length 0 | --edge-length
mesh a.png --order 2 -o a.stl | --order 2: 'a.stl' must end in one of .vtu, .msh
mesh a.wkt --name a=b | 'a=b' must be NAME=LABEL or NAME=X0,Y0,X1,Y1
surface ball.stl | -n
surface ball.stl -n 3 | '3' must be a whole number in 4..
surface ball.stl -n 50 -o a.xyz | -o
surface ball.stl -n 50 --plot a.gif | --plot
basis film.png -n 2 -o a.txt | .npz
stipple a.png -n 9 --width 20km | a length > 0 such as 200mm
stipple a.png -n 9 -o a.xyz | must end in one of .svg
mosaic a.png -n 9 -o a.csv | must end in one of .svg
mosaic a.png -n 9 --shape squares | squares
stipple a.png -n 50 --dots sized --radius-range 3 1 -o a.svg | --radius-range: A and B must be > 0, the least first
explore --port 65536 | '65536' must be a whole number in 0..65535
quantise | No such command 'quantise'; did you mean quantize?
"""
#: Command lines of which an input or another file cannot be used: exit status 1.
FAILED = """
mesh noise.png -o a.vtu | is no mask and no labels; divide it first: cvtimg segment noise.png
info trees.csv | is a table and not an image; cvtimg cluster trees.csv -k auto reads it
quantize wrong.geojson -k 4 | is no image; if it has outlines, cvtimg mesh wrong.geojson
info bare.nc | bare.nc: has arrays by name and is no image; save one of them as .npy or .tif
info ball.stl | is a surface and not an image; cvtimg surface ball.stl
info wrong.gpl | is a palette and not an image; cvtimg palette wrong.gpl
cluster a.png -k 2 | is not text; for images there is cvtimg segment
quantize none.png -k 4 | none.png: no such file
info cut.jpg | cut.jpg: is truncated
info nothing | nothing: no images in this folder
quantize a.png -k 4 -o wrong.gpl/out.png | wrong.gpl/out.png
quantize a.png -k 4 -o nowhere/out.png | nowhere/out.png
quantize a.png -k 4 -o b.png | b.png: exists already; pass --overwrite to replace it
quantize a.png -k 4 -o b.png --dry-run | b.png: exists already
quantize none.png -k 4 -o c.png --dry-run | none.png: no such file
quantize a.png -k 4 -o self.png | a.png: self.png:
quantize self.png -k 4 | self.png: no such file
quantize a.png -k 4 --out-dir wrong.gpl | cvtimg: wrong.gpl:
quantize a.png -k 4 --out-dir wrong.gpl/below | cvtimg: wrong.gpl/below:
quantize a.png -k 4 -o c.png --save-palette wrong.gpl | wrong.gpl: exists already
quantize a.png -k 4 -o c.png --save-palette wrong.gpl/a.gpl | wrong.gpl/a.gpl
elbow a.png --csv far.csv | far.csv: exists already
quantize a.png -k 300 -o a.gif | a.png: .gif holds images of at most 256 colors, and this one has 300
quantize a.png -k 4 --mask black.png | the mask black.png must have 32 x 24 pixels, as the image, and has 40 x 20
quantize film.png -k 5 --depth 16 | film.png: is an animation, which --depth 16 cannot be used for
quantize film.png -k auto | is an animation, which -k auto cannot be used for
quantize pages.tif -k 3 -o p.png | has several pages: name an output that can hold them, -o FILE.tif
quantize pages.tif -k 4 --page 4 -o none.png | pages.tif: has 3 pages, and no page 4
quantize pages.tif -k 4 --mask two.tif -o out.tif | needs a mask of 1 or 3 pages or frames, and two.tif has 2
quantize pages.tif -k 4 --mask none.tif -o out.tif | page 2 of 3 has no pixel that counts
quantize low.tif -k 4 -o low.png | .png cannot hold; write .tif or .tiff or .npy
quantize bands.npy -k 4 -o out.npy | say which by --channel-axis 0 or 2
segment pages.tif -k 3 -o l.png | has several pages: name an output that can hold them, -o FILE.tif
segment pages.tif -k 3 --edges e.png | that can hold them, --edges FILE.tif
segment pages.tif -k 3 --contours c.svg | --contours holds one
segment pages.tif --objects --volume -o l.tif | --pixel-size, such as 0.3x0.3x2um
segment pages.tif --objects --volume --pixel-size 0.3um -o l.tif | of which only 0.3 um is known
segment pages.tif -k 2 --smallest-detail 1um -o l.tif | does not say the size of its pixels, for --smallest-detail
segment pages.tif --objects --volume --z 1 -o l.tif | a volume has several planes
segment pages.tif --objects --track -o l.tif | without T to track objects along
segment series.tif --objects --track -o l.tif | objects are tracked with --volume, or in one plane, --z N
segment clear.png -k 2 | clear.png: has no pixel that counts: all are transparent
restore a.png black.png -k 2 -o out.png | black.png has size (20, 40) and a.png has (24, 32)
restore a.png b.png --mask black.png --mask black.png -k 2 -o out.png | black.png of shape (20, 40)
restore pages.tif -k 3 -o r.png | name an output that can hold them, -o FILE.tif
restore pages.tif -k 3 --merge T -o r.tif | without T to --merge
palette six.tif | has 6 bands, which are not colors
elbow a.png --columns a | --columns must not be given for images
cluster trees.csv -k 41 --columns height | -k 41 must be in 1..4, the number of samples
design -n 3 --bounds none.csv | none.csv: no such file
design -n 3 --bounds trees.csv | trees.csv: must have the columns name, low and high
design -n 3 --bounds odd.csv | odd.csv: a of kind odd must be
design -n 5 -d 2 --feasible 'speed < 1' | --feasible 'speed < 1' has no axis 'speed'; there are x1, x2
design -n 5 -d 2 --density 'exp(' | --density 'exp(' cannot be computed
sphere -o a.nc --cell-width bare.nc | it has no lon
sphere -n 99 -o a.nc --region no.geojson | --region no.geojson: no such file
sphere -n 99 -o a.nc --land land.png --strait 1,2,3 | --strait 1,2,3 must be LON,LAT
sphere -n 100 -o a.nc --density a.png | must be twice as wide as high
sphere -n 100 -o a.nc --density black.png | --density black.png must not be 0 everywhere
sphere -n 100 -o a.nc --refine black.png,3 | --refine black.png must not be 0 everywhere
sphere -n 100 -o a.nc --density nan.tif | --density nan.tif must be finite
sphere -n 100 -o a.nc --coast black.png | --coast black.png must not be 0 everywhere
sphere -n 9 -o a.nc --parent off.csv --within 0,0,60 | on a sphere: point 1 is 3 from the
sphere -n 9 -o a.nc --parent trees.csv --within 0,0,9 | neither an MPAS mesh
mesh wrong.geojson -n 9 | wrong.geojson: is not a .geojson file of polygons
mesh disc.png --periodic x | --periodic x must be for borders on the left and right
mesh a.wkt -n 9 --label 1 | a.wkt: has polygons; --label is for images of labels
mesh labels.png -n 90 --label 9 -o b.vtu | labels.png: holds no label 9
mesh disc.png --keep-points | disc.png: has pixels; --keep-points is for polygons
mesh a.wkt --name a=1 --name b=1 | --name must have each name and each label once
explore --no-browser none.png | none.png: no such file
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with files of all kinds, most of them of little use."""
    made = tmp_path_factory.mktemp("files")
    for name in ("more", "nothing", "proj", "twins", "orig/x", "orig/y"):
        (made / name).mkdir(parents=True)
    for name in ("a.png", "b.png", "more/a.tif", "twins/b.png", "orig/a.png", "orig/x/a.png", "orig/y/a.png"):
        write_image(made / name, RGB)
    write_image(made / "clear.png", np.zeros((6, 6, 4), np.uint8))
    write_image(made / "six.tif", np.zeros((2, 2, 6), np.uint8))
    write_image(made / "low.tif", RGB[..., 0].astype(np.int16) - 300)
    inside = np.ones((3, 8, 8), np.uint8) * np.array([1, 0, 1], np.uint8)[:, None, None]
    tifffile.imwrite(made / "none.tif", inside, photometric="minisblack")
    np.save(made / "bands.npy", np.zeros((3, 24, 32), np.uint8))
    frames = [Image.fromarray(np.roll(RGB, shift, 0)) for shift in range(3)]
    frames[0].save(made / "film.png", save_all=True, append_images=frames[1:])
    for name, shape, axes in (("pages", (3, 8, 8), "ZYX"), ("two", (2, 8, 8), "ZYX"), ("series", (2, 3, 8, 8), "TZYX")):
        metadata = {"axes": axes}
        tifffile.imwrite(made / f"{name}.tif", np.zeros(shape, np.uint8), photometric="minisblack", metadata=metadata)
    Image.new("L", (40, 20)).save(made / "black.png")
    Image.linear_gradient("L").resize((40, 20)).save(made / "land.png")
    Image.fromarray(np.full((20, 40), np.nan, np.float32)).save(made / "nan.tif")
    netcdf_file(made / "bare.nc", "w").close()
    down, right = np.mgrid[:20, :40]
    write_image(made / "noise.png", RGB[..., 0])
    write_image(made / "disc.png", np.hypot(down - 10, right - 20) < 8)
    write_image(made / "labels.png", (1 + down // 10).astype(np.uint8))
    pytest.importorskip("trimesh").creation.icosphere(1).export(made / "ball.stl")
    texts = {
        "wrong.gpl": "hello",
        "wrong.geojson": "{",
        "a.wkt": "POLYGON ((0 0, 2 0, 2 1, 0 1, 0 0))",
        "trees.csv": "site,height,girth,count\nS0,1,5,1\nS1,2,6,1\nS2,9,4,2\nS3,8,7,3\n",
        "box.csv": "name,low,high\nspeed,0,30\nheat,20,90\n",
        "odd.csv": "name,low,high,kind,levels,unit\na,0,1,odd,,\n",
        "house.hex": "ff0000\n",
        "orig/r.csv": "mine",
        "far.csv": "x1,x2\n5,5\n",
        "off.csv": "x,y,z\n1,0,0\n0,3,0\n0,0,1\n-1,0,0\n0,-1,0\n0,0,-1\n",
    }
    for name, text in texts.items():
        (made / name).write_text(text)
    for name, target in (("link.png", "a.png"), ("self.png", "self.png"), ("twins/a.png", "b.png")):
        (made / name).symlink_to(target)
    for name in ("proj/a.png", "proj/r.csv"):
        (made / name).symlink_to(f"../orig/{name[5:]}")
    Image.fromarray(np.tile(RGB, (9, 9, 1))).save(made / "cut.jpg")
    (made / "cut.jpg").write_bytes((made / "cut.jpg").read_bytes()[:-2000])
    return made


def rows() -> list[tuple[str, int, str]]:
    """Return command lines, their status, and what is said."""
    lines = [(line, status) for text, status in ((WRONG, 2), (FAILED, 1)) for line in text.strip().splitlines()]
    return [(command, status, said) for line, status in lines for command, said in [line.rsplit(" | ", 1)]]


@pytest.mark.parametrize(("command", "status", "said"), rows(), ids=[row[0] for row in rows()])
def test_what_cannot_be_is_one_line_and_leaves_nothing(
    command: str, status: int, said: str, folder: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    before = {path: path.lstat().st_mtime_ns for path in folder.rglob("*")}
    words = shlex.split(command)
    outcome = run(*words)
    assert (outcome.status, outcome.out) == (status, ""), outcome.err
    assert re.fullmatch(r"cvtimg: [^\n]+\n", outcome.err)
    assert said in outcome.err
    assert words[0] not in COMMANDS or (f"(see cvtimg {words[0]} --help)" in outcome.err) == (status == 2)
    assert {path: path.lstat().st_mtime_ns for path in folder.rglob("*")} == before
