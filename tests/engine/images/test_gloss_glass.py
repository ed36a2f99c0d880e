"""Gloss behind thin glass: a glossy floor under two suns, with a pane on it, against the slow twins of both."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from support import gloss_twin, tiny
from support.glass_twin import Floor, Pane, picture

from framearray_cli.job.job import Job
from framearray_cli.scene.files import Material, Meshes, Part
from framearray_cli.scene.files.model import PaneGlass
from framearray_cli.scene.scene import Scene, build_scene

HALF, BASE, ROUGHNESS, METAL = 6.0, (0.8, 0.6, 0.4), 0.7, 0.5
COLOUR = (0.9, 0.6, 0.3)
# Direction and irradiance of each sun at each light position.
SUNS = [
    [((0.25, -1.0, 0.55), (3.0, 2.5, 2.0)), ((-0.35, -1.0, 0.45), (2.0, 2.5, 1.0))],
    [((-0.1, -0.8, 0.7), (1.0, 0.5, 2.0)), ((0.1, -1.0, -0.3), (1.0, 2.0, 3.0))],
]
PANES = {
    "sheet": Pane(tiny.quad((-1.5, 0.2, 0), (1.5, 0.2, 0), (1.5, 1.8, 0), (-1.5, 1.8, 0)), COLOUR),
    "body": Pane(tiny.box((-1.5, 0.2, -0.2), (1.5, 1.8, 0.0)), COLOUR, body=True),
}


@dataclass(frozen=True)
class GlossyFloor(Floor):
    """A floor of metal and roughness; `reflectivity` is its base colour."""

    def seen(self, origin: Any, way: Any) -> tuple[Any, Any]:
        """As `Floor.seen`, with the text of glTF in place of reflectivity / pi."""
        light, t = super().seen(origin, way)
        viewer = -way / np.linalg.norm(way, axis=1, keepdims=True)
        sun = np.broadcast_to(-np.array(self.sun) / np.linalg.norm(self.sun), way.shape)
        up = np.broadcast_to([0.0, 1.0, 0.0], way.shape)
        with np.errstate(all="ignore"):
            f = gloss_twin.brdf(self.reflectivity, METAL, ROUGHNESS**2, up, viewer, sun)
        return np.where(np.isfinite(t)[:, None], light * f * np.pi / np.array(self.reflectivity), 0.0), t


def scene_with(pane: Pane) -> Scene:
    floor = tiny.quad((-HALF, 0, HALF), (HALF, 0, HALF), (HALF, 0, -HALF), (-HALF, 0, -HALF))
    materials = (
        Material(name="Floor", reflectivity=BASE, roughness=ROUGHNESS, metallic=METAL),
        Material(name="Glass", glass=PaneGlass(colour=pane.colour, ior=pane.ior)),
    )
    parts = (Part(material=0, corners=floor), Part(material=1, corners=pane.corners))
    return build_scene(Meshes(parts=parts, materials=materials, textures=(), dropped={}, notes=()), {})


CAMERAS = {
    "perspective": {"fov": 60.0},
    "orthographic": {"type": "orthographic", "height": 2.6},
    "panorama": {"type": "panorama", "resolution": [80, 40]},
}


def job_for(n_r: int, weights: str, camera: str = "perspective") -> Any:
    keys = [
        {"frame": 0, "eye": [0.6, 1.3, 2.6], "target": [0.0, 0.6, 0.0]},
        {"frame": 4, "eye": [0.3, 1.2, 2.4], "target": [-0.1, 0.6, 0.0]},
    ]
    sources = [
        {
            "type": "directional",
            "keys": [
                {"frame": l, "direction": list(direction), "irradiance": list(irradiance)}
                for l, (direction, irradiance) in enumerate(sun)
            ],
        }
        for sun in SUNS
    ]
    table = tiny.table(
        light={"frames": 2, "sources": sources},
        samples={"hits": 4, "obscurance": 1},
        reuse={"n_r": n_r, "weights": weights},
    )
    eyes = {"resolution": [40, 30], "frames": 5, "keys": keys, **CAMERAS[camera]}
    return Job.model_validate({**table, "camera": eyes, "ambient": {"intensity": [0.0, 0.0, 0.0]}})


def expected(inputs: Any, pane: Pane, j: int, l: int) -> tuple[Any, Any]:
    """The image of eye j by the twin, (height, width, 3), and the pixels all of whose rays see nearly the same."""
    floors = [GlossyFloor(HALF, BASE, *sun[l], [pane]) for sun in SUNS]
    mean, spread = picture(inputs, j, lambda origin, way: sum(floor.radiance(origin, way, 4) for floor in floors))
    return mean, (spread <= 0.04 * mean).all(axis=2) & (mean > 0).all(axis=2)


@pytest.mark.slow  # gloss and glass together have kernels of their own, which take half a minute to compile
@pytest.mark.parametrize(
    ("name", "n_r", "weights", "camera"),
    [
        ("sheet", 2, "balance", "perspective"),
        ("sheet", 0, "balance", "perspective"),
        ("body", 2, "balance", "perspective"),
        ("sheet", 2, "area", "perspective"),
        ("sheet", 2, "balance", "orthographic"),
        ("body", 2, "balance", "orthographic"),
        ("body", 2, "balance", "panorama"),
    ],
)
def test_glossy_floor_behind_a_pane(name: str, n_r: int, weights: str, camera: str) -> None:
    """Light through the pane, the view through it and what it mirrors, of two suns at two light positions."""
    pane = PANES[name]
    inputs = tiny.prepared(job_for(n_r, weights, camera), scene_with(pane))
    images = tiny.render_frames(inputs, threads=2).images
    for l in range(2):
        wanted, even = expected(inputs, pane, 2, l)
        found = images[2, l]
        few = camera == "panorama"  # of its pixels see the pane
        assert even.mean() > (0.1 if few else 0.3)
        off = np.abs(found[even] / wanted[even] - 1)
        # the twin's rays miss edges that cross a corner of a pixel; `area` counts hits beyond it, too
        assert (off < 0.01).all(axis=1).mean() > 0.95
        assert np.median(off) < 2e-3
        # light that is coloured like that without glass would be off
        bare, _ = expected(inputs, replace(pane, colour=(1.0, 1.0, 1.0)), 2, l)
        assert (np.abs(bare[even] / wanted[even] - 1).max(axis=1) > 0.05).mean() > (0.02 if few else 0.1)
