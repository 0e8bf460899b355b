"""The physical size of pixels, as ImageJ and OME say it, or as it is typed."""

import math
import re
from dataclasses import dataclass
from typing import Any, Self

from cvtimg._shared.choices import Arguments, Options

_MICROMETER = "um"
#: Other ways to write units.
_UNITS = dict.fromkeys(("\u00b5m", "\u03bcm", "\\u00B5m", "micron", "microns", "micrometer"), _MICROMETER)
_UNITS |= {"nanometer": "nm", "millimeter": "mm", "centimeter": "cm", "meter": "m"}
#: Units of length, in inches.
INCHES = {"nm": 1 / 25.4e6, "um": 1 / 25400, "mm": 1 / 25.4, "cm": 1 / 2.54, "m": 1 / 0.0254, "inch": 1.0}
_NUMBER = r"(\d+\.?\d*(?:e[-+]?\d+)?|\.\d+)"
_SIZE = re.compile(rf"{_NUMBER}(?:x{_NUMBER}(?:x{_NUMBER})?)?\s*([^\W\d_]+)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class PixelSize:
    """The physical size of a pixel.

    Attributes
    ----------
    x, y : float
        Width and height, > 0.
    unit : str
        Such as ``"um"`` or ``"nm"``.
    z : float or None
        Distance between the planes of a stack.
    """

    x: float
    y: float
    unit: str = _MICROMETER
    z: float | None = None

    def __str__(self) -> str:
        sides = [self.x] if self.x == self.y and self.z is None else [self.x, self.y]
        return f"{' x '.join(f'{side:.6g}' for side in filter(None, [*sides, self.z]))} {self.unit}"

    @property
    def dpi(self) -> tuple[float, float] | None:
        """Pixels per inch across and down, if the unit is one of length."""
        per_inch = [1 / (side * INCHES.get(self.unit, math.inf)) for side in (self.x, self.y)]
        return (per_inch[0], per_inch[1]) if all(0 < number < 1e6 for number in per_inch) else None

    def pixels(self, length: Self) -> float:
        """Return how many pixels a length is across.

        Examples
        --------
        >>> PixelSize(250, 250, "nm").pixels(PixelSize.parse("0.5um"))
        2.0
        """
        if length.unit == self.unit:
            return length.x / self.x
        if not {length.unit, self.unit} <= {*INCHES}:
            raise ValueError(f"has pixels in {self.unit}, which cannot be compared with {length.unit}")
        return round(length.x * INCHES[length.unit] / (self.x * INCHES[self.unit]), 9)

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read "0.325um" for square pixels, "0.3x0.4um", or "0.3x0.3x2um" with the distance between planes.

        Examples
        --------
        >>> PixelSize.parse("0.325um")
        PixelSize(x=0.325, y=0.325, unit='um', z=None)
        """
        match = _SIZE.fullmatch(str(text).strip())
        sides = [float(side) for side in match.groups()[:3] if side] if match else []
        if not match or not all(0 < side < math.inf for side in sides):
            raise ValueError(f"{str(text)!r} must be a size > 0 and a unit, such as 0.325um or 0.3x0.3x2um")
        x, y, z = (sides * 2 if len(sides) == 1 else sides) + [None] * (3 - max(len(sides), 2))
        return cls(float(x or 0), float(y or 0), _UNITS.get(match[4], match[4]), z)

    @classmethod
    def of(cls, scale: Options) -> Self | None:
        """Return the size in what a file says, under the names of `Pages.scale`; None if it names no unit."""
        if "PhysicalSizeX" in scale:
            named = [f"PhysicalSize{axis}" for axis in "XYZ"]
            x, y, z = (_positive(scale.get(name, scale[named[0]] if name != named[2] else None)) for name in named)
            said = {name: str(scale.get(f"{name}Unit", _MICROMETER)) for name in named if name in scale}
            unit, *others = (_UNITS.get(text, text) for text in (said.get(name, said[named[0]]) for name in named))
            if any(other != unit for other in others):
                if not {unit, *others} <= {*INCHES}:
                    return None
                times = (INCHES[other] / INCHES[unit] for other in others)
                y, z = (side and float(f"{side * factor:.9g}") for side, factor in zip((y, z), times, strict=True))
        else:
            across, down = (_positive(value) for value in scale.get("resolution", (None, None)))
            x, y, z = across and 1 / across, down and 1 / down, _positive(scale.get("spacing"))
            unit = str(scale.get("unit", ""))
        return cls.named(x, y, unit, z)

    @classmethod
    def named(cls, x: float | None, y: float | None, unit: str, z: float | None = None) -> Self | None:
        """Return the size by the usual name of its unit; None without one."""
        unit = _UNITS.get(unit, unit)
        return cls(x, y, unit, z) if x and y and unit not in ("", "pixel", "pixels") else None

    def scale(self, kind: str = "imagej") -> Arguments:
        """Return the size under the names of `Pages.scale`, in the convention of ImageJ or of OME."""
        if kind == "ome":
            unit = "\u00b5m" if self.unit == _MICROMETER else self.unit
            sides = {"X": self.x, "Y": self.y} | ({"Z": self.z} if self.z else {})
            sizes = {f"PhysicalSize{axis}": side for axis, side in sides.items()}
            return sizes | {f"PhysicalSize{axis}Unit": unit for axis in sides}
        spacing = {"spacing": self.z} if self.z else {}
        return {"resolution": (1 / self.x, 1 / self.y), "resolutionunit": 1, "unit": self.unit, **spacing}


def _positive(value: Any) -> float | None:
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if 0 < number < math.inf else None
