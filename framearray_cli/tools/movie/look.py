"""Turn radiance into codes of 8 or 16 bits: exposure, view, label."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.array.mixtures import Mixture, position_text
from framearray_cli.array.moments import moment_at, moment_text
from framearray_cli.array.places import nearest_index
from framearray_cli.base.arrays import Image
from framearray_cli.base.colour import srgb8_from_linear

from ..display import SRGB, View
from .label import burn
from .timeline import Shot


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """How radiance is shown.

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
        parts = {"exposure": bool(self.exposure), "view": not self.view.is_srgb, "label": self.label}
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
    if bits == 8 and look.view.is_srgb:
        codes: NDArray[Any] = srgb8_from_linear(exposed)
    else:
        most, dtype = (255, np.uint8) if bits == 8 else (65535, np.uint16)
        codes = np.rint(look.view.encode(exposed).astype(np.float64) * most).astype(dtype)
    return burn(codes, text) if look.label else codes


def shot_label(manifest: Manifest, shot: Shot) -> str:
    """Word what a frame shows: "c 12  l 3", or "c 12  light 3.25  lamps 1" if there are several light axes.

    Under a sun date and time follow: those of the nearest position where two blend.
    """
    axes = list(manifest.axes)
    names = ["l"] if axes == [MAIN_AXIS] else axes
    places = [f"{name} {position_text(position)}" for name, position in zip(names, shot.positions, strict=True)]
    for axis, position in zip(axes, shot.positions, strict=True):
        moment = None if isinstance(position, Mixture) else moment_at(manifest, axis, nearest_index(position))
        places += [moment_text(moment)] if moment else []
    return "  ".join([f"c {shot.c}", *places])
