"""Files that were damaged, or made to harm, and what cvtimg makes of each.

Every file goes through ``cvtimg info`` and ``cvtimg quantize`` in this process. It must end in a right result or in an
error of one line: no traceback, no warning, no crash, no hang, and no file left over.
"""

import io
import json
import re
import struct
import time
import zlib
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from picture_files import chunk
from PIL import Image, ImageCms

from cvtimg._shared.types import Array
from cvtimg.pictures import encode_image

#: Seconds that a command may take for one file.
LIMIT = 20.0
RNG = np.random.default_rng(8)
PIXELS = np.kron(RNG.integers(0, 256, (5, 6, 3), np.uint8), np.ones((7, 5, 1), np.uint8))
RGB = Image.fromarray(PIXELS + RNG.integers(0, 9, PIXELS.shape, np.uint8) // 2)

File = tuple[str, bytes]


def encoded(image: Image.Image, form: str, **options: Any) -> bytes:
    """Encode a picture."""
    file = io.BytesIO()
    image.save(file, form, **options)
    return file.getvalue()


def seeds() -> Iterator[File]:
    """Give whole files of all kinds."""
    yield from pictures()
    yield from measured()


def pictures() -> Iterator[File]:
    """Give whole pictures: formats that Pillow writes, in all modes that each takes."""
    alpha = RGB.copy()
    alpha.putalpha(RGB.convert("L"))
    modes = {mode: RGB.convert(mode) for mode in ("1", "L", "LA", "P", "CMYK", "YCbCr", "LAB", "HSV", "I", "F", "RGB")}
    modes |= {"RGBA": alpha, "PA": alpha.convert("PA"), "RGBa": alpha.convert("RGBa"), "La": modes["LA"].convert("La")}
    modes |= {"RGBX": RGB.convert("RGBX"), "I16": Image.fromarray(np.asarray(modes["L"]).astype(np.uint16) * 257)}
    Image.init()
    for form in sorted(Image.SAVE):
        if form in ("PDF", "EPS", "PALM", "XVTHUMB", "BUFR", "GRIB", "HDF5", "WMF"):
            continue
        for mode, image in modes.items():
            if form == "ICNS" and mode not in ("RGB", "RGBA"):  # slow: each holds seven sizes
                continue
            try:
                yield f"{form.lower()}-{mode}.{suffix_of(form)}", encoded(image, form)
            except Exception:  # this format does not hold this mode
                continue
    yield from special()


def measured() -> Iterator[File]:
    """Give whole files of measurements: stacks of pages, odd numbers of bands, byte orders and types, FITS."""
    values = np.asarray(RGB)
    types = ("u1", "i1", "<u2", ">u2", "<i2", ">i2", "<u4", ">i4", "<f2", "<f4", ">f4", "<f8", ">f8")
    for name in types:
        order = "big" if name[0] == ">" else "little"
        for n_bands in (1, 2, 3, 4, 5, 7):
            image = np.dstack([values] * 3)[..., :n_bands].astype(name)
            bands = {"planarconfig": "contig"} if n_bands > 1 else {}
            photometric = "rgb" if n_bands == 3 else "minisblack"
            image = image if n_bands > 1 else image[..., 0]
            content = tifffile_bytes(image, byteorder=">" if order == "big" else "<", photometric=photometric, **bands)
            yield f"bands-{name[-2:]}-{order}-{n_bands}.tif", content
        array = io.BytesIO()
        np.save(array, values.astype(name))
        yield f"order-{name[-2:]}-{order}.npy", array.getvalue()
    yield "deep-rgb.png", encode_image(".png", values.astype(np.uint16) * 257)
    stack = np.stack([values[..., 0], values[..., 1], values[..., 2]])
    for kind in ({}, {"imagej": True}, {"ome": True}, {"bigtiff": True}, {"metadata": None}):
        label = next(iter(kind), "plain")
        yield f"stack-{label}.tif", tifffile_bytes(stack, photometric="minisblack", **kind)
        yield f"deep-stack-{label}.tif", tifffile_bytes(stack.astype(np.uint16), photometric="minisblack", **kind)
    with suppress(ImportError):
        from astropy.io import fits

        for name in ("u1", "i2", "u2", "i4", "f4"):
            for image in (values[..., 0], stack):
                file = io.BytesIO()
                fits.PrimaryHDU(image.astype(name)).writeto(file)
                yield f"sky-{name}-{image.ndim}.fits", file.getvalue()


def tifffile_bytes(image: Array, **options: Any) -> bytes:
    """Encode an array as tifffile does."""
    file = io.BytesIO()
    tifffile.imwrite(file, image, **options)
    return file.getvalue()


def suffix_of(form: str) -> str:
    """Return a suffix that Pillow knows for a format."""
    return next((suffix[1:] for suffix, name in Image.registered_extensions().items() if name == form), "bin")


def special() -> Iterator[File]:
    """Give whole files of unusual content."""
    for kind in ("raw", "tiff_lzw", "packbits", "tiff_adobe_deflate", "jpeg", "group4"):
        image = RGB.convert("1") if kind == "group4" else RGB
        try:
            yield f"tiff-{kind}.tif", encoded(image, "TIFF", compression=kind)
        except Exception:
            continue
    frames = [RGB.rotate(90 * n) for n in range(3)]
    for form in ("GIF", "PNG", "WEBP", "TIFF"):
        yield f"animated.{form.lower()}", encoded(RGB, form, save_all=True, append_images=frames)
    for size in ((1, 1), (1, 5000), (5000, 1), (65535, 1), (1, 65535)):
        for form in ("PNG", "TIFF", "BMP", "JPEG", "GIF"):
            try:
                yield f"{size[0]}x{size[1]}.{form.lower()}", encoded(RGB.resize(size), form)
            except Exception:
                continue
    for number in (0, 2, 5, 6, 8, 9, 255, 65535):
        exif = Image.Exif()
        exif[0x0112] = number
        for form in ("JPEG", "PNG", "TIFF", "WEBP"):
            yield f"turned-{number}.{form.lower()}", encoded(RGB, form, exif=exif.tobytes())
    yield "exif-garbage.jpg", encoded(RGB, "JPEG", exif=b"Exif\0\0" + bytes(range(200)))
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    lab = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()
    icc = {"garbage": b"garbage" * 9, "empty": b"\0", "cut": profile[:200], "right": profile, "lab": lab}
    icc["flipped"] = bytes(byte ^ 255 * (at % 71 == 3) for at, byte in enumerate(profile))
    for name, content in icc.items():
        for form in ("JPEG", "PNG", "TIFF"):
            yield f"icc-{name}.{form.lower()}", encoded(RGB, form, icc_profile=content)
    palette = RGB.convert("P", palette=Image.Palette.ADAPTIVE, colors=7)
    yield "palette-hole.png", png_with_palette(palette, 3)
    yield "palette-none.png", png_with_palette(palette, 0)
    yield "transparency-long.png", encoded(palette, "PNG", transparency=bytes(range(7)))


def png_with_palette(image: Image.Image, n_colors: int) -> bytes:
    """Write a PNG whose indices go beyond its palette."""
    content = encoded(image, "PNG")
    at = content.index(b"PLTE") - 4
    size = struct.unpack(">I", content[at : at + 4])[0]
    entries = content[at + 8 : at + 8 + 3 * n_colors]
    return content[:at] + (chunk(b"PLTE", entries) if n_colors else b"") + content[at + 12 + size :]


def png(width: int, height: int, depth: int = 8, color: int = 2, data: bytes = b"", interlace: int = 0) -> bytes:
    """Write a PNG that says what it likes."""
    header = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, interlace)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def tiff(entries: list[tuple[int, int, int, int]], follow: int = 0, tail: bytes = b"") -> bytes:
    """Write a TIFF of any tags, (tag, type, count, value), whose next page is at `follow`."""
    rows = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return b"II*\0" + struct.pack("<I", 8) + struct.pack("<H", len(entries)) + rows + struct.pack("<I", follow) + tail


