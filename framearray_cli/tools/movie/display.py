"""How linear radiance looks on a screen: the sRGB curve, ACES, or a view of an OpenColorIO configuration.

The only module that uses OpenColorIO, which comes with OpenImageIO.
"""

import os
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Image
from framearray_cli.base.colour import srgb_from_linear
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown

from .cube import Encode, tabulate

BUILT_IN = "ocio://default"  # the configuration inside OpenColorIO: ACES 2.0
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
        quick: the same, accurate enough for 8 bits.
    """

    name: str
    encode: Encode
    quick: Encode

    @property
    def is_srgb(self) -> bool:
        """Whether this is the bare sRGB curve."""
        return self.name == "srgb"


SRGB = View("srgb", srgb_from_linear, srgb_from_linear)


def find_view(name: str) -> View:
    """Find a view by name: "srgb", "aces", or "VIEW" or "DISPLAY/VIEW" of the configuration that $OCIO names.

    Without $OCIO, names refer to the configuration inside OpenColorIO; "aces" always does.

    Raises:
        JobError: there is no such view, or $OCIO names no configuration.
    """
    if name == "srgb":
        return SRGB
    if name == "aces":
        return _ocio_view(name, BUILT_IN, *ACES)
    place = os.environ.get("OCIO") or BUILT_IN
    config = _config(place)
    for display in (config.getDefaultDisplayName(), *config.getDisplayNames()):
        for view in config.getViewNames(display):
            if name in (view, f"{display}/{view}"):
                return _ocio_view(name, place, display, view)
    known = [f"{display}/{view}" for display in config.getDisplayNames() for view in config.getViewNames(display)]
    more = f" and {len(known) - MOST_NAMES} more" if len(known) > MOST_NAMES else ""
    names = "; ".join(known[:MOST_NAMES]) + more
    raise JobError("--view", [f"expected srgb, aces or a view of {place} ({names}), got {shown(name)}"])


def _config(place: str) -> Any:
    """Open a configuration."""
    import OpenImageIO as oiio

    config = oiio.ColorConfig(place)
    if message := config.geterror():
        raise JobError("--view", [f"$OCIO: {place}: cannot be read: {message.strip().splitlines()[0]}"])
    return config


@cache  # its table takes long to fill
def _ocio_view(name: str, place: str, display: str, view: str) -> View:
    """Make a view, and try it once, as a transform may name files that are missing."""
    config = _config(place)
    spaces = set(config.getColorSpaceNames())
    found = [space for space in (config.resolve(known) for known in LINEAR_REC709) if space in spaces]
    if not found:
        raise JobError("--view", [f'{place}: no colour space "{LINEAR_REC709[0]}"; expected one, as images have that'])
    encode = partial(_through_ocio, place=place, display=display, view=view, space=found[0])
    encode(np.zeros((1, 1, 3), np.float32))
    return View(name, encode, tabulate(encode))


def _through_ocio(image: Image, *, place: str, display: str, view: str, space: str) -> Float32:
    """Apply a display transform; the result has the shape of the image, and is clipped to 0 to 1."""
    import OpenImageIO as oiio

    buffer = oiio.ImageBuf(np.ascontiguousarray(image, np.float32))
    result = oiio.ImageBufAlgo.ociodisplay(buffer, display, view, space, colorconfig=place)
    if result.has_error:
        raise JobError("--view", [f"{place}: {display}/{view}: {result.geterror().strip().splitlines()[0]}"])
    values: Float32 = np.clip(np.asarray(result.get_pixels(oiio.FLOAT), np.float32), 0, 1)
    return values
