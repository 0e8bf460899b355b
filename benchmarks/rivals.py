"""Color quantizers side by side: each takes the pixels of a picture and gives them back in k colors.

The clock of `Rival.cluster` runs from decoded pixels, in whatever container the rival takes, to a palette of 8-bit
colors and the index of one of them for each pixel. Counting distinct colors and mapping pixels are within; imports,
decoding, encoding and the change of container are not. Programs that only come as processes are timed as whole
processes, with the reading and the writing of a file. Nobody dithers.
"""

import functools
import importlib
import importlib.metadata
import shutil
import subprocess
import tempfile
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from common import read_rgb, run_process, timed
from numpy.typing import NDArray
from PIL import Image

Pixels = NDArray[np.uint8]

#: A palette (K, 3) uint8, and the index of a color for each pixel, flat.
Mapped = tuple[NDArray[np.uint8], NDArray[Any]]


class Rival(ABC):
    """A way to bring a picture to k colors."""

    name: ClassVar[str]
    #: "light" runs on every picture, "heavy" on a few, "optional" on a few and only when it is named.
    cost: ClassVar[str] = "light"
    most_colors: ClassVar[int] = 256
    #: The package to import and its name in the registry.
    module: ClassVar[str]
    distribution: ClassVar[str]

    def missing(self) -> str:
        """Say why the rival cannot run, or nothing."""
        try:
            importlib.import_module(self.module)
        except ImportError as error:
            return f"{self.module} cannot be imported ({error})"
        return ""

    @property
    def is_available(self) -> bool:
        """Whether the rival can run; `missing` says why not."""
        return not self.missing()

    def version(self) -> str:
        """Return the name and the version of the software."""
        return f"{self.distribution} {importlib.metadata.version(self.distribution)}"

    def pin(self, n_threads: int) -> None:  # noqa: B027 - most do as OMP_NUM_THREADS says
        """Set the number of threads of a library that takes no notice of the environment."""

    def prepare(self, image: Pixels) -> Any:
        """Put pixels into the container that the rival takes; not timed."""
        return image

    @abstractmethod
    def run(self, native: Any, k: int) -> Any:
        """Do what is timed."""

    def picture(self, result: Any, image: Pixels) -> Pixels:
        """Get pixels of the shape of `image` out of what `run` returned; not timed."""
        palette, indices = result
        return np.asarray(palette[indices].reshape(image.shape), dtype=np.uint8)

    def cluster(self, image: Pixels, k: int) -> tuple[Pixels, float]:
        """Return the picture in at most `k` colors, and the seconds that it took."""
        native = self.prepare(image)
        result, seconds = timed(lambda: self.run(native, k))
        return self.picture(result, image), seconds


class Cvtimg(Rival):
    """cvtimg, at one of its efforts."""

    module = distribution = "cvtimg"
    most_colors = 1 << 16
    effort: ClassVar[str]

    def run(self, native: Pixels, k: int) -> Mapped:
        """Quantize."""
        import cvtimg

        result = cvtimg.quantize(native, k, effort=self.effort)
        return result.palette, result.indices


class CvtimgFast(Cvtimg):
    """The fewest passes."""

    name, effort = "cvtimg fast", "fast"


class CvtimgBalanced(Cvtimg):
    """The default."""

    name, effort = "cvtimg balanced", "balanced"


class CvtimgBest(Cvtimg):
    """The lowest energy."""

    name, effort = "cvtimg best", "best"


class ScikitLearn(Rival):
    """KMeans on the distinct colors, weighted by how many pixels have them."""

    name = "scikit-learn, distinct colors"
    cost = "heavy"
    module, distribution = "sklearn.cluster", "scikit-learn"
    most_colors = 1 << 16
    n_init: ClassVar[int] = 1

    def run(self, native: Pixels, k: int) -> Mapped:
        """Count, fit, round, map."""
        colors, counts, inverse = distinct_colors(native)
        palette = self.fit(colors, counts, k)
        return palette, map_to_palette(colors, palette)[inverse]

    def fit(self, colors: Pixels, counts: NDArray[Any], k: int) -> Pixels:
        """Find the palette of weighted colors."""
        from sklearn.cluster import KMeans

        model = KMeans(min(k, len(colors)), n_init=self.n_init, random_state=0)
        return to_8_bits(model.fit(colors.astype(np.float32), sample_weight=counts).cluster_centers_)


class ScikitLearnTen(ScikitLearn):
    """The best of ten starts."""

    name = "scikit-learn, distinct colors, best of 10"
    cost = "optional"
    n_init = 10


