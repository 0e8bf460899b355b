"""Thirty drawings of the kinds that the web has: three of each kind, from logos on nothing to grain of some percent."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter, ImageFont

#: Drawn so many times as large, and then made smaller, for soft edges.
FINE = 4
WIDTH, HEIGHT = 360, 240
WORDS = ("Acme Labs", "Hello, world", "Total 1,284.50")


def drawings() -> Iterator[tuple[str, NDArray[np.uint8]]]:
    """Yield the name and the RGB or RGBA pixels of each."""
    for number in range(3):
        rng = np.random.default_rng(number)
        y, x = np.mgrid[-1 : 1 : HEIGHT * 1j, -1 : 1 : WIDTH * 1j]
        tint = rng.integers(0, 200, 3)
        for ground, name in (((255, 255, 255, 0), "logo"), ((255, 255, 255, 255), "wordmark")):
            yield f"{name}{number}", lettered(WORDS[number], ground, tuple(tint), 36 + 8 * number, n_discs=2)
        yield (
            f"text{number}",
            lettered("\n".join(WORDS * 4), (250, 250, 248, 255), (30, 30, 36), 14 + number, n_discs=0),
        )
        tiles = rng.integers(0, 4, (HEIGHT // 8, WIDTH // 8)) * rng.integers(0, 2, (HEIGHT // 8, WIDTH // 8))
        yield f"pixels{number}", np.kron(rng.integers(0, 256, (4, 3), np.uint8)[tiles], np.ones((8, 8, 1), np.uint8))
        screen = Image.fromarray(lettered(WORDS[number], (244, 245, 247, 255), (20, 22, 30), 20, n_discs=3))
        ImageDraw.Draw(screen).rounded_rectangle(
            (200, 120, 340, 220), 12, fill=(*tint.tolist(), 255), outline=(0, 0, 0, 255)
        )
        yield f"screenshot{number}", np.asarray(screen)
        near = np.hypot(x, y * (1 + number / 2))
        faint = np.exp(-3 * near**2) * (40 + 40 * number)
        yield f"shadow{number}", with_alpha(np.broadcast_to(tint // 4, (HEIGHT, WIDTH, 3)), faint)
        yield (
            f"glass{number}",
            with_alpha(np.dstack([200 + 50 * x, 220 + 30 * y, 255 - 20 * x]), 90 + 60 * x + faint / 4),
        )
        noise = rng.integers(0, 40, (HEIGHT, WIDTH, 3))
        yield f"grain{number}", with_alpha(noise, rng.integers(0, 10 + 5 * number, (HEIGHT, WIDTH)))
        yield f"gradient{number}", np.rint(np.dstack([90 + 80 * x, 140 + 60 * y, 180 + 40 * x * y])).astype(np.uint8)
        card = Image.new("L", (WIDTH, HEIGHT))
        ImageDraw.Draw(card).rounded_rectangle((60, 50, 300, 190), 16, fill=120)
        dark = np.asarray(card.filter(ImageFilter.GaussianBlur(8 + 4 * number)))[..., None] / 255
        pixels = np.rint(np.array([242, 243, 247]) * (1 - dark) + tint / 3 * dark).astype(np.uint8)
        pixels[44:184, 56:304] = 255
        pixels[60:100, 80:200] = tint
        yield f"card{number}", pixels


def with_alpha(colors: NDArray[np.generic], alpha: NDArray[np.generic]) -> NDArray[np.uint8]:
    """Return RGBA pixels of colors and alpha in 0..255."""
    return np.clip(np.rint(np.dstack([colors, alpha])), 0, 255).astype(np.uint8)


def lettered(text: str, ground: tuple[int, ...], ink: tuple[int, ...], size: int, n_discs: int) -> NDArray[np.uint8]:
    """Return RGBA pixels of text and discs on a ground."""
    image = Image.new("RGBA", (FINE * WIDTH, FINE * HEIGHT), ground)
    draw = ImageDraw.Draw(image)
    draw.text((40, 40), text, font=ImageFont.load_default(FINE * size), fill=(*map(int, ink), 255))
    for disc in range(n_discs):
        left = FINE * (40 + 90 * disc)
        draw.ellipse((left, 560, left + 240, 800), fill=(230, 80 + 60 * disc, 20 + 90 * disc, 255))
    return np.asarray(image.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS))
