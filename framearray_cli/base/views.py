"""Views of linear radiance on a screen: the sRGB curve, tone mappers, ACES, views of OpenColorIO configurations.

"neutral" is Khronos PBR neutral [Khronos24], "agx" is AgX [AgX] as real-time renderers compute it.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from .arrays import Bytes, Float32, Image
from .colour import srgb8_from_linear, srgb_from_linear
from .errors import JobError
from .forms.words import shown

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

F90, COMPRESSED, DESATURATION = 0.04, 0.8 - 0.04, 0.15  # [Khronos24]

# [AgX]: matrices for columns of red, green and blue; the curve is a polynomial of the logarithm, highest power first.
REC709_FROM_REC2020 = ((1.6605, -0.5876, -0.0728), (-0.1246, 1.1329, -0.0083), (-0.0182, -0.1006, 1.1187))
INSET = (
    (0.856627153315983, 0.0951212405381588, 0.0482516061458583),
    (0.137318972929847, 0.761241990602591, 0.101439036467562),
    (0.11189821299995, 0.0767994186031903, 0.811302368396859),
)
INSET_OF_OUTPUT = (
    (0.899796955911611, 0.0871996192028351, 0.013003424885555),
    (0.11142098895748, 0.875575586156966, 0.0130034248855548),
    (0.11142098895748, 0.0871996192028349, 0.801379391839686),
)
LOG2_RANGE = (-12.47393, 4.026069)
CONTRAST = (15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232)
CURVE_SIZE = 4096
BRIGHTEST = 1e4  # AgX shows all brighter light alike; infinite values are no colours


@dataclass(frozen=True, slots=True)
class View:
    """A transform from radiance to a screen.

    Attributes:
        name: as the user gave it.
        show: linear radiance (h, w, 3) -> light of an sRGB screen, of the same shape; or, if `coded`, its values.
        coded: whether the curve of the screen is part of `show`, whose values are then in [0, 1].
    """

    name: str
    show: Callable[[Image], Float32]
    coded: bool = False

    def encode(self, image: Image) -> Float32:
        """Compute values of the screen, in [0, 1]: linear radiance (h, w, 3) -> the same shape."""
        light = self.show(image)
        return light if self.coded else srgb_from_linear(light)

    def codes(self, image: Image) -> Bytes:
        """Compute the codes of 8 bits: linear radiance (h, w, 3) -> the same shape, uint8."""
        light = self.show(image)
        return np.rint(light.astype(np.float64) * 255).astype(np.uint8) if self.coded else srgb8_from_linear(light)


def _neutral(image: Image) -> Float32:
    """Compress highlights towards white without a change of hue [Khronos24]; negative values count as none."""
    colour = np.clip(np.asarray(image, np.float32), 0, BRIGHTEST)
    red, green, blue = (colour[..., k : k + 1] for k in range(3))
    least = np.minimum(np.minimum(red, green), blue)
    offset = np.where(least < 2 * F90, least - least**2 / (4 * F90), np.float32(F90))
    peak = np.maximum(np.maximum(red, green), blue) - offset
    over = np.maximum(peak, COMPRESSED)  # below it nothing is compressed: new is old, and kept is 1
    new = 1 - (1 - COMPRESSED) ** 2 / (over + 1 - 2 * COMPRESSED)
    kept = 1 / (DESATURATION * (over - new) + 1)
    light: Float32 = (colour - offset) * (new / over * kept) + new * (1 - kept)
    return light


def _agx(image: Image) -> Float32:
    """Roll off in logarithms of mixed primaries, so that bright colours fade to white [AgX]."""
    values = np.array(np.minimum(image, BRIGHTEST), np.float32, order="C")
    _agx_processor().applyRGB(values)
    return values


@cache
def _agx_processor() -> Any:
    import PyOpenColorIO as ocio

    def matrix(rows: Any) -> Any:
        square = np.eye(4)
        square[:3, :3] = rows
        return ocio.MatrixTransform(square.ravel().tolist())

    curve = ocio.Lut1DTransform(CURVE_SIZE, False)
    levels = np.polyval(CONTRAST, np.linspace(0, 1, CURVE_SIZE))
    curve.setData(np.repeat(levels, 3).astype(np.float32))
    transforms = [
        matrix(np.linalg.inv(REC709_FROM_REC2020)),
        ocio.RangeTransform(minInValue=0.0, minOutValue=0.0),
        matrix(INSET),
        ocio.AllocationTransform(ocio.ALLOCATION_LG2, list(LOG2_RANGE)),
        curve,  # clips to [0, 1] first
        matrix(np.linalg.inv(INSET_OF_OUTPUT)),
        ocio.ExponentTransform([2.2, 2.2, 2.2, 1.0]),  # clips below 0 first
        matrix(REC709_FROM_REC2020),
    ]
    return ocio.Config.CreateRaw().getProcessor(ocio.GroupTransform(transforms)).getDefaultCPUProcessor()


SRGB = View("srgb", np.asarray)
PLAIN = {view.name: view for view in (SRGB, View("neutral", _neutral), View("agx", _agx))}


def find_view(name: str, where: str = "--view") -> View:
    """Find a view by name: srgb, neutral, agx, aces, or "VIEW" or "DISPLAY/VIEW" of the configuration that $OCIO names.

    Without $OCIO, other names refer to the configuration inside OpenColorIO. The four names always mean the same.

    Args:
        where: the option or file that named it, for messages.

    Raises:
        JobError: there is no such view, or $OCIO names no configuration.
    """
    if name in PLAIN:
        return PLAIN[name]
    if name == "aces":
        return _ocio_view(name, where, ACES_CONFIG, *ACES)
    place = os.environ.get("OCIO") or BUILT_IN
    config = _config(place, where)
    displays = {display: list(config.getViews(display)) for display in config.getDisplays()}
    for display in (config.getDefaultDisplay(), *displays):
        for view in displays.get(display, ()):
            if name in (view, f"{display}/{view}"):
                return _ocio_view(name, where, place, display, view)
    known = [f"{display}/{view}" for display, views in displays.items() for view in views]
    more = f" and {len(known) - MOST_NAMES} more" if len(known) > MOST_NAMES else ""
    names = "; ".join(known[:MOST_NAMES]) + more
    source = f"$OCIO, {place}" if os.environ.get("OCIO") else f"{place}, as $OCIO is not set"
    raise JobError(where, [f"expected {', '.join(PLAIN)}, aces or a view of {source} ({names}), got {shown(name)}"])


@contextmanager
def _ocio(place: str, where: str) -> Iterator[Any]:
    """Import OpenColorIO, and report its errors at a place."""
    import PyOpenColorIO as ocio

    try:
        yield ocio
    except (ocio.Exception, ocio.ExceptionMissingFile) as error:
        raise JobError(where, [f"{place}: {str(error).strip().splitlines()[0]}"]) from error


def _config(place: str, where: str) -> Any:
    with _ocio(f"$OCIO: {place}: cannot be read", where) as ocio:
        return ocio.Config.CreateFromFile(place)


@cache  # OpenColorIO keeps what it reads and computes with its processor
def _ocio_view(name: str, where: str, place: str, display: str, view: str) -> View:
    """Make a view; its transform may name files that are missing."""
    config = _config(place, where)
    found = [space.getName() for space in map(config.getColorSpace, LINEAR_REC709) if space]
    if not found:
        wanted = f'no colour space "{LINEAR_REC709[0]}"; expected one, as images have that'
        raise JobError(where, [f"$OCIO: {place}: {wanted}"])
    with _ocio(f"$OCIO: {place}: {display}/{view}", where) as ocio:
        processor = config.getProcessor(ocio.DisplayViewTransform(found[0], display, view))
        through = processor.getDefaultCPUProcessor()

    def show(image: Image) -> Float32:
        values = np.array(image, np.float32, order="C")
        through.applyRGB(values)
        return np.clip(values, 0, 1, out=values)

    return View(name, show, coded=True)
