"""Image planes: what each of the images of one frame holds.

Without groups a frame has one picture per light position. With groups it has one plane per group and light position,
and then one or two planes at which no source shines.
"""

from collections.abc import Sequence
from enum import Enum


class Plane(Enum):
    """What one image of a frame holds.

    Attributes:
        PICTURE: all light at one light position.
        LIGHT: direct light of one group at one of its light positions.
        INDIRECT: R W, which I_A multiplies when a picture is made.
        BACKGROUND: light from outside the scene, the same at every light position.
    """

    PICTURE = "picture"
    LIGHT = "light"
    INDIRECT = "indirect"
    BACKGROUND = "background"

    @property
    def lit(self) -> bool:
        """Whether sources shine at this plane: it belongs to a light position."""
        return self in (Plane.PICTURE, Plane.LIGHT)

    @property
    def holds_background(self) -> bool:
        """Whether this plane holds light from outside the scene, which is the same at every light position."""
        return self in (Plane.PICTURE, Plane.BACKGROUND)


def picture_planes(n_lights: int) -> tuple[Plane, ...]:
    """The planes of an array without groups."""
    return (Plane.PICTURE,) * n_lights


def group_planes(n_lights: int, *, background: bool) -> tuple[Plane, ...]:
    """The planes of an array with groups.

    Args:
        n_lights: light positions of all groups together.
        background: whether light comes from outside the scene.
    """
    return (Plane.LIGHT,) * n_lights + (Plane.INDIRECT,) + (Plane.BACKGROUND,) * background


def first_with_background(planes: Sequence[Plane]) -> int:
    """The first plane that holds the background, as do all that follow it; the number of planes if none does."""
    return next((p for p, plane in enumerate(planes) if plane.holds_background), len(planes))
