"""Feed changed picture files to cvtimg until something other than a picture or an `OSError` comes of one.

By hand, for an hour or so: ``pip install atheris``, then

    python .ci/fuzz.py CORPUS -max_total_time=3600 -max_len=20000

CORPUS is a folder to begin from; the sample pictures, cut to small ones in every format, are put there.
"""

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["cvtimg", "PIL", "tifffile"]):
    import numpy as np
    from PIL import Image

    from cvtimg import quantize, read_image

SAMPLES = Path(__file__).parent.parent / "sample_images"
FORMATS = ("png", "jpg", "gif", "webp", "tif", "bmp", "ppm", "tga", "ico", "jp2", "pcx", "sgi", "dds")
FOLDER = Path(tempfile.mkdtemp())


def seed(corpus: Path) -> None:
    """Write small pictures of all kinds."""
    small = Image.open(SAMPLES / "chelsea.png").convert("RGB").resize((24, 16))
    for number, mode in enumerate(("RGB", "L", "P", "RGBA", "1", "I;16", "CMYK")):
        picture = (
            Image.fromarray(np.asarray(small.convert("L"), np.uint16) * 257) if mode == "I;16" else small.convert(mode)
        )
        for suffix in FORMATS:
            try:
                picture.save(corpus / f"{number}.{suffix}")
            except (OSError, ValueError, KeyError):  # no such mode in this format
                (corpus / f"{number}.{suffix}").unlink(missing_ok=True)


def one(data: bytes) -> None:
    """Read what may be a picture, and give it few colors."""
    path = FOLDER / "a.png"
    path.write_bytes(data)
    try:
        image = read_image(path)
    except OSError as error:
        if "\n" in str(error):
            raise AssertionError(f"more than one line: {error}") from error
        return
    if np.isfinite(image).all() and image.size < 1 << 20:
        quantize(image, 4, effort="fast")


if __name__ == "__main__":
    folder = Path(next((word for word in sys.argv[1:] if not word.startswith("-")), "fuzz-corpus"))
    folder.mkdir(parents=True, exist_ok=True)
    seed(folder)
    atheris.Setup(sys.argv, one)
    atheris.Fuzz()
