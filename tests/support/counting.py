"""Rays in closed rooms, each with a known answer, through the program's own kernels; and the number of wrong ones.

Shadow rays: a lamp inside a room reaches every point of its walls, and one outside none. Visibility rays: the same
with eyes. Rays of obscurances and of eyes: from inside, each meets the wall that the formula of a plane says, where it
says; none escapes, and none meets the surface that it leaves.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.embree.packets import DIRECTION, ORIGIN, TFAR, intersect
from framearray_cli.engine.hits.hits import SURFACE, World, empty_hits
from framearray_cli.engine.hits.native import PixelSamples, native_hits, pixel_order
from framearray_cli.engine.hits.outer import outer_hits
from framearray_cli.engine.hits.rays import room_for_hits, room_for_tests
from framearray_cli.engine.inputs.cameras import OUTSIDE as HIDDEN
from framearray_cli.engine.inputs.cameras import Cameras
from framearray_cli.engine.inputs.lights import light_arrays
from framearray_cli.engine.inputs.panes import Sight
from framearray_cli.engine.inputs.random import lattice_steps
from framearray_cli.engine.inputs.surfaces import near_depth
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.engine.terms.direct import FAR_END, direct
from framearray_cli.engine.terms.obscurance import SQRT, ObscuranceSettings, write_obscurance_rays
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import lights_without_groups
from support import tiny
from support.rooms import INSIDE, ON_WALLS, OUTSIDE, TURN, WIDTH, planes
from support.staging import Stage, facing, staged

FAR_OFF = np.array([(1, 1, 1), (1.1, 1, 1), (1, 1.1, 1)]) * 1e10
NOTHING = tiny.scene_of(np.stack([FAR_OFF, -FAR_OFF]))  # hides nothing
# A shadow ray ends 1e-4 of its length before its lamp, so the lamp's own wall may hide it from what is lower above that
# wall than this; and a lamp shines through a wall that it is nearer to than 1e-4 of the distance to a point.
LOWEST, FAR_SHARE = 2e-3, 1.0 - float(FAR_END)
FARTHEST = 4 * 3**0.5  # from a lamp inside to a corner of the box around
# What an eye sees of others' hits at less than this sine above the wall that it stands on is a matter of rounding.
GRAZING = 0.01


@dataclass(frozen=True)
class Count:
    """The number of rays with a known answer, and of wrong answers among them."""

    rays: int
    wrong: int


def shadow_rays(stage: Stage) -> tuple[Count, Count]:
    """Leaks (from lamps outside) and false shadows (of lamps inside)."""
    leaks = _lit(stage, stage.placed(OUTSIDE))
    lit = _lit(stage, stage.inside(INSIDE))
    return Count(leaks.size, int(leaks.sum())), Count(lit.size, int((~lit).sum()))


def lamps_on_walls(stage: Stage) -> Count:
    """False shadows of lamps exactly on walls, edges and corners, on points that face them."""
    places = np.array(ON_WALLS[stage.name])
    lit, wanted = _lit(stage, stage.placed(places)), facing(stage, places, height=LOWEST)
    return Count(int(wanted.sum()), int((wanted & ~lit).sum()))


def light_from_within(name: str) -> Count:
    """Leaks of lamps inside a room to a box around it, and to the room's outside."""
    normals, distances = planes(name)
    lamps = INSIDE * WIDTH.get(name, np.ones(3))
    lamps = lamps[(distances - lamps @ normals.T).min(axis=1) > FAR_SHARE * FARTHEST]
    with staged(name, around=True) as stage:
        lit, wanted = _lit(stage, stage.placed(lamps)), facing(stage, lamps)
    return Count(int(wanted.sum()), int(lit.sum()))


def lamps_reach(stage: Stage, places: Any) -> Any:
    """(n_hits, n_places) which hits a lamp at each place of the room as it is drawn reaches."""
    return _lit(stage, stage.placed(places))


def _lit(stage: Stage, lamps: Any) -> Any:
    power = np.full((len(lamps), 3), float(stage.size) ** 2)
    source = LightPath(kind="point", vector=lamps, intensity=power)
    lights = light_arrays(lights_without_groups([source]), stage.scene.centre)
    out = np.empty((stage.n, 1, len(lamps)), np.float32)
    direct(stage.hits, stage.n, lights, Sight(stage.embree.tracer), room_for_tests(4096, len(lamps)), out, True)
    return out[:, 0] > 0


