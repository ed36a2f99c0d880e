"""Projection of a camera: image positions of points, and rays through image positions.

Camera space: x right, y up in the picture; the camera looks along -z. Image positions are in pixels from the upper left
corner, where the first pixel's middle is (0.5, 0.5).

    perspective    x = c_x + f_x X / D,  y = c_y - f_y Y / D    D = -Z, the depth along the axis
    orthographic   x = c_x + f_x X,      y = c_y - f_y Y        the same depth
    panorama       x = w (1/2 + atan2(X, -Z) / (2 pi)),  y = h (1/2 - asin(Y / D) / pi)    D the distance
"""

from dataclasses import dataclass

import numpy as np

from .arrays import Float64, is_number
from .forms.words import shown

PERSPECTIVE, ORTHOGRAPHIC, PANORAMA = "perspective", "orthographic", "panorama"


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """The lens of a camera at one frame.

    Attributes:
        type: PERSPECTIVE, ORTHOGRAPHIC, or PANORAMA, which sees 360 x 180 degrees and has none of the rest.
        fov: vertical field of view of a perspective, degrees.
        height: of what an orthographic camera sees, scene units.
        shift: of the picture to the right and up, as a share of its longer side.
        pixel_aspect: width of a pixel over its height.
    """

    type: str = PERSPECTIVE
    fov: float = 60.0
    height: float = 1.0
    shift: tuple[float, float] = (0.0, 0.0)
    pixel_aspect: float = 1.0

    @property
    def is_plain(self) -> bool:
        """True for a perspective with its axis in the middle of the picture and square pixels."""
        return self.type == PERSPECTIVE and self.shift == (0.0, 0.0) and self.pixel_aspect == 1.0

    def focal(self, resolution: tuple[int, int]) -> tuple[float, float]:
        """(f_x, f_y): pixels per unit of X / D, and of an orthographic camera per scene unit.

        Raises:
            ValueError: a panorama, which has none.
        """
        if self.type == PANORAMA:
            raise ValueError("a panorama has no focal length")
        height = resolution[1]
        down = height / self.height if self.type == ORTHOGRAPHIC else 0.5 * height / np.tan(np.radians(self.fov) / 2)
        return float(down) / self.pixel_aspect, float(down)

    def centre(self, resolution: tuple[int, int]) -> tuple[float, float]:
        """(c_x, c_y): where the axis meets the picture, pixels."""
        width, height = resolution
        longer = max(resolution)
        return width / 2 - self.shift[0] * longer, height / 2 + self.shift[1] * longer

    def project(self, resolution: tuple[int, int], points: Float64) -> tuple[Float64, Float64]:
        """Image positions (n, 2) and depths (n,) of points (n, 3) in camera space; void at depths of 0 or less."""
        x, y, z = np.asarray(points, np.float64).T
        width, height = resolution
        if self.type == PANORAMA:
            level = np.hypot(x, z)
            column = width * (0.5 + np.arctan2(x, -z) / (2 * np.pi))
            row = height * (0.5 - np.arctan2(y, level) / np.pi)
            return np.stack([column % width, row], -1), np.hypot(level, y)
        (f_x, f_y), (c_x, c_y) = self.focal(resolution), self.centre(resolution)
        scale = np.ones_like(z) if self.type == ORTHOGRAPHIC else 1 / np.where(z < 0, -z, 1.0)
        return np.stack([c_x + f_x * x * scale, c_y - f_y * y * scale], -1), -z

    def rays(self, resolution: tuple[int, int], position: Float64) -> tuple[Float64, Float64]:
        """Origins and directions (n, 3) of the rays through image positions (n, 2), in camera space.

        The point at depth D is origin + D direction.
        """
        x, y = np.asarray(position, np.float64).T
        nothing, one = np.zeros_like(x), np.ones_like(x)
        if self.type == PANORAMA:
            around, up = 2 * np.pi * (x / resolution[0] - 0.5), np.pi * (0.5 - y / resolution[1])
            level = np.cos(up)
            return np.zeros((len(x), 3)), np.stack([level * np.sin(around), np.sin(up), -level * np.cos(around)], -1)
        (f_x, f_y), (c_x, c_y) = self.focal(resolution), self.centre(resolution)
        a, b = (x - c_x) / f_x, (c_y - y) / f_y
        if self.type == ORTHOGRAPHIC:
            return np.stack([a, b, nothing], -1), np.stack([nothing, nothing, -one], -1)
        return np.zeros((len(x), 3)), np.stack([a, b, -one], -1)


def lens_problem(kind: object, fov: object, height: object, shift: object, pixel_aspect: object) -> str:
    """Describe what is wrong with the values of a lens from a file, if anything; "" if they are right."""
    if kind not in (PERSPECTIVE, ORTHOGRAPHIC, PANORAMA):
        return f"type: expected {PERSPECTIVE}, {ORTHOGRAPHIC} or {PANORAMA}, got {shown(kind)}"
    needed = {PERSPECTIVE: {"fov": fov}, ORTHOGRAPHIC: {"height": height}}.get(str(kind), {})
    if None in needed.values():
        return f"expected the keys {', '.join(needed)}, found none"
    if kind == PERSPECTIVE and not (is_number(fov) and 0 < fov < 180):  # type: ignore[operator]  # it is a number
        return f"fov: expected degrees in (0, 180), got {shown(fov)}"
    sizes = {"height": height} if kind == ORTHOGRAPHIC else {}
    for name, value in (sizes | {"pixel_aspect": pixel_aspect}).items():
        if not (is_number(value) and value > 0):  # type: ignore[operator]  # it is a number
            return f"{name}: expected a positive number, got {shown(value)}"
    if not (isinstance(shift, tuple) and len(shift) == 2 and all(map(is_number, shift))):
        return f"shift: expected 2 finite numbers, got {shown(shift)}"
    return ""


def fov_of_focal(focal: float, height: int) -> float:
    """Vertical field of view, degrees, of a focal length in pixels."""
    return float(np.degrees(2 * np.arctan(0.5 * height / focal)))


def shift_of_centre(centre: tuple[float, float], resolution: tuple[int, int]) -> tuple[float, float]:
    """The lens shift that puts the axis at an image position."""
    (x, y), (width, height), longer = centre, resolution, max(resolution)
    return (width / 2 - x) / longer, (y - height / 2) / longer