class ScikitLearnPixels(ScikitLearn):
    """KMeans on the pixels: what most tutorials do."""

    name = "scikit-learn, pixels"

    def run(self, native: Pixels, k: int) -> Mapped:
        """Fit, round, map."""
        pixels = native.reshape(-1, 3)
        palette = self.fit(pixels, np.ones(len(pixels)), k)
        return palette, map_to_palette(pixels, palette)


class OpenCV(Rival):
    """Its kmeans on the pixels (it takes no weights), until no center moves by more than one level."""

    name = "OpenCV kmeans, pixels"
    cost = "heavy"
    module, distribution = "cv2", "opencv-python-headless"
    most_colors = 1 << 16

    def pin(self, n_threads: int) -> None:
        """Set the threads of its own pool."""
        importlib.import_module("cv2").setNumThreads(n_threads)

    def version(self) -> str:
        """Ask the package itself: it is published under several names."""
        return f"OpenCV {importlib.import_module('cv2').__version__}"

    def run(self, native: Pixels, k: int) -> Mapped:
        """Fit, round, map."""
        cv2 = importlib.import_module("cv2")
        pixels = native.reshape(-1, 3)
        cv2.setRNGSeed(0)
        rule = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 1.0)
        _, _, centers = cv2.kmeans(pixels.astype(np.float32), k, None, rule, 1, cv2.KMEANS_PP_CENTERS)
        palette = to_8_bits(centers)
        return palette, map_to_palette(pixels, palette)


class Faiss(Rival):
    """Its Kmeans on the weighted distinct colors, all of them, with its own 25 iterations from random colors."""

    name = "faiss Kmeans, distinct colors"
    module, distribution = "faiss", "faiss-cpu"
    most_colors = 1 << 16

    def run(self, native: Pixels, k: int) -> Mapped:
        """Count, train, round, map with its exact index."""
        faiss = importlib.import_module("faiss")
        colors, counts, inverse = distinct_colors(native)
        rows = colors.astype(np.float32)
        model = faiss.Kmeans(3, k, seed=0, min_points_per_centroid=1, max_points_per_centroid=len(rows))
        model.train(rows, weights=counts.astype(np.float32))
        palette = to_8_bits(model.centroids)
        index = faiss.IndexFlatL2(3)
        index.add(palette.astype(np.float32))
        return palette, index.search(rows, 1)[1][:, 0][inverse]


class Imagequant(Rival):
    """libimagequant through its Python binding: best quality, its default speed, no dithering."""

    name = "imagequant"
    module = distribution = "imagequant"

    def prepare(self, image: Pixels) -> tuple[bytes, int, int]:
        """Append an opaque alpha channel."""
        return np.dstack([image, np.full(image.shape[:2], 255, np.uint8)]).tobytes(), image.shape[1], image.shape[0]

    def run(self, native: tuple[bytes, int, int], k: int) -> Any:
        """Quantize and map."""
        imagequant = importlib.import_module("imagequant")
        return imagequant.quantize_raw_rgba_bytes(*native, dithering_level=0.0, max_colors=k, max_quality=100)

    def picture(self, result: Any, image: Pixels) -> Pixels:
        """Drop the alpha channel."""
        indices, palette = result
        colors = np.array(palette, np.uint8).reshape(-1, 4)[:, :3]
        return colors[np.frombuffer(indices, np.uint8)].reshape(image.shape)


class Pillow(Rival):
    """One of the methods of Image.quantize."""

    module, distribution = "PIL", "pillow"
    method: ClassVar[Image.Quantize]
    kmeans: ClassVar[int] = 0

    def prepare(self, image: Pixels) -> Image.Image:
        """Copy into an image."""
        return Image.fromarray(image)

    def run(self, native: Image.Image, k: int) -> Image.Image:
        """Quantize and map."""
        return native.quantize(k, method=self.method, kmeans=self.kmeans, dither=Image.Dither.NONE)

    def picture(self, result: Image.Image, image: Pixels) -> Pixels:
        """Look the palette up."""
        return np.asarray(result.convert("RGB"))


class PillowMedianCut(Pillow):
    """Median cut, the default."""

    name, method = "Pillow median cut", Image.Quantize.MEDIANCUT


class PillowKmeans(Pillow):
    """Median cut, then k-means until no color changes its cell."""

    name, method, kmeans = "Pillow median cut, kmeans=1", Image.Quantize.MEDIANCUT, 1
    cost = "heavy"


class PillowOctree(Pillow):
    """The fast octree."""

    name, method = "Pillow octree", Image.Quantize.FASTOCTREE


