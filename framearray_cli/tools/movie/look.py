"""Radiance as codes of 8 or 16 bits: exposure, view, label; and warnings of movies that would be useless."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from string import Formatter
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import FOR_SCREENS, format_name
from framearray_cli.array.manifest import MAIN_AXIS, Manifest, moment_at, sun_angles
from framearray_cli.array.mixtures import Mixture, position_text
from framearray_cli.array.pictures import Pictures
from framearray_cli.array.places import nearest_index
from framearray_cli.base.arrays import Image
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.sundays import moment_text
from framearray_cli.base.views import SRGB, View

from ..drawing import burn
from .timeline import Shot, Timeline

FRAMES = 5  # examined, from the first to the last
# Shares of the pixels from which on a frame is lost; a small thing before a black or white background is not.
ALL_WHITE, ALL_BLACK = 0.95, 0.999
WHITE, BLACK = 255, 3  # codes
FORMATS = {"date": "%Y-%m-%d", "time": "%H:%M", "azimuth": ".0f", "elevation": ".0f"}  # defaults


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """Exposure, view and label of pictures.

    Attributes:
        exposure: stops added.
        view: from radiance to a screen.
        label: whether each picture names its place in the array.
        text: template of the label, see `shot_text`; empty: `shot_label`.
        size: width and height of a still, pixels; None: as in the array.
    """

    exposure: float = 0.0
    view: View = SRGB
    label: bool = False
    text: str = ""
    size: tuple[int, int] | None = None

    @property
    def changes(self) -> list[str]:
        """The options that change pictures."""
        parts = {"exposure": bool(self.exposure), "view": self.view != SRGB, "label": self.label}
        return [name for name, changed in parts.items() if changed]


def screen_codes(image: Image, look: Look, text: str, bits: Literal[8, 16] = 8) -> NDArray[Any]:
    """Compute the codes of a picture for a screen.

    Args:
        image: (h, w, 3), linear radiance.
        text: of the label, if the look has one.

    Returns:
        (h, w, 3) uint8 or uint16.
    """
    exposed = image * np.float32(2.0**look.exposure) if look.exposure else image
    codes: NDArray[Any]
    if bits == 8:
        codes = look.view.codes(exposed)
    else:
        codes = np.rint(look.view.encode(exposed).astype(np.float64) * 65535).astype(np.uint16)
    return burn(codes, text) if look.label else codes


def shot_label(manifest: Manifest, shot: Shot) -> str:
    """Word what a frame shows: "c 12  l 3", or "c 12  light 3.25  lamps 1" if there are several light axes.

    Under a sun date and time follow: of the nearest position if two blend.
    """
    axes = list(manifest.axes)
    names = ["l"] if axes == [MAIN_AXIS] else axes
    places = [f"{name} {position_text(position)}" for name, position in zip(names, shot.positions, strict=True)]
    for axis, position in zip(axes, shot.positions, strict=True):
        moment = None if isinstance(position, Mixture) else moment_at(manifest, axis, nearest_index(position))
        places += [moment_text(moment)] if moment else []
    return "  ".join([f"c {shot.c}", *places])


def shot_text(manifest: Manifest, shot: Shot, template: str) -> str:
    """Fill in a label: "{name}, {date:%d.%m.%Y}, sun {elevation:.1f} degrees"; empty: as `shot_label`.

    Raises:
        JobError: the array lacks a field, or its format is none; the message lists all fields of the array.
    """
    if not template:
        return shot_label(manifest, shot)
    names = {"name": manifest.name, "camera": shot.c, "light": position_text(shot.positions[0])}
    fields: dict[str, Any] = names | dict(zip(manifest.axes, map(position_text, shot.positions), strict=True))
    for axis, position in zip(manifest.axes, shot.positions, strict=True):
        l = None if isinstance(position, Mixture) else nearest_index(position)
        if l is not None and "date" not in fields and (moment := moment_at(manifest, axis, l)):
            fields |= {"date": moment, "time": moment}
        if l is not None and "azimuth" not in fields and (angles := sun_angles(manifest, axis, l)):
            fields |= dict(zip(("azimuth", "elevation"), angles, strict=True))
    text = ""
    try:
        for plain, name, layout, conversion in Formatter().parse(template):
            if name is not None and (name not in fields or conversion):
                raise ValueError(f"no field {shown(name)} here")
            text += plain + ("" if name is None else format(fields[name], layout or FORMATS.get(name, "")))
    except ValueError as error:
        known = ", ".join(f"{{{name}}}" for name in fields)
        raise JobError("--text", [f"expected text with the fields {known}, got {shown(template)}: {error}"]) from None
    return text


def look_warnings(manifest: Manifest, look: Look) -> Iterator[str]:
    """Find a view of pictures that are encoded for a screen already."""
    kind = format_name(manifest.images)
    if look.view != SRGB and kind in FOR_SCREENS:
        yield (
            f"{manifest.directory}: its images are {kind.upper()}, clipped at 1 already, and --view {look.view.name} "
            "darkens what was white; render EXR for views"
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