def fits_header(width: int, height: int) -> bytes:
    """Write a FITS file that says what it likes, with hardly any data."""
    values = {"SIMPLE": "T", "BITPIX": 16, "NAXIS": 2, "NAXIS1": width, "NAXIS2": height}
    cards = [f"{name:8}= {value:>20}".ljust(80) for name, value in values.items()]
    return "".join([*cards, "END".ljust(80)]).ljust(2880).encode() + bytes(99)


def npy(kind: str, shape: str, content: bytes) -> bytes:
    """Write an array of any type and shape."""
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}}}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\0" + struct.pack("<H", len(header)) + header.encode() + content


def made() -> Iterator[File]:
    """Give files that say what is not so, or that are small and stand for much."""
    huge = 2**31 - 1
    for width, height in ((0, 0), (0, 5), (5, 0), (huge, 1), (1, huge), (huge, huge), (20000, 20000), (70000, 70000)):
        yield f"declared-{width}x{height}.png", png(width, height, data=zlib.compress(bytes(1000)))
        yield f"declared-{width}x{height}.ppm", b"P6 %d %d 255\n" % (width, height) + bytes(99)
        low = [min(side, 65535) for side in (width, height)]
        yield f"declared-{width}x{height}.gif", b"GIF89a" + struct.pack("<HH", *low) + b"\0\0\0;"
        bitmap = struct.pack("<2sIHHIIiiHHIIiiII", b"BM", 99, 0, 0, 54, 40, width, height, 1, 24, *[0] * 6)
        yield f"declared-{width}x{height}.bmp", bitmap
        size = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1), (277, 3, 1, 1)]
        yield f"declared-{width}x{height}.tif", tiff([*size, (273, 4, 1, 8), (278, 4, 1, height), (279, 4, 1, 64)])
        yield f"declared-{width}x{height}.fits", fits_header(width, height)
    # A gigabyte of zeros in a megabyte, and 300 million pixels in half of one.
    yield "bomb.png", png(18000, 18000, color=0, data=zlib.compress(bytes(18001 * 600), 9) * 3)
    little, much = png(4, 4, data=zlib.compress(bytes(52))), b"a\0\0" + zlib.compress(bytes(50_000_000), 9)
    yield "bomb-text.png", little[:-12] + chunk(b"zTXt", much) + little[-12:]
    yield "bomb-icc.png", png(4, 4)[:33] + chunk(b"iCCP", much) + png(4, 4)[33:]
    whole = [(256, 4, 1, 8), (257, 4, 1, 8), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1), (277, 3, 1, 1)]
    whole += [(278, 4, 1, 8), (279, 4, 1, 64)]
    data = 8 + 2 + 12 * (len(whole) + 1) + 4
    right = sorted([*whole, (273, 4, 1, data)])
    yield "tiny.tif", tiff(right, tail=bytes(range(64)))
    yield "loop.tif", tiff(right, follow=8, tail=bytes(range(64)))
    yield "next-outside.tif", tiff(right, follow=2**32 - 1, tail=bytes(range(64)))
    for tag, kind, count, value in ((258, 3, 60000, 8), (277, 3, 1, 65535), (273, 4, 2**31, 8), (279, 4, 1, 2**32 - 1)):
        lied = sorted([*(entry for entry in right if entry[0] != tag), (tag, kind, count, value)])
        yield f"tag-{tag}-{count}-{value}.tif", tiff(lied, tail=bytes(range(64)))
    lies = {259: (5, 7, 50000, 34925), 262: (99,), 317: (3,), 339: (9,), 258: (7, 64)}
    for tag, value in ((tag, value) for tag, values in lies.items() for value in values):
        lied = sorted([*(entry for entry in right if entry[0] != tag), (tag, 3, 1, value)])
        yield f"tag-{tag}-{value}.tif", tiff(lied, tail=bytes(range(64)))
    for kind in (1, 7):  # a width of bytes, and a height of no type at all
        lied = [(256, kind, 1, 8), (257, 127, 1, 8), *(entry for entry in right if entry[0] > 257)]
        yield f"size-{kind}.tif", tiff(lied, tail=bytes(range(64)))
    yield "tile-zero.tif", tiff(sorted([*right, (322, 4, 1, 0), (323, 4, 1, 0)]), tail=bytes(range(64)))
    yield "tile-huge.tif", tiff(sorted([*right, (322, 4, 1, 2**31), (323, 4, 1, 2**31)]), tail=bytes(range(64)))
    yield "self.tif", tiff([(330, 4, 1, 8), *right], follow=8)
    yield "big.tif", b"II+\0\x08\0\0\0" + struct.pack("<Q", 2**63) + bytes(40)
    yield "magic-only.npy", b"\x93NUMPY"
    for shape in ("(0, 0)", "(3,)", "(2**9, 3)", "(99999999, 99999999)", "(2, 2, 2, 2)", "(-1, 4)"):
        yield f"shape-{shape}.npy", npy("<f4", shape, bytes(64))
    yield "pickle.npy", npy("|O", "(2, 2)", b"cos\nsystem\n(S'x'\ntR.")
    for name in ("float-nan", "float-inf"):
        values = np.ones((4, 4), np.float32)
        values[0, 0] = np.nan if name.endswith("nan") else np.inf
        yield f"{name}.tif", encoded(Image.fromarray(values), "TIFF")
    for suffix in ("png", "jpg", "tif", "gif", "bmp", "webp", "ico", "psd", "dds", "j2k", "qoi", "svg", "npy"):
        yield f"empty.{suffix}", b""
        yield f"text.{suffix}", b"This is no picture.\n" * 20
        yield f"zeros.{suffix}", bytes(500)
        yield f"noise.{suffix}", RNG.bytes(2000)
        yield f"wrong-jpeg.{suffix}", encoded(RGB, "JPEG")
        yield f"wrong-png.{suffix}", encoded(RGB, "PNG")
    magics = b"\xff\xd8\xff|GIF89a|BM|II*\0|MM\0*|RIFF\0\0\0\0WEBP|8BPS|DDS |qoif|P6 ".split(b"|")
    for number, magic in enumerate(magics):
        yield f"magic-{number}.png", magic + RNG.bytes(300)
    yield "script.eps", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n(%pipe%touch x) (w) file\n"


