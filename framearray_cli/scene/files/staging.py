"""Cameras and lights of a scene file, of any format, and where they are at any time."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from framearray_cli.base.arrays import Float64
from framearray_cli.job.camera import LEAST_FOV, LEAST_HEIGHT, MOST_FOV, MOST_HEIGHT
from framearray_cli.job.values import MOST_SHIFT


class StageMotion(Protocol):
    """Movement of the nodes of cameras and lights, by their numbers."""

    def world_from_node(self, node: int, times: Sequence[float]) -> Float64:
        """(n, 4, 4) transform of a node at n times, seconds, its ancestors' included."""

    def span(self, nodes: Sequence[int]) -> tuple[float, float] | None:
        """First and last key time, in seconds, of what moves any of the nodes; None if nothing does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StageLens:
    """View of a camera.

    Attributes:
        fov_deg: vertical field of view of a perspective, degrees; 0 of an orthographic camera.
        height: of what an orthographic camera sees, scene units; 0 of a perspective.
        shift: of the picture to the right and up, as a share of its height.
    """

    fov_deg: float = 0.0
    height: float = 0.0
    shift: tuple[float, float] = (0.0, 0.0)

    def problem(self) -> str | None:
        """Reason why no job accepts the lens; None for a good one."""
        if max(map(abs, self.shift)) > MOST_SHIFT:
            return f"has a lens shift of {max(self.shift, key=abs):g} heights of its picture"
        if self.height == self.fov_deg == 0:
            return "sees nothing"
        if self.height > 0:
            fits = LEAST_HEIGHT <= self.height <= MOST_HEIGHT
            return None if fits else f"sees a height of {self.height:g} scene units"
        return None if LEAST_FOV <= self.fov_deg <= MOST_FOV else f"has a field of view of {self.fov_deg:g} degrees"


@dataclass(frozen=True, slots=True, kw_only=True)
class StageCamera:
    """A perspective or orthographic camera; it looks along -z of its node, y is up in the picture.

    What an orthographic camera sees does not depend on the scale of its node, as in USD and Blender.

    Attributes:
        aspect: width over height, if the file gives it.
    """

    name: str
    node: int
    lens: StageLens
    aspect: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class StageLight:
    """A light; directional light travels along -z of its node, and panels face that way.

    Attributes:
        intensity: (3,) linear RGB: radiant intensity of a point or spot, irradiance of a directional light, radiance of
            a panel; in the units of the schema.
        schema: what defines its strength.
        cone_deg: of a spot: the angles from its axis up to which it is brightest, and beyond which it is dark.
        radius: of a point, spot or disc, scene units.
        angle_deg: under which directional light is seen.
        size: width along x of the node and height along y of a rectangle, scene units.
    """

    name: str
    node: int
    kind: Literal["point", "directional", "spot", "rect", "disc"]
    intensity: tuple[float, float, float]
    schema: str
    cone_deg: tuple[float, float] | None = None
    radius: float = 0.0
    angle_deg: float = 0.0
    size: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class EarthPlace:
    """Place of a scene on Earth.

    Attributes:
        latitude, longitude: degrees north and east.
        north: unit direction of the scene.
    """

    latitude: float
    longitude: float
    north: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StageRoom:
    """A room or a storey that the file names.

    Attributes:
        box: (2, 3) lowest and highest corner.
    """

    name: str
    box: Float64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stage:
    """Cameras and lights of a scene file, in the order of its nodes; both may be missing.

    Attributes:
        motion: None for a format without animations.
        notes: what the file holds that cannot be used.
        up: "y" or "z" where the file says which axis points up, else "".
        metres: length of a scene unit, where the file gives it.
        fps: frames per second of its animations, where the file gives them.
        rooms: rooms and storeys that the file names.
        earth: where the scene stands, if the file gives it.
    """

    cameras: tuple[StageCamera, ...] = ()
    lights: tuple[StageLight, ...] = ()
    motion: StageMotion | None = None
    notes: tuple[str, ...] = ()
    up: str = ""
    metres: float | None = None
    fps: float | None = None
    rooms: tuple[StageRoom, ...] = ()
    earth: EarthPlace | None = None

    def room(self, name: str) -> StageRoom | None:
        """The first room whose name holds some words, in upper or lower case; a whole name comes first."""
        asked = name.casefold().strip()
        whole = [room for room in self.rooms if room.name.casefold() == asked]
        return next(iter(whole + [room for room in self.rooms if asked in room.name.casefold()]), None)

    def world_from(self, node: int, times: list[float]) -> Float64:
        """(n, 4, 4) transform of a camera's or light's node at n times, seconds."""
        assert self.motion is not None
        return self.motion.world_from_node(node, times)

    def span(self, nodes: list[int]) -> tuple[float, float] | None:
        """First and last key time, in seconds, of what moves any of the nodes; None if nothing does."""
        return self.motion.span(nodes) if self.motion else None


@dataclass(slots=True)
class StageBuilder:
    """Cameras and lights of a file while it is read, and notes on those that cannot be used."""

    cameras: list[StageCamera] = field(default_factory=list)
    lights: list[StageLight] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add_camera(self, camera: StageCamera) -> None:
        """Add a camera, or note why no job accepts its lens."""
        problem = camera.lens.problem()
        if problem is None:
            self.cameras.append(camera)
        else:
            self.notes.append(f"camera {camera.name}: {problem} and is left out")

    def stage(self, motion: StageMotion, **more: Any) -> Stage:
        """Return the stage; more: further fields."""
        return Stage(
            cameras=tuple(self.cameras),
            lights=tuple(self.lights),
            motion=motion,
            notes=tuple(self.notes),
            **more,
        )
