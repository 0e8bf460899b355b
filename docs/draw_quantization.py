"""Draw the picture at the top of the README, in 256 colors of its own: ``python docs/draw_quantization.py``."""

from pathlib import Path

import cvtimg
from cvtimg.plotting.sheets import Panel, contact_sheet

ROOT = Path(__file__).parent.parent


def main() -> None:
    """Write docs/quantization.png."""
    rows = []
    for name in ("coffee.png", "rocket.jpg"):
        image = cvtimg.read_image(ROOT / "sample_images" / name)
        n_distinct = cvtimg.colors.color_samples(image).n_colors
        panels = [Panel(image, ("original", f"{n_distinct:,} colors"))]
        for n_colors in (4, 16, 64, 256):
            result = cvtimg.quantize(image, n_colors)
            panels.append(Panel(result.image, (f"{n_colors} colors", f"{result.psnr:.1f} dB"), result.palette))
        rows.append(panels)
    sheet = cvtimg.quantize(contact_sheet(rows, panel_width=200), 256)
    cvtimg.write_image(ROOT / "docs" / "quantization.png", sheet.indices, palette=sheet.palette, overwrite=True)


if __name__ == "__main__":
    main()
