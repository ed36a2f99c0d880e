"""A closed room that is ready to trace, points of its walls, and where rays in it must end."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.embree.packets import intersect, set_ray
from framearray_cli.engine.hits.hits import SURFACE, Hits, World, empty_hits, record_hits
from framearray_cli.engine.hits.rays import room_for_hits
from framearray_cli.engine.inputs.panes import Sight
from framearray_cli.engine.inputs.surfaces import ULP, Surfaces, surfaces
from framearray_cli.engine.kernels.kernel import kernel
from framearray_cli.scene.scene import Scene
from support import tiny
from support.rooms import ROOMS, TURN, WIDTH, plain, planes

HERE, BETWEEN = np.array([0.11, 0.0, -0.17]), np.array([2.1, 1.9, 1.7])  # where the eye sees the points of a room from
# How far from its wall a ray may end: roundings of corners, origin and distance, of coordinates up to 1.7.
NEAR_WALL = 16 * ULP


@dataclass(frozen=True, eq=False)
class Stage:
    """A room at some size and place, ready to trace, and points of its walls that are seen from inside."""

    name: str
    size: float
    at: Any
    scene: Scene
    surfaces: Surfaces
    embree: EmbreeScene
    hits: Hits

    @property
    def n(self) -> int:
        return len(self.hits.kind)

    def placed(self, points: Any) -> Any:
        """Points of the room as it is drawn in `rooms.py`, where they are in the file."""
        return _placed(points, self.size, self.at)

    def inside(self, points: Any) -> Any:
        """Points in a room from -1 to 1, moved into this one."""
        return self.placed(np.asarray(points) * WIDTH.get(self.name, np.ones(3)))

    def centred(self, points: Any) -> Any:
        """(n, 3) float32, as kernels take places in the file."""
        return np.asarray(points - self.scene.centre, np.float32)

    def right_distance(self, origins: Any, ways: Any) -> tuple[Any, Any]:
        """Return the distance of each ray to the room's wall, and the cosine there, from the planes of the room.

        A ray does not hit the plane that it leaves, however its origin was rounded.
        """
        normals, distances = planes(self.name)
        normals, far, cosine = normals @ TURN, np.empty(len(ways)), np.empty(len(ways))
        origins = (np.asarray(origins, np.float64) + (self.scene.centre - self.at)) / self.size
        length = np.linalg.norm(np.asarray(ways, np.float64), axis=1)
        for part in np.array_split(np.arange(len(ways)), max(1, len(ways) * len(normals) // 10**7)):
            towards = (np.asarray(ways[part], np.float64) / length[part, None]) @ normals.T
            with np.errstate(divide="ignore", invalid="ignore"):
                t = np.where(towards > 0, (distances - origins[part] @ normals.T) / towards, np.inf)
            first = t.argmin(axis=1)
            far[part], cosine[part] = t.min(axis=1), np.take_along_axis(towards, first[:, None], 1)[:, 0]
        return self.size * far, cosine

    def wrong_ends(self, origins: Any, ways: Any, distance: Any) -> Any:
        """Return which rays do not end at the right wall; lengths of unit directions."""
        right, cosine = self.right_distance(origins, ways)
        return ~(abs(distance - right) <= NEAR_WALL * self.size / cosine)


def _placed(points: Any, size: float, at: Any) -> Any:
    with np.errstate(invalid="ignore"):  # one room has corners that are no numbers
        return size * (points @ TURN) + at


@contextmanager
def staged(
    name: str, *, size: float = 1.0, at: Any = (0.0, 0.0, 0.0), n: int = 16384, around: bool = False
) -> Iterator[Stage]:
    """A room, and n points of its walls.

    Args:
        size: what all lengths are multiplied with.
        at: where the middle of the room is.
        around: a box three times as large stands around the room, and the points are seen from between the two.
    """
    at, corners = np.asarray(at, np.float64), ROOMS[name]()
    scene = tiny.scene_of(_placed(np.concatenate([corners, 3 * plain()]) if around else corners, size, at))
    arrays = surfaces(scene)
    with EmbreeScene(scene) as embree:
        eye = np.asarray(_placed(BETWEEN if around else HERE, size, at) - scene.centre, np.float32)
        yield Stage(name, size, at, scene, arrays, embree, _seen(arrays, embree, eye, n))


@kernel
def _shoot(origin: Any, way: Any, packets: Any) -> None:
    for i in range(way.shape[0]):
        set_ray(packets, i, origin[0], origin[1], origin[2], way[i, 0], way[i, 1], way[i, 2], np.float32(np.inf))


def _seen(arrays: Surfaces, embree: EmbreeScene, eye: Any, n: int) -> Hits:
    """Find the hits of n rays in all directions; each must be a wall."""
    way = np.random.default_rng(3).normal(size=(n, 3)).astype(np.float32)
    packets, hits = room_for_hits(n).packets, empty_hits(n)
    _shoot(eye, way, packets)
    intersect(embree.tracer, packets, n, coherent=False, near=0.0)
    record_hits(World(arrays, Sight(embree.tracer)), packets, n, False, hits)
    assert (hits.kind == SURFACE).all(), "a ray left a closed room"
    return hits


def facing(stage: Stage, places: Any, *, height: float = 0.0, sine: float = 0.0) -> Any:
    """(n_hits, n_places) which hits face a place, and are not too low over the walls that the place is on.

    Args:
        places: in the room as it is drawn.
        height: lowest height over those walls, in units of the room.
        sine: lowest height as a share of the distance.
    """
    normals, distances = planes(stage.name)
    position = (stage.hits.position + (stage.scene.centre - stage.at)) / stage.size @ TURN.T
    to_place = np.asarray(places, np.float64) - position[:, None]
    up = (to_place * (stage.hits.geometric @ TURN.T)[:, None]).sum(axis=-1)
    faces = up > 2 * stage.hits.offset[:, None] / stage.size  # rays start below the place
    for k, place in enumerate(places):
        on = abs(normals @ place - distances) < 1e-9
        over = (to_place[:, k] @ normals[on].T).min(axis=1, initial=np.inf)
        faces[:, k] &= over > np.maximum(height, sine * np.linalg.norm(to_place[:, k], axis=1))
    return faces
