"""The slow twin of thin glass: a floor in the sun, seen through and in panes, by formulas and without any tricks.

Every ray meets every triangle. Rays are rows: origins and directions (n, 3), shares of light (n, 3).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from framearray_cli.job.job import Job
from framearray_cli.scene.files import Material
from framearray_cli.scene.files.model import PaneGlass
from framearray_cli.scene.scene import Scene
from support import oracle_lens, tiny

Rows = Any
HALF = 6.0  # width of the floor
FACES = 4  # of glass that mirror
SPREAD = 6  # squared: rays per pixel of a picture


@dataclass(frozen=True)
class Pane:
    """Triangles (t, 3, 3) of glass: sheets, or one closed body with its normals."""

    corners: Any
    colour: Any
    ior: float = 1.5
    body: bool = False

    def faces(self, origin: Rows, way: Rows) -> tuple[Rows, Rows, Rows, Rows]:
        """Where rays meet the triangles, infinite where they do not, (t, n); what passes, (t, n, 3); what is mirrored,
        (t, n); unit normals (t, 3)."""
        a, b, c = (self.corners[:, k, None] for k in range(3))
        normal = np.cross(b - a, c - a)[:, 0]
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        with np.errstate(all="ignore"):
            t = ((a - origin) * normal[:, None]).sum(axis=2) / (way @ normal.T).T
            point = origin + t[..., None] * way
            inside = np.ones(t.shape, bool)
            for first, second in ((a, b), (b, c), (c, a)):
                inside &= (np.cross(second - first, point - first) * normal[:, None]).sum(axis=2) >= 0
        cosine = np.abs(way @ normal.T).T / np.linalg.norm(way, axis=1)
        f0 = ((self.ior - 1) / (self.ior + 1)) ** 2
        f = (f0 + (1 - f0) * (1 - cosine) ** 5)[..., None]
        colour = np.array(self.colour)
        passed, mirrored = (
            (np.sqrt(colour) * (1 - f), f) if self.body else (colour * (1 - f) / (1 + f), 2 * f / (1 + f))
        )
        return np.where(inside & (t > 1e-6), t, np.inf), passed, mirrored[..., 0], normal


@dataclass(frozen=True)
class Floor:
    """A floor at y = 0, x and z within HALF, that reflects `reflectivity`, under a sun; and panes."""

    reflectivity: Any
    sun: Any  # direction of its light
    irradiance: Any
    panes: Any

    def passed(self, origin: Rows, way: Rows, end: Rows) -> Rows:
        """The share of light that passes all panes up to `end`, (n, 3)."""
        share = np.ones((len(origin), 3))
        for pane in self.panes:
            t, passed, _, _ = pane.faces(origin, way)
            share *= np.where((t < end)[..., None], passed, 1.0).prod(axis=0)
        return share

    def seen(self, origin: Rows, way: Rows) -> tuple[Rows, Rows]:
        """What rays see of the floor, through all panes, (n, 3), and where it is; infinite if they miss it."""
        with np.errstate(all="ignore"):
            t = -origin[:, 1] / way[:, 1]
            point = origin + t[:, None] * way
        met = (t > 0) & (np.abs(point[:, [0, 2]]) < HALF).all(axis=1)
        t, point = np.where(met, t, np.inf), np.where(met[:, None], point, 0.0)
        sun = np.array(self.sun) / np.linalg.norm(self.sun)
        light = self.passed(point, np.broadcast_to(-sun, point.shape), np.full(len(point), np.inf))
        light = light * np.array(self.irradiance) * -sun[1] * np.array(self.reflectivity) / np.pi
        return np.where(met[:, None], light * self.passed(origin, way, t), 0.0), t

    def radiance(self, origin: Rows, way: Rows) -> Rows:
        """What rays see: the floor, and what each of the first FACES of glass before it mirrors, (n, 3)."""
        light, end = self.seen(origin, way)
        for pane in self.panes:
            t, _, mirrored, normal = pane.faces(origin, way)
            t = np.where(t < end, t, np.inf)
            for k in range(len(t)):
                rows = np.flatnonzero(np.isfinite(t[k]) & ((t < t[k]).sum(axis=0) < FACES))
                o, d, at = origin[rows], way[rows], t[k, rows]
                before = self.passed(o, d, at * (1 - 1e-9))
                back = d - 2 * (d @ normal[k])[:, None] * normal[k]
                light[rows] += before * mirrored[k, rows, None] * self.seen(o + at[:, None] * d, back)[0]
        return light


def picture(inputs: Any, j: int, floors: Sequence[Floor], uneven: float) -> tuple[Any, Any]:
    """The image of eye j, (height, width, 3), and the pixels whose rays differ by a share of at most `uneven`.

    Args:
        floors: the same floor under each sun.
    """
    width, height = inputs.job.camera.resolution
    matrix = inputs.eyes.world_from_camera[j]
    axes = matrix[:3, 3], matrix[:3, 0], matrix[:3, 1], -matrix[:3, 2]
    place = (np.arange(SPREAD) + 0.5) / SPREAD
    x = (np.arange(width)[:, None] + place).reshape(-1)
    y = (np.arange(height)[:, None] + place).reshape(-1)
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    origin, way = oracle_lens.rays(inputs.eyes.lenses[j], (width, height), axes, xy)
    light = sum(floor.radiance(origin, way) for floor in floors).reshape(height, SPREAD, width, SPREAD, 3)
    mean, spread = light.mean(axis=(1, 3)), light.max(axis=(1, 3)) - light.min(axis=(1, 3))
    return mean, ((spread <= uneven * mean) & (mean > 0)).all(axis=2)


COLOUR = (0.9, 0.6, 0.3)
BODY = tiny.box((-1.5, 0.2, -0.2), (1.5, 1.8, 0.0))
PANES = {
    "sheet": Pane(tiny.quad((-1.5, 0.2, 0), (1.5, 0.2, 0), (1.5, 1.8, 0), (-1.5, 1.8, 0)), COLOUR),
    "body": Pane(BODY, COLOUR, body=True),
    "open": Pane(BODY[:-2], COLOUR, ior=1.8),
}


def floor_with(pane: Pane, **floor: Any) -> Scene:
    """A square floor with a pane."""
    corners = tiny.quad((-HALF, 0, HALF), (HALF, 0, HALF), (HALF, 0, -HALF), (-HALF, 0, -HALF))
    glass = Material(name="Glass", glass=PaneGlass(colour=pane.colour, ior=pane.ior))
    return tiny.scene_with((Material(name="Floor", **floor), corners), (glass, pane.corners))


def floor_job(suns: Any, n_r: int, weights: str, **camera: Any) -> Job:
    """A walk past a pane under suns, each a list of (direction, irradiance) of one light position after another."""
    keys = [
        {"frame": 0, "eye": [0.6, 1.3, 2.6], "target": [0.0, 0.6, 0.0]},
        {"frame": 4, "eye": [0.3, 1.2, 2.4], "target": [-0.1, 0.6, 0.0]},
    ]
    shining = [
        [{"frame": l, "direction": list(way), "irradiance": list(light)} for l, (way, light) in enumerate(sun)]
        for sun in suns
    ]
    table = tiny.table(
        light={"frames": len(suns[0]), "sources": [{"type": "directional", "keys": sun} for sun in shining]},
        samples={"hits": 4, "obscurance": 1},
        reuse={"n_r": n_r, "weights": weights},
        ambient=tiny.DARK,
    )
    return Job.model_validate({**table, "camera": {"resolution": [40, 30], "frames": 5, "keys": keys, **camera}})
