"""Good jobs have no warnings: those of the project, and tiny ones with one of everything."""

from typing import Any

import pytest
from support import ROOT, ruined, tiny

from framearray_cli.base.forms.table import changed
from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from framearray_cli.render.automatic import resolve_auto
from framearray_cli.render.pilots.warn import find_warnings
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import Prepared, open_embree, prepare

JOBS = sorted(file.stem for file in (ROOT / "jobs").glob("*.toml") if not file.stem.endswith("-movie"))
WALKS = 512  # for the ambient light, which needs no more to tell black from white
SAMPLES = 2**14  # of cells, likewise


def warnings_of(inputs: Prepared) -> tuple[str, ...]:
    with open_embree(inputs) as embree:
        inputs = resolve_auto(inputs, embree)[0]
        return find_warnings(inputs, *plan_work(inputs, embree, compare=False))  # so few samples may be far off


@pytest.mark.parametrize("name", JOBS)
def test_jobs_of_the_project(name):
    job = read_job(ROOT / "jobs" / f"{name}.toml")
    if not job.scene.file.exists():
        pytest.skip("the scenes of jobs/ have not been made")
    fast = job if job.ambient.intensity else changed(job, ambient=changed(job.ambient, paths=WALKS))
    if job.indirect.method == "cells":
        fast = changed(fast, indirect=changed(job.indirect, samples=SAMPLES))
    assert warnings_of(prepare(fast)) == ()


LAMP: dict[str, Any] = tiny.TABLE["light"]["sources"][0]
OFF = {"type": "point", "keys": [{"frame": 0, "position": [0.0, 2.0, 0.0], "intensity": 0.0}]}
GROUPS = {"frames": 3, "sources": [LAMP | {"group": "lamp"}, tiny.SUN | {"group": "sun"}, tiny.RED | {"group": "red"}]}
AXES = {"frames": 3, "axes": {"lamps": 5}, "sources": [LAMP, tiny.RED | {"group": "red", "axis": "lamps"}]}
FADE = {
    "type": "point",
    "keys": [
        {"frame": l, "position": [0.0, 2.2, 0.3], "intensity": strength} for l, strength in enumerate((0, 1e-3, 0.1, 8))
    ],
}
DIM = LAMP | {"keys": [{**LAMP["keys"][0], "intensity": 0.25}]}
EXR = {"format": "exr"}
GOOD: dict[str, dict[str, Any]] = {
    "a still camera": {},
    "a walk": {"camera": tiny.WALK},
    "one picture": {"light": {"frames": 1, "sources": [tiny.RED]}},
    "a single pixel": {"camera": {"resolution": [1, 1]}},
    "a strip": {"camera": {"resolution": [300, 2]}},
    "a wide view": {"camera": {"fov": 150.0}},
    "a narrow view": {"camera": {"fov": 5.0}},
    "PNG": {"output": {"format": "png"}},
    "PNG, darker": {"output": {"format": "png", "exposure": -2.0}},
    "PNG, brighter": {"output": {"format": "png", "exposure": 1.0}},
    "a sun": {"light": {"frames": 1, "sources": [tiny.SUN]}},
    "a sun and a lamp": {"light": {"frames": 3, "sources": [LAMP, tiny.SUN]}},
    "a coloured lamp": {"light": {"frames": 3, "sources": [LAMP, tiny.RED]}},
    "forty lamps": {"light": {"frames": 3, "sources": [DIM] * 40}, "output": {"format": "exr", "half": "never"}},
    "groups": {"light": GROUPS, "output": EXR},
    "axes": {"light": AXES, "output": EXR},
    "groups and a background": {"light": GROUPS, "output": EXR, "scene": {"background": [0.5, 0.6, 0.8]}},
    "a lamp that fades in": {"light": {"frames": 4, "sources": [FADE]}},
    "a lamp that is off": {"light": {"frames": 3, "sources": [LAMP, OFF]}},
    "only a background": {"light": {"frames": 1, "sources": [OFF]}, "scene": {"background": 1.0}},
    "only ambient light": {"light": {"frames": 1, "sources": [OFF]}, "ambient": {"intensity": 0.5, "paths": None}},
    "a bright sky": {"scene": {"background": [3.0, 3.5, 4.0]}},
    "a dim lamp": {"light": {"frames": 3, "sources": [DIM]}},
    "no mirrors": {"specular": {"depth": 0}},
    "fitted ambient light": {"ambient": {"method": "fit", "paths": WALKS}},
    "ambient occlusion": {"obscurance": {"falloff": "constant"}},
    "a short range": {"obscurance": {"range": 0.05}},
    "a long range": {"obscurance": {"range": 20.0}},
    "a far sky": {"obscurance": {"outside": "background"}, "scene": {"background": 0.3}},
    "many light positions": {"light": {"frames": 30, "sources": [LAMP]}},
    "automatic": {"reuse": {"n_r": "auto"}, "samples": {"hits": "auto"}, "camera": tiny.WALK},
}


@pytest.mark.parametrize("name", GOOD)
def test_tiny_jobs(name):
    assert warnings_of(tiny.prepared(tiny.job(**GOOD[name]))) == ()


def furnace(**changes: Any) -> Prepared:
    """A closed white room, whose pictures are flat, on purpose."""
    return tiny.prepared(Job.model_validate(tiny.table(**{**ruined.GOOD, **changes})), ruined.room())


def test_a_furnace():
    assert warnings_of(furnace()) == ()


def test_a_room_that_shows_its_backs_inside():
    """Its faces are turned: it looks like the inside of a solid, but the lamp lights it."""
    turned = ruined.outwards(*ruined.ROOM)
    inputs = furnace()
    assert warnings_of(tiny.prepared(inputs.job, tiny.scene_of(turned, ruined.WHITE))) == ()


def test_a_sphere_below_a_white_sky():
    corners, normals = tiny.ball((0, 0, 0), 1.0)
    job = tiny.job(
        scene={"background": 1.0},
        camera=ruined.camera(((0, 0, 4), (0, 0, 0)), frames=1),
        light={"frames": 1, "sources": [OFF]},
        obscurance={"outside": "background"},
    )
    scene = tiny.scene_of(corners, tiny.Material(name="White", reflectivity=(1.0, 1.0, 1.0)), normals=normals)
    assert warnings_of(tiny.prepared(job, scene)) == ()


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_a_scene_in_another_unit(size):
    """All lengths grow alike, and strengths of lamps with their squares."""
    eyes = [
        (tuple(size * x for x in place), tuple(size * x for x in ruined.TARGET)) for place in (ruined.EYE, (0, 2, 1.5))
    ]
    lamps = [tuple(size * x for x in place) for place in ruined.GOOD_LAMP]
    inputs = tiny.prepared(
        tiny.job(
            camera=ruined.camera(*eyes),
            light=ruined.lit(ruined.lamp(*lamps, intensity=8.0 * size**2)),
            obscurance={"range": 1.2 * size},
        ),
        ruined.room(size=size),
    )
    assert warnings_of(inputs) == ()
