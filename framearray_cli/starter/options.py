"""What a user asks of `init`."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

Format = Literal["exr", "png", "tif", "jpg"]
Up = Literal["y", "z"]


class SunOption(NamedTuple):
    """A place on Earth, degrees north and east, and a day, year-month-day."""

    latitude: float
    longitude: float
    date: str


@dataclass(frozen=True, slots=True, kw_only=True)
class StartOptions:
    """Options of `init`; None: the starter chooses.

    Attributes:
        camera: name of a camera of the file.
        frames, lights: numbers of frames of the camera and of positions of the light.
        inside: whether the scene is a room.
        up: which axis points up.
        resolution: width and height, pixels.
        format: of the images; None: PNG, or EXR with groups.
        groups: whether every source is a group of its own, which only EXR and TIFF can hold.
        sun: the sun over a place instead of other lights.
    """

    camera: str | None = None
    frames: int | None = None
    lights: int | None = None
    inside: bool | None = None
    up: Up | None = None
    resolution: tuple[int, int] | None = None
    format: Format | None = None
    groups: bool = False
    sun: SunOption | None = None

    @property
    def image_format(self) -> Format:
        """The format of the images."""
        return self.format or ("exr" if self.groups else "png")