def hemisphere_rays(stage: Stage, n_rays: int = 5) -> Count:
    """Rays of obscurances that do not meet the wall they should, where they should: leaks and self-hits alike."""
    rays = room_for_hits(-(-stage.n // LANES) * LANES * n_rays)
    rays.place[: stage.n] = np.arange(stage.n)
    step_x, step_y = lattice_steps(n_rays)
    nothing = np.zeros(3, np.float32)
    settings = ObscuranceSettings(
        d_max=stage.size, falloff=SQRT, tau=1.0, n_rays=n_rays, step_x=step_x, step_y=step_y, coherent=True, sky=True,
        average=nothing, background=nothing,
    )  # fmt: skip
    traced = write_obscurance_rays(stage.hits, rays, stage.n, 0, n_rays, settings, True)
    intersect(stage.embree.tracer, rays.packets, traced, True, 0.0)
    row = rays.packets.transpose(0, 2, 1).reshape(-1, rays.packets.shape[1])[:traced]
    row = row[row[:, TFAR] >= 0]  # but for lanes that stand for no hit
    wrong = stage.wrong_ends(row[:, ORIGIN : ORIGIN + 3], row[:, DIRECTION : DIRECTION + 3], row[:, TFAR])
    return Count(len(row), int(wrong.sum()))


def all_round(stage: Stage, positions: Any) -> Cameras:
    """Six eyes at each place, which see all directions between them."""
    ways = np.concatenate([np.eye(3), -np.eye(3)]) @ TURN
    forward = np.tile(ways, (len(positions), 1))
    right, up = np.roll(forward, 1, axis=0), np.roll(forward, 2, axis=0)  # of six ways in turn, any three in a row
    size = 64
    return Cameras(
        position=np.repeat(stage.centred(positions), 6, axis=0),
        right=np.asarray(right, np.float32),
        up=np.asarray(up, np.float32),
        forward=np.asarray(forward, np.float32),
        focal=size / 2 / np.tan(np.radians(46)),
        width=size,
        height=size,
        near=near_depth(stage.surfaces),
    )


def visibility_rays(stage: Stage) -> tuple[Count, Count]:
    """Leaks (hits that eyes outside take over) and losses (hits that eyes inside do not)."""
    wanted, seen = taken_over(stage, stage.placed(OUTSIDE))
    leaks = Count(int(wanted.sum()), int(seen.sum()))
    wanted, seen = taken_over(stage, stage.inside(INSIDE))
    return leaks, Count(int(wanted.sum()), int((wanted & ~seen).sum()))


def eyes_on_walls_lose(stage: Stage) -> Count:
    """Hits that eyes on walls, edges and corners face, and do not take over."""
    places = np.array(ON_WALLS[stage.name])
    wanted, seen = taken_over(stage, stage.placed(places))
    wanted &= np.repeat(facing(stage, places, sine=GRAZING).T, 6, axis=0)
    return Count(int(wanted.sum()), int((wanted & ~seen).sum()))


def taken_over(stage: Stage, positions: Any) -> tuple[Any, Any]:
    """(six eyes per place, n_hits) which hits face an eye and lie in its image, and which of them it takes over."""
    with EmbreeScene(NOTHING) as empty:
        return _pixels(stage, positions, empty) != HIDDEN, _pixels(stage, positions, stage.embree) != HIDDEN


def _pixels(stage: Stage, positions: Any, embree: EmbreeScene) -> Any:
    cams = all_round(stage, positions)
    pixel = np.empty((len(cams.position), -(-stage.n // LANES) * LANES), np.int32)
    outer_hits(cams, -1, 0, stage.hits, stage.n, embree.tracer, room_for_tests(4096, 1), pixel, np.empty((0, 0)), True)
    return pixel[:, : stage.n]


@dataclass(frozen=True)
class EyeRays:
    """Rays of eyes on walls: which do not see what they should."""

    wrong: Any


def eyes_on_walls(
    stage: Stage, inwards: bool, n_eyes: int = 64, near: float | None = None, fov: float = 170.0
) -> EyeRays:
    """Eyes exactly on hits of the walls, looking into the room, which they must see, or out of it, where nothing is."""
    position, normal = stage.hits.position[:n_eyes], stage.hits.geometric[:n_eyes]
    forward = normal if inwards else -normal
    right = np.cross(forward, [0.3, 0.5, 0.8])
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    size = 32
    cams = Cameras(
        position=np.ascontiguousarray(position), right=np.asarray(right, np.float32),
        up=np.asarray(np.cross(right, forward), np.float32), forward=np.ascontiguousarray(forward),
        focal=size / 2 / np.tan(np.radians(fov / 2)), width=size, height=size,
        near=near_depth(stage.surfaces) if near is None else near,
    )  # fmt: skip
    order, n = pixel_order(size, size), size * size
    packets, hits, wrong = room_for_hits(n).packets, empty_hits(n), []
    samples, world = PixelSamples(1, order, per_pixel=1, first=0), World(stage.surfaces, Sight(stage.embree.tracer))
    for c in range(n_eyes):
        native_hits(cams, c, samples, 0, n, world, False, packets, hits)
        if inwards:
            length = np.linalg.norm(hits.incoming, axis=1)
            way, distance = hits.incoming / length[:, None], packets[:, TFAR].ravel() * length
            seen = (hits.kind == SURFACE) & ~stage.wrong_ends(np.tile(cams.position[c], (n, 1)), way, distance)
        else:
            seen = hits.kind != SURFACE
        wrong.append(~seen)
    return EyeRays(np.concatenate(wrong))
