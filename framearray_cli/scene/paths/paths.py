"""Key frames -> eyes[c] and lights[l], in float64 and in the scene file's own coordinates.

An image plane is one of the images of a frame. Without groups a frame has one picture per light position. With groups
it has one plane per group and light position, and then one or two planes at which no source shines.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64, WorldPoints
from framearray_cli.base.errors import JobError
from framearray_cli.base.lens import Lens
from framearray_cli.job.camera import KEYS_OF_TYPE
from framearray_cli.job.job import Job
from framearray_cli.job.keys import PlacedSource

from .curves import PARALLEL, interpolate_directions, interpolate_keys, unit
from .lightpath import LightPath
from .placing import cut_suns, place_source


class Plane(Enum):
    """Contents of one image of a frame.

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
        """True if sources shine at this plane: it belongs to a light position."""
        return self in (Plane.PICTURE, Plane.LIGHT)

    @property
    def holds_background(self) -> bool:
        """True if this plane holds light from outside the scene, which is the same at every light position."""
        return self in (Plane.PICTURE, Plane.BACKGROUND)


def group_planes(n_lights: int, *, background: bool) -> tuple[Plane, ...]:
    """The planes of an array with groups.

    Args:
        n_lights: light positions of all groups together.
        background: True if light comes from outside the scene.
    """
    return (Plane.LIGHT,) * n_lights + (Plane.INDIRECT,) + (Plane.BACKGROUND,) * background


def first_with_background(planes: Sequence[Plane]) -> int:
    """The first plane that holds the background, as do all that follow it; the number of planes if none does."""
    return next((p for p, plane in enumerate(planes) if plane.holds_background), len(planes))


