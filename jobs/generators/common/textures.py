"""Textures of the project's own scenes: small seamless pictures made of filtered noise and simple patterns.

Colours are linear and become sRGB at the end, which glTF requires of base colour textures.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Array = NDArray[np.float64]
Colour = Sequence[float]


def encode(linear: Array) -> Image.Image:
    """An sRGB picture of linear colours (height, width, 3), row 0 at the top."""
    x = np.clip(linear, 0.0, 1.0)
    encoded = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return Image.fromarray(np.round(encoded * 255).astype(np.uint8))


def noise(height: int, width: int, seed: int, stretch: tuple[float, float] = (1.0, 1.0), slope: float = 1.2) -> Array:
    """Seamless noise of mean 0 and variance 1; `stretch` > 1 stretches it down or across."""
    white = np.random.default_rng(seed).standard_normal((height, width))
    fy = np.fft.fftfreq(height)[:, None] * stretch[0]
    fx = np.fft.fftfreq(width)[None, :] * stretch[1]
    radius = np.sqrt(fx**2 + fy**2 + (2.0 / max(height, width)) ** 2)
    smooth = np.fft.ifft2(np.fft.fft2(white) / radius**slope).real
    return np.asarray((smooth - smooth.mean()) / smooth.std())


def mix(a: Colour, b: Colour, t: Array) -> Array:
    """Colours (height, width, 3) between a, where t is 0, and b, where t is 1."""
    t = np.clip(t, 0.0, 1.0)[..., None]
    return np.asarray(np.asarray(a, dtype=float) * (1 - t) + np.asarray(b, dtype=float) * t)


def wood(light: Colour, dark: Colour, seed: int, size: int = 512, planks: int = 4) -> Image.Image:
    """Boards that run across the picture, each with its own grain and tone, dark joints between them."""
    rng = np.random.default_rng(seed)
    rows = np.arange(size) * planks // size
    grain = noise(size, size, seed + 1, (1.0, 14.0), 0.9)
    waves = noise(size, size, seed + 2, (1.0, 5.0), 1.8)
    rings = 0.5 + 0.5 * np.sin(waves * 6.0 + grain * 0.7)
    tone = rng.uniform(-0.22, 0.22, planks)[rows][:, None]
    for plank in range(planks):  # another piece of the grain on each board
        rings[rows == plank] = np.roll(rings[rows == plank], int(rng.integers(size)), axis=1)
    colour = mix(light, dark, 0.38 + 0.32 * (rings - 0.5) + 0.10 * grain + tone)
    if planks > 1:
        edge = (np.arange(size) * planks % size) < 2 * planks
        colour[edge] *= 0.45
        for plank in range(planks):  # one butt joint per board
            at = int(rng.integers(size - 2))
            colour[rows == plank, at : at + 2] *= 0.5
    return encode(colour)


def tiles(
    colours: Sequence[Colour],
    grout: Colour,
    seed: int,
    size: int = 512,
    count: int = 4,
    joint: float = 0.03,
    spread: float = 0.08,
) -> Image.Image:
    """count x count square tiles, their colours alternating along the diagonals, each a little different."""
    rng = np.random.default_rng(seed)
    at = (np.arange(size) + 0.5) * count / size
    cell = at.astype(int)
    table = np.array([[colours[(i + j) % len(colours)] for j in range(count)] for i in range(count)])
    table = table * (1 + spread * rng.standard_normal((count, count, 1)))
    colour = table[cell[:, None], cell[None, :]]
    colour = colour * (1 + 0.05 * noise(size, size, seed + 1, slope=1.1))[..., None]
    inside = np.minimum(at % 1, 1 - at % 1)
    gap = np.minimum(inside[:, None], inside[None, :])
    return encode(np.where((gap < joint / 2)[..., None], np.asarray(grout, dtype=float), colour))


def marble(light: Colour, vein: Colour, seed: int, size: int = 512, checks: Colour | None = None) -> Image.Image:
    """Veined stone; with `checks`, a 2 x 2 checkerboard with that second colour."""
    t = np.abs(noise(size, size, seed, slope=1.7) + 0.25 * noise(size, size, seed + 1))
    veins = np.exp(-9.0 * t) * 0.8 + 0.10 * noise(size, size, seed + 2, slope=1.4)
    colour = mix(light, vein, veins)
    if checks is not None:
        half = np.arange(size) < size // 2
        other = half[:, None] ^ half[None, :]
        colour = np.where(other[..., None], mix(checks, light, 0.35 * np.roll(veins, size // 3, axis=0)), colour)
        line = (np.arange(size) % (size // 2)) < 2
        colour[line] *= 0.6
        colour[:, line] *= 0.6
    return encode(colour)


def cloth(colour: Colour, seed: int, size: int = 256, threads: int = 64, depth: float = 0.35) -> Image.Image:
    """A plain weave."""
    x = np.arange(size) * threads / size
    over = (x[:, None].astype(int) + x[None, :].astype(int)) % 2 == 0
    across, along = np.abs(np.sin(np.pi * x))[:, None], np.abs(np.sin(np.pi * x))[None, :]
    weave = np.where(over, across, along) ** 0.7
    tone = 1 - depth * (1 - weave) + 0.06 * noise(size, size, seed)
    return encode(np.asarray(colour, dtype=float) * tone[..., None])


def pile(colours: Sequence[Colour], seed: int, size: int = 256) -> Image.Image:
    """Carpet pile: the first colour with soft speckles of the others."""
    tone = 1 + 0.16 * noise(size, size, seed, slope=0.35)
    colour = np.broadcast_to(np.asarray(colours[0], dtype=float), (size, size, 3)).copy()
    for i, other in enumerate(colours[1:]):
        speck = noise(size, size, seed + 1 + i, slope=0.8)
        colour = colour * (speck < 1.25)[..., None] + np.asarray(other, dtype=float) * (speck >= 1.25)[..., None]
    return encode(colour * tone[..., None])


def lozenges(ground: Colour, figure: Colour, border: Colour, seed: int, size: int = 512) -> Image.Image:
    """A woven runner, one repeat: lozenges and dots on a ground, bands along the left and right edges."""
    x = (np.arange(size) + 0.5) / size * 2 - 1
    u, v = x[None, :], x[:, None]
    colour = np.broadcast_to(np.asarray(ground, dtype=float), (size, size, 3)).copy()

    def paint(where: Array, with_colour: Colour) -> None:
        colour[np.broadcast_to(where, (size, size))] = with_colour

    lozenge = np.abs(u) / 0.52 + np.abs(v)
    paint((lozenge > 0.80) & (lozenge < 0.92), figure)
    paint((lozenge > 0.52) & (lozenge < 0.57), figure)
    paint(lozenge < 0.24, figure)
    paint(lozenge < 0.12, border)
    for cu, cv in ((-0.55, -1.0), (0.55, -1.0), (-0.55, 1.0), (0.55, 1.0)):
        paint((u - cu) ** 2 * 1.6 + (v - cv) ** 2 * 0.6 < 0.018, figure)
    paint(np.abs(u) > 0.76, border)
    paint((np.abs(u) > 0.80) & (np.abs(u) < 0.83), figure)
    paint((np.abs(u) > 0.94) & (np.abs(u) < 0.965), figure)
    beads = (np.abs(np.abs(u) - 0.885) < 0.022) & (np.abs((v * 6) % 1 - 0.5) < 0.22)
    paint(beads, figure)
    tone = 1 + 0.12 * noise(size, size, seed, slope=0.4)
    return encode(colour * tone[..., None])


def leaves(colours: Sequence[Colour], seed: int, size: int = 512) -> Image.Image:
    """Soft blotches of several colours: plaster, hedges, a distant lawn."""
    colour = np.broadcast_to(np.asarray(colours[0], dtype=float), (size, size, 3)).copy()
    for i, other in enumerate(colours[1:]):
        t = 0.5 + 0.8 * noise(size, size, seed + i, slope=1.0)
        colour = (
            colour * (1 - np.clip(t, 0, 1))[..., None] + np.asarray(other, dtype=float) * np.clip(t, 0, 1)[..., None]
        )
    return encode(colour)


def landscape(seed: int, sky: Colour, hills: Sequence[Colour], size: int = 256) -> Image.Image:
    """A painted view for a picture frame: sky above hills, farthest first."""
    y = (np.arange(size) + 0.5)[:, None] / size
    colour = mix(np.asarray(sky) * 0.75, np.asarray(sky) * 1.15, np.repeat(y * 1.4, size, axis=1))
    colour *= (1 + 0.06 * noise(size, size, seed, (1.0, 4.0)))[..., None]
    for i, hill in enumerate(hills):
        line = 0.42 + 0.14 * i + 0.05 * noise(4, size, seed + 10 + i, (1.0, 2.0), 2.0)[0][None, :]
        brush = 1 + 0.16 * noise(size, size, seed + 20 + i, (1.0, 3.0), 0.8)
        colour = np.where((y > line)[..., None], np.asarray(hill, dtype=float) * brush[..., None], colour)
    return encode(colour)
