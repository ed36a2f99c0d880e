"""Radiance as codes of 8 or 16 bits: exposure, view, label; and warnings of movies that would be useless.

A view shows linear radiance on a screen: by the sRGB curve, ACES, or a view of an OpenColorIO configuration.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import FOR_SCREENS, format_name
from framearray_cli.array.manifest import MAIN_AXIS, Manifest, moment_at
from framearray_cli.array.mixtures import Mixture, position_text
from framearray_cli.array.pictures import Pictures
from framearray_cli.array.places import nearest_index
from framearray_cli.base.arrays import Float32, Image
from framearray_cli.base.colour import srgb8_from_linear, srgb_from_linear
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.sundays import moment_text

from ..drawing import burn
from .timeline import Shot, Timeline

FRAMES = 5  # examined, from the first to the last
# Shares of the pixels from which on a frame is lost; a small thing before a black or white background is not.
ALL_WHITE, ALL_BLACK = 0.95, 0.999
WHITE, BLACK = 255, 3  # codes
BUILT_IN = "ocio://default"  # the configuration inside OpenColorIO
ACES_CONFIG = "ocio://cg-config-v4.0.0_aces-v2.0_ocio-v2.5"  # of ACES 2.0; a later default may name its views otherwise
ACES = ("sRGB - Display", "ACES 2.0 - SDR 100 nits (Rec.709)")
# Names of linear light with Rec. 709 primaries in configurations: OpenColorIO's own, ACES 1.2 and Blender, Filmic.
LINEAR_REC709 = (
    "Linear Rec.709 (sRGB)",
    "lin_rec709",
    "lin_srgb",
    "Utility - Linear - sRGB",
    "Linear Rec.709",
    "Linear",
)
MOST_NAMES = 12  # in a message


@dataclass(frozen=True, slots=True)
class View:
    """A transform from radiance to a screen.

    Attributes:
        name: as the user gave it.
        encode: linear radiance (h, w, 3) -> values of the screen, 0 to 1, of the same shape.
    """

    name: str
    encode: Callable[[Image], Float32]


SRGB = View("srgb", srgb_from_linear)


def find_view(name: str) -> View:
    """Find a view by name: "srgb", "aces", or "VIEW" or "DISPLAY/VIEW" of the configuration that $OCIO names.

    Without $OCIO, names refer to the configuration inside OpenColorIO; "aces" always does.

    Raises:
        JobError: there is no such view, or $OCIO names no configuration.
    """
    if name == "srgb":
        return SRGB
    if name == "aces":
        return _ocio_view(name, ACES_CONFIG, *ACES)
    place = os.environ.get("OCIO") or BUILT_IN
    config = _config(place)
    displays = {display: list(config.getViews(display)) for display in config.getDisplays()}
    for display in (config.getDefaultDisplay(), *displays):
        for view in displays.get(display, ()):
            if name in (view, f"{display}/{view}"):
                return _ocio_view(name, place, display, view)
    known = [f"{display}/{view}" for display, views in displays.items() for view in views]
    more = f" and {len(known) - MOST_NAMES} more" if len(known) > MOST_NAMES else ""
    names = "; ".join(known[:MOST_NAMES]) + more
    raise JobError("--view", [f"expected srgb, aces or a view of {place} ({names}), got {shown(name)}"])


@contextmanager
def _ocio(place: str) -> Iterator[Any]:
    """Import OpenColorIO, and report its errors at a place."""
    import PyOpenColorIO as ocio

    try:
        yield ocio
    except (ocio.Exception, ocio.ExceptionMissingFile) as error:
        raise JobError("--view", [f"{place}: {str(error).strip().splitlines()[0]}"]) from error


def _config(place: str) -> Any:
    with _ocio(f"$OCIO: {place}: cannot be read") as ocio:
        return ocio.Config.CreateFromFile(place)


@cache  # OpenColorIO keeps what it reads and computes with its processor
def _ocio_view(name: str, place: str, display: str, view: str) -> View:
    """Make a view; its transform may name files that are missing."""
    config = _config(place)
    found = [space.getName() for space in map(config.getColorSpace, LINEAR_REC709) if space]
    if not found:
        raise JobError("--view", [f'{place}: no colour space "{LINEAR_REC709[0]}"; expected one, as images have that'])
    with _ocio(f"{place}: {display}/{view}") as ocio:
        processor = config.getProcessor(ocio.DisplayViewTransform(found[0], display, view))
        through = processor.getDefaultCPUProcessor()

    def encode(image: Image) -> Float32:
        values = np.array(image, np.float32, order="C")
        through.applyRGB(values)
        return np.clip(values, 0, 1, out=values)

    return View(name, encode)


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """Exposure, view and label of pictures.

    Attributes:
        exposure: stops added.
        view: from radiance to a screen.
        label: whether each picture names its place in the array.
    """

    exposure: float = 0.0
    view: View = SRGB
    label: bool = False

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
    if bits == 8 and look.view == SRGB:
        codes: NDArray[Any] = srgb8_from_linear(exposed)
    else:
        most, dtype = (255, np.uint8) if bits == 8 else (65535, np.uint16)
        codes = np.rint(look.view.encode(exposed).astype(np.float64) * most).astype(dtype)
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
