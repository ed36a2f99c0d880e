"""Warnings of a movie that would be useless: typing errors of its path, and frames that are all black or white."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from framearray_cli.array.images import FOR_SCREENS, format_name
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.forms.schema import toml_key

from .curves import LightChange, LightCurve
from .look import Look, screen_codes
from .pathfile import MoviePath
from .timeline import Timeline

MOST_COLOUR = 10.0  # factors are from 0 to 1, some a little above; 255 are codes of 8 bits
FRAMES = 5  # looked at, from the first to the last
# Shares of the pixels from which on a frame is lost; a small thing before a black or white background is not.
ALL_WHITE, ALL_BLACK = 0.95, 0.999
WHITE, BLACK = 255, 3  # codes


def look_warnings(manifest: Manifest, look: Look) -> Iterator[str]:
    """Find a view of pictures that hold what a screen showed already."""
    kind = format_name(manifest.images)
    if not look.view.is_srgb and kind in FOR_SCREENS:
        yield (
            f"{manifest.directory}: its images are {kind.upper()}, clipped at 1 already, and --view {look.view.name} "
            "darkens what was white; render EXR for views"
        )


def path_warnings(movie: MoviePath, line: Timeline) -> Iterator[str]:
    """Find values of a path that are typing errors."""
    end = float(len(line.shots) / line.fps)
    changes = {f"groups.{toml_key(name)}": change for name, change in movie.groups.items()}
    for key, change in (changes | ({"ambient": movie.ambient} if movie.ambient else {})).items():
        yield from _colour_warnings(key, change)
        for name, curve in (("intensity", change.intensity), ("color", change.color)):
            yield from _late_warnings(f"{key}.{name}", curve, end)


def _colour_warnings(key: str, change: LightChange) -> Iterator[str]:
    most = max(max(value) for _, value in change.color.keys)
    if most > MOST_COLOUR:
        yield (
            f"{key}.color: a colour of {most:g} multiplies the intensity by as much; expected factors from 0 to 1: "
            "divide 8-bit codes by 255, and convert them from sRGB to linear values"
        )


def _late_warnings(key: str, curve: LightCurve, end: float) -> Iterator[str]:
    late = [(k, time) for k, (time, _) in enumerate(curve.keys) if isinstance(time, float) and time > end]
    if late:
        k, time = late[0]
        yield (
            f"{key}[{k}].time: {time:g} s is after the end of the movie, {end:g} s, which does not show it; times are "
            'seconds, or a percentage of the movie such as "100%"'
        )


def picture_warnings(pictures: Pictures, line: Timeline, look: Look) -> Iterator[str]:
    """Find out whether all frames are black, or all white; a movie may fade out."""
    plain, levels = replace(look, label=False), list[float]()
    white = black = 0
    chosen = sorted({round(float(k)) for k in np.linspace(0, len(line.shots) - 1, FRAMES)})
    for k in chosen:
        shot = line.shots[k]
        image = pictures.picture(shot.c, shot.positions, line.relights[k])
        codes = screen_codes(image, plain, "").max(axis=-1)
        white += bool((codes >= WHITE).mean() > ALL_WHITE)
        black += bool((codes <= BLACK).mean() > ALL_BLACK)
        levels.append(float(np.median(image.max(axis=-1))))
    if white == len(chosen):
        stops = look.exposure - np.log2(max(float(np.median(levels)), 1e-30) / 0.2)
        yield f"all frames are white: their pixels are clipped; --exposure {stops:.1f} shows them, or less intensity"
    if black == len(chosen):
        bright = float(np.median(levels))
        advice = f"; --exposure {look.exposure - np.log2(bright / 0.2):.1f} shows them" if bright > 0 else ""
        yield f"all frames are black{advice}; check what the path does to the light, and the pictures of the array"