def lenses(job: Job) -> tuple[Lens, ...]:
    """Return the lens of each frame: values of the keys, interpolated between them, else the values of all frames."""
    camera = job.camera
    common: dict[str, Any] = {"type": camera.type}
    moving: dict[str, Any] = {}
    for name in KEYS_OF_TYPE[camera.type]:
        values = [getattr(key, name) for key in camera.keys]
        if values[0] is not None:
            rows = [value if isinstance(value, tuple) else (value,) for value in values]
            found = interpolate_keys([key.frame for key in camera.keys], rows, camera.frames).tolist()
            moving[name] = [tuple(row) if name == "shift" else row[0] for row in found]
        elif (value := getattr(camera, name)) is not None:
            common[name] = value
    if not moving:
        return (Lens(**common),) * camera.frames
    return tuple(Lens(**common, **{name: rows[c] for name, rows in moving.items()}) for c in range(camera.frames))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Eyes:
    """The camera at every frame c.

    Attributes:
        position: (n, 3), scene units.
        world_from_camera: (n, 4, 4), right-handed and orthonormal; the camera looks along -z, y is up in the picture.
        lenses: n.
    """

    position: WorldPoints
    world_from_camera: Float64
    lenses: tuple[Lens, ...]

    @property
    def n(self) -> int:
        """Number of eyes, N_c."""
        return len(self.position)

    @property
    def at_rest(self) -> bool:
        """True if the camera never moves, nor changes its lens."""
        same = all(lens is self.lenses[0] or lens == self.lenses[0] for lens in self.lenses)
        return same and bool((self.world_from_camera == self.world_from_camera[:1]).all())

    def at(self, indices: Sequence[int]) -> "Eyes":
        """Return some of the eyes, in the order of the indices."""
        rows = list(indices)
        return replace(
            self,
            position=self.position[rows],
            world_from_camera=self.world_from_camera[rows],
            lenses=tuple(self.lenses[c] for c in rows),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LightGroup:
    """Sources whose light is computed and stored separately.

    Attributes:
        axis: light axis that they move along.
        positions: image planes at which these sources shine, and no others.
        sources: their indices in `Lights.sources`.
    """

    name: str
    axis: str
    positions: range
    sources: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lights:
    """All sources; the sources of one image plane shine together. See `lights_without_groups` for jobs without groups.

    Attributes:
        sources: n positions each; their intensity is 0 at planes that they do not light.
        groups: each has consecutive planes of its own.
        planes: what each image of a frame holds.
    """

    sources: tuple[LightPath, ...]
    groups: tuple[LightGroup, ...] = ()
    planes: tuple[Plane, ...]

    @property
    def n(self) -> int:
        """Number of image planes; without groups, of light positions N_l."""
        return len(self.planes)

    @property
    def unlit(self) -> tuple[Plane, ...]:
        """The planes at which no source shines; none without groups."""
        return tuple(plane for plane in self.planes if not plane.lit)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the files of sources, each once."""
        found = [path.environment.panorama.note for path in self.sources if path.environment]
        found += [path.profile.web.note for path in self.sources if path.profile]
        return tuple(dict.fromkeys(note for note in found if note))

    def at(self, planes: Sequence[int]) -> "Lights":
        """Return the same sources at some planes only, in rising order; every group keeps one at least."""
        chosen = list(planes)

        def moved(group: LightGroup) -> LightGroup:
            own = [k for k, p in enumerate(chosen) if p in group.positions]
            return replace(group, positions=range(own[0], own[-1] + 1))

        return replace(
            self,
            sources=tuple(path.at(chosen) for path in self.sources),
            groups=tuple(map(moved, self.groups)),
            planes=tuple(self.planes[p] for p in chosen),
        )

    def few(self, most: int) -> list[int]:
        """Return at least one plane of every group, about `most` lit ones in all, and all planes without light."""
        lit = sum(plane.lit for plane in self.planes)
        if lit <= most:
            return list(range(self.n))
        found: list[int] = []
        for positions in [group.positions for group in self.groups] or [range(lit)]:
            n = max(most * len(positions) // lit, 1)
            found += [positions[int(k)] for k in np.linspace(0, len(positions) - 1, n).round()]
        return found + [p for p, plane in enumerate(self.planes) if not plane.lit]


def lights_without_groups(sources: Sequence[LightPath]) -> Lights:
    """Lights without groups: one picture per light position."""
    return Lights(sources=tuple(sources), planes=(Plane.PICTURE,) * len(sources[0].vector))


def eyes(job: Job) -> Eyes:
    """Place the camera at every frame of a job.

    Raises:
        JobError: the eye meets its target between two keys.
    """
    keys = job.camera.keys
    frames = [key.frame for key in keys]
    position = interpolate_keys(frames, [key.eye for key in keys], job.camera.frames)
    target = interpolate_keys(frames, [key.target for key in keys], job.camera.frames)
    look_vec = target - position
    rounding = 16 * np.finfo(np.float64).eps * np.abs(position).max(axis=1)  # some last bits of the largest coordinate
    if (meeting := np.flatnonzero(np.linalg.norm(look_vec, axis=1) <= rounding)).size:
        problem = (
            f"camera.keys: expected a target away from the eye, got the same point at frame {meeting[0]}; move a key"
        )
        raise JobError(job.file or job.name, [problem])
    look_dir = unit(look_vec)
    axis = (0.0, 0.0, 1.0) if job.scene.up == "z" else (0.0, 1.0, 0.0)
    up_dir = interpolate_directions(frames, [key.up or axis for key in keys], job.camera.frames)
    right_dir = _right(look_dir, up_dir, keys[0].up is None)
    matrix = np.zeros((len(position), 4, 4))
    matrix[:, :3, 0] = right_dir
    matrix[:, :3, 1] = unit(np.cross(right_dir, look_dir))
    matrix[:, :3, 2] = -look_dir
    matrix[:, :3, 3] = position
    matrix[:, 3, 3] = 1.0
    return Eyes(position=position, world_from_camera=matrix, lenses=lenses(job))


def lights(job: Job) -> Lights:
    """Compute position and intensity of every source at every image plane of a job.

    Raises:
        JobError: a sun that never shines, or whose north points up.
        MissingExtraError: there is a sun, and ephem is not installed.
    """
    table = job.light
    in_camera = any(isinstance(source, PlacedSource) and source.space == "camera" for source in table.sources)
    turn = eyes(job).world_from_camera[0, :3, :3] if in_camera else None
    if not table.groups:
        sources = [place_source(job, i, table.frames, turn) for i in range(len(table.sources))]
        return _with_suns(lights_without_groups(sources))
    planes = group_planes(sum(group.n for group in table.groups), background=any(job.scene.background))
    groups, found, first = [], {}, 0
    for group in table.groups:
        positions = range(first, first + group.n)
        groups.append(LightGroup(name=group.name, axis=group.axis, positions=positions, sources=group.sources))
        for i in group.sources:
            path, intensity = place_source(job, i, group.n, turn), np.zeros((len(planes), 3))
            intensity[first : positions.stop] = path.intensity  # it shines only at its positions
            own = np.clip(np.arange(len(planes)) - first, 0, group.n - 1).tolist()
            found[i] = replace(path.at(own), intensity=intensity)
        first = positions.stop
    return _with_suns(Lights(sources=tuple(found[i] for i in sorted(found)), groups=tuple(groups), planes=planes))


def _with_suns(found: Lights) -> Lights:
    """Add the suns of environments behind all sources, as sources of the same groups."""
    parts = [cut_suns(path, i) for i, path in enumerate(found.sources)]
    suns = [path for _, *more in parts for path in more]
    if not suns:
        return found

    def extended(group: LightGroup) -> LightGroup:
        more = (len(parts) + k for k, path in enumerate(suns) if path.part_of in group.sources)
        return replace(group, sources=(*group.sources, *more))

    sources = (*(first for first, *_ in parts), *suns)
    return replace(found, sources=sources, groups=tuple(map(extended, found.groups)))


def _right(look_dir: Float64, up_dir: Float64, up_is_axis: bool) -> Float64:
    """Find the right direction of each picture, (n, 3) unit vectors normal to the look.

    A frame that looks along up gets the right of the nearest frame that does not, so that a camera that tilts to the
    zenith arrives without a turn. If all frames look along up, right is x, or for an up of the keys an axis across it.
    """
    right_vec = np.cross(look_dir, up_dir)
    steep = np.linalg.norm(right_vec, axis=1) <= PARALLEL
    good = np.flatnonzero(~steep)
    for c in np.flatnonzero(steep):
        choices = [right_vec[good[np.abs(good - c).argmin()]]] if good.size else []
        choices += [np.eye(3)[0]] if up_is_axis else []
        choices += [np.eye(3)[np.abs(look_dir[c]).argmin()]]
        level = [choice - (choice @ look_dir[c]) * look_dir[c] for choice in choices]
        right_vec[c] = next(vector for vector in level if np.linalg.norm(vector) > PARALLEL)
    return unit(right_vec)
