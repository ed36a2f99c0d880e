"""Views of linear radiance on a screen: the sRGB curve, ACES, or a view of an OpenColorIO configuration."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, TypeAlias

import numpy as np

from framearray_cli.base.arrays import Float32, Image
from framearray_cli.base.colour import srgb_from_linear
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown

Encode: TypeAlias = Callable[[Image], Float32]

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
    encode: Encode

    @property
    def is_srgb(self) -> bool:
        """True for the bare sRGB curve."""
        return self.name == "srgb"


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


def _config(place: str) -> Any:
    """Open a configuration."""
    import PyOpenColorIO as ocio

    try:
        return ocio.Config.CreateFromFile(place)
    except (ocio.Exception, ocio.ExceptionMissingFile) as error:
        raise JobError("--view", [f"$OCIO: {place}: cannot be read: {_first_line(error)}"]) from error


@cache  # OpenColorIO keeps what it reads and computes with its processor
def _ocio_view(name: str, place: str, display: str, view: str) -> View:
    """Make a view; its transform may name files that are missing."""
    import PyOpenColorIO as ocio

    config = _config(place)
    found = [space.getName() for space in map(config.getColorSpace, LINEAR_REC709) if space]
    if not found:
        raise JobError("--view", [f'{place}: no colour space "{LINEAR_REC709[0]}"; expected one, as images have that'])
    try:
        processor = config.getProcessor(ocio.DisplayViewTransform(found[0], display, view))
        through = processor.getDefaultCPUProcessor()
    except (ocio.Exception, ocio.ExceptionMissingFile) as error:
        raise JobError("--view", [f"{place}: {display}/{view}: {_first_line(error)}"]) from error
    return View(name, partial(_encode, through))


def _encode(through: Any, image: Image) -> Float32:
    """Apply a transform; the result has the shape of the image, and is clipped to 0 to 1."""
    values = np.array(image, np.float32, order="C")
    through.applyRGB(values)
    return np.clip(values, 0, 1, out=values)


def _first_line(error: Exception) -> str:
    return str(error).strip().splitlines()[0]
