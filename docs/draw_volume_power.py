"""Draw what the power of the volume does to a palette: ``python docs/draw_volume_power.py``."""

from pathlib import Path

import cvtimg
from cvtimg.plotting.sheets import Panel, contact_sheet

ROOT = Path(__file__).parent.parent
N_GENERATORS = 8


def main() -> None:
    """Write docs/volume_power.png."""
    rows = [panels(ROOT / "sample_images" / name) for name in ("coffee.png", "europe_night.png")]
    sheet = cvtimg.quantize(contact_sheet(rows, panel_width=260), 256)
    cvtimg.write_image(ROOT / "docs" / "volume_power.png", sheet.indices, palette=sheet.palette, overwrite=True)


def panels(path: Path) -> list[Panel]:
    """Draw a picture, and the generators of its cells at three powers."""
    image = cvtimg.read_image(path)
    samples = cvtimg.colors.color_samples(image)
    return [Panel(image, ("original", f"{samples.n_colors:,} colors")), *(panel(samples, power) for power in (0, 1, 2))]


def panel(samples: cvtimg.colors.ColorSamples, power: int) -> Panel:
    """Give each pixel the generator of its cell; below, the palette by the share of the pixels, dark to light."""
    result = cvtimg.tessellate(samples, N_GENERATORS, volume_power=power, method="transfer")
    palette = result.generators.round().astype(samples.colors.dtype)
    order = result.generators.sum(axis=1).argsort()
    n_pixels = samples.inverse.size
    shares = result.masses / n_pixels
    caption = (
        f"p = {power}: largest cell {shares.max():.0%}, smallest {shares.min():.2%}",
        f"plain energy {result.energy / n_pixels:.4g} a pixel",
        f"weighted energy {result.weighted_energy / n_pixels:.4g} a pixel",
    )
    return Panel(palette[result.labels[samples.inverse]], caption, palette[order], shares[order])


if __name__ == "__main__":
    main()
