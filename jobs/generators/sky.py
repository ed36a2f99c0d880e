"""sky.exr: a panorama of a clear sky with a sun, from formulas.

Needs numpy and OpenImageIO. The sun stands in the middle column, 35 degrees up: the turn of the map is its azimuth.
"""

from pathlib import Path

import numpy as np
import OpenImageIO

HEIGHT = 512  # pixels; twice as wide
ELEVATION_DEG = 35.0
SUN_DEG = 2.0  # diameter: that of the real sun, 0.53 degrees, is beyond what halves can hold
SUN_IRRADIANCE = (24.0, 21.5, 18.0)  # W/m2, of a surface that faces it
ZENITH, HORIZON = (0.20, 0.36, 0.72), (0.90, 0.95, 1.00)  # W/(m2 sr)
GROUND = (0.45, 0.55, 0.28)  # a meadow in the sun
HAZE = (1.6, 1.4, 1.1)  # around the sun


def panorama(height: int = HEIGHT) -> np.ndarray:
    """Linear radiance (height, 2 height, 3), float32."""
    up = np.pi * (0.5 - (np.arange(height) + 0.5) / height)[:, None]
    around = np.pi * ((np.arange(2 * height) + 0.5) / height - 1)[None]
    sun_up = np.radians(ELEVATION_DEG)
    cosine = np.sin(up) * np.sin(sun_up) + np.cos(up) * np.cos(sun_up) * np.cos(around)
    from_sun = np.degrees(np.arccos(np.clip(cosine, -1, 1)))[..., None]
    high = np.maximum(np.sin(up), 0)[..., None] ** 0.6
    sky = np.array(HORIZON) * (1 - high) + np.array(ZENITH) * high
    sky = sky + np.array(HAZE) * (0.25 * np.exp(-from_sun / 25) + 0.75 * np.exp(-from_sun / 5))
    radiance = np.where((up > 0)[..., None], sky, np.array(GROUND))
    pixel_deg = 180 / height
    share = np.clip((SUN_DEG / 2 - from_sun) / pixel_deg + 0.5, 0, 1)  # of each pixel that the sun covers
    solid_angle = (share * np.cos(up)[..., None]).sum() * np.radians(pixel_deg) ** 2
    return (radiance + share * np.array(SUN_IRRADIANCE) / solid_angle).astype(np.float32)


def write(file: Path) -> None:
    """Write the map as EXR of halves."""
    pixels = panorama()
    spec = OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "half")
    spec.channelnames = ["R", "G", "B"]
    spec.attribute("compression", "zip")
    spec.attribute("DateTime", "2026:01:01 00:00:00")
    output = OpenImageIO.ImageOutput.create(str(file))
    if output is None or not (output.open(str(file), spec) and output.write_image(pixels) and output.close()):
        raise OSError(f"{file}: {OpenImageIO.geterror() if output is None else output.geterror()}")