def judge(path: Path) -> str:
    """Return what became of a file: "right", "error", or what was wrong."""
    # PNG holds neither bands nor pages.
    suffix = ".tif" if path.suffix in (".tif", ".npy", ".fits") else ".png"
    out = path.with_name(f"out{suffix}")
    out.unlink(missing_ok=True)  # left by a file that took too long
    before = set(path.parent.iterdir())
    verdict, rows = "right", list[dict[str, Any]]()
    for arguments in (["info", str(path), "--json"], ["quantize", str(path), "-k", "4", "-o", str(out), "--json"]):
        start = time.process_time()
        verdict, rows = outcome(arguments)
        if time.process_time() - start > LIMIT:
            return f"took {time.process_time() - start:.0f} seconds"
        if verdict not in ("right", "error"):
            return verdict
    if verdict == "right":
        verdict = compare(out, rows[0])
        out.unlink()
    left = set(path.parent.iterdir()) - before
    return f"left over: {sorted(file.name for file in left)}" if left else verdict


def compare(out: Path, row: dict[str, Any]) -> str:
    """Compare the image written with what the command says of it, by other readers."""
    shape: tuple[int, ...] = (row["height"], row["width"])
    if out.suffix == ".tif":
        with tifffile.TiffFile(out) as tiff:
            image, axes = tiff.asarray(), tiff.series[0].axes
        if "C" in axes:  # channels belong to the pixel
            image = np.moveaxis(image, axes.index("C"), -1)
        pages = (row["pages"],) if row.get("pages", 1) > 1 or image.ndim > 2 + ("C" in axes or "S" in axes) else ()
        bands = image.shape[-1:] if image.ndim > len(pages + shape) else ()
        shape, found = (*pages, *shape, *bands), image.shape
        rows = image.reshape(image.size // (bands or (1,))[0], -1)
        n_colors = max(len(np.unique(rows[np.isfinite(rows).all(axis=1)], axis=0)), 1)
    else:
        with Image.open(out) as opened:
            found = opened.size[::-1]
            n_colors = len(opened.convert("RGBA").getcolors(1 << 24) or ())
    right = found == shape and 1 <= n_colors <= 4
    return "right" if right else f"wrong result: {found} and not {shape}, {n_colors} colors"


def outcome(arguments: list[str]) -> tuple[str, list[dict[str, Any]]]:
    """Run the command line here, and tell how it ended."""
    from cvtimg.cli import app as cli

    out, err = io.StringIO(), io.StringIO()
    try:
        with redirect_stdout(out), redirect_stderr(err):
            status = cli.main(arguments)
    except BaseException as error:
        return f"raised {error!r}", []
    text = err.getvalue()
    if status == 1 and re.fullmatch(r"cvtimg: [^\n]{1,400}\n", text) and "unexpected" not in text:
        # Errors without a sentence are Python's own: somebody forgot to say what is wrong with the file.
        if re.search(r": (Key|Type|Index|Attribute|Assertion|Runtime|ZeroDivision|System)Error", text):
            return f"unworded error: {text.strip()}", []
        return "error", []
    if status == 0 and not text:
        rows = [json.loads(line) for line in out.getvalue().splitlines()]
        return ("right", rows) if len(rows) == 1 else (f"{len(rows)} rows", [])
    return f"status {status}, stderr {text[:200]!r}", []