class Program(Rival):
    """A program that is timed as a whole process: it reads a file and writes one."""

    #: Names that the program goes by, the preferred first, and what its version text must contain.
    programs: ClassVar[tuple[str, ...]]
    signature: ClassVar[str]
    #: Suffixes of the files it reads and writes.
    suffixes: ClassVar[tuple[str, str]]

    @functools.cached_property
    def program(self) -> str:
        """The path of the program, or nothing."""
        found = (shutil.which(name) for name in self.programs)
        return next((path for path in found if path and self.signature in _first_line(path)), "")

    def missing(self) -> str:
        """Look for the program."""
        return "" if self.program else f"no program {' or '.join(self.programs)} on this machine"

    def version(self) -> str:
        """Return the first words of the program's own version."""
        return _first_line(self.program).removeprefix("Version: ").partition(" https")[0].partition(" (")[0]

    @abstractmethod
    def command(self, before: Path, after: Path, k: int) -> list[str | Path]:
        """Spell the command."""

    def run(self, native: tuple[Path, Path], k: int) -> None:
        """Run the process."""
        failure = run_process(self.command(*native, k)).failure
        if failure:
            raise RuntimeError(f"{self.name}: {failure}")

    def cluster(self, image: Pixels, k: int) -> tuple[Pixels, float]:
        """Return the picture in at most `k` colors, and the seconds of the whole process."""
        with tempfile.TemporaryDirectory() as folder:
            before, after = (Path(folder, stem).with_suffix(end) for stem, end in zip("ab", self.suffixes, strict=True))
            Image.fromarray(image).save(before, compress_level=1)
            _, seconds = timed(lambda: self.run((before, after), k))
            return read_rgb(after), seconds


class Pngquant(Program):
    """pngquant at its default speed, PNG to PNG."""

    name = "pngquant (process)"
    programs, signature, suffixes = ("pngquant",), "", (".png", ".png")

    def version(self) -> str:
        """Name it: it prints the bare number."""
        return f"pngquant {super().version()}"

    def command(self, before: Path, after: Path, k: int) -> list[str | Path]:
        """Spell the command: no dithering."""
        return [self.program, "--nofs", "--force", "--output", after, str(k), "--", before]


class ImageMagick(Program):
    """ImageMagick 6 or 7; PPM to PPM, which costs less than PNG."""

    name = "ImageMagick (process)"
    most_colors = 1 << 16
    #: Plain "convert" is last: it may be another program or a wrapper.
    programs, signature, suffixes = ("magick", "convert-im6", "convert"), "ImageMagick", (".ppm", ".ppm")

    def command(self, before: Path, after: Path, k: int) -> list[str | Path]:
        """Spell the command: no dithering."""
        return [self.program, before, "+dither", "-colors", str(k), after]


RIVALS: tuple[Rival, ...] = (
    CvtimgFast(),
    CvtimgBalanced(),
    CvtimgBest(),
    Imagequant(),
    Faiss(),
    OpenCV(),
    ScikitLearn(),
    ScikitLearnTen(),
    ScikitLearnPixels(),
    PillowMedianCut(),
    PillowKmeans(),
    PillowOctree(),
    Pngquant(),
    ImageMagick(),
)


def distinct_colors(image: Pixels) -> tuple[Pixels, NDArray[np.int64], NDArray[np.int64]]:
    """Count distinct colors as a user of NumPy would who cares for time: on 24-bit integers, not on rows."""
    wide = image.reshape(-1, 3).astype(np.int32)
    keys, inverse, counts = np.unique(
        wide[:, 0] << 16 | wide[:, 1] << 8 | wide[:, 2], return_inverse=True, return_counts=True
    )
    return np.stack([keys >> 16, keys >> 8 & 255, keys & 255], axis=1).astype(np.uint8), counts, inverse


def map_to_palette(colors: Pixels, palette: Pixels) -> NDArray[Any]:
    """Find the nearest color of the palette, for libraries that have no such function; exact in float32."""
    rows, centers = colors.astype(np.float32), palette.astype(np.float32)
    norms = np.einsum("kd,kd->k", centers, centers)
    nearest = np.empty(len(rows), np.uint8 if len(palette) <= 256 else np.uint16)
    for start in range(0, len(rows), 4096):
        block = slice(start, start + 4096)
        nearest[block] = np.argmin(norms - 2 * (rows[block] @ centers.T), axis=1)
    return nearest


def to_8_bits(centers: NDArray[Any]) -> Pixels:
    """Round centers to the depth of a palette."""
    return np.asarray(np.clip(np.rint(centers), 0, 255), dtype=np.uint8)


def _first_line(program: str) -> str:
    """Return the first line of what a program prints for --version, or nothing."""
    try:
        shown = subprocess.run([program, "--version"], capture_output=True, text=True, check=False, timeout=20)
    except OSError:
        return ""
    return (shown.stdout or shown.stderr).partition("\n")[0].strip()
