"""What pilots see, of scenes with known shares, of ruined jobs, and of good ones."""

import gc
from typing import Any

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher
from support import ROOT, ruined, tiny
from support.ruined import CASES, Case, case, lit

from framearray_cli.base.forms.table import changed
from framearray_cli.job.camera import read_eyes
from framearray_cli.job.read import read_job
from framearray_cli.render.automatic import evenly_from_end_to_end, resolve_auto
from framearray_cli.render.pilots.views import (
    EYES,
    PIXELS,
    Views,
    choose_positions,
    render_views,
    runs_text,
)
from framearray_cli.render.pilots.warn import find_warnings, range_warnings
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import Prepared, open_embree, prepare


def views_of(inputs: Prepared) -> Views:
    with tiny.planned(inputs) as (setup, ambient):
        return render_views(inputs, setup, ambient)


def compiled() -> dict[str, set[str]]:
    """The kernels, and the types that each is compiled for."""
    kinds = {Dispatcher, *Dispatcher.__subclasses__()}  # `isinstance` would ask dead proxies, and takes a second
    kernels = [found for found in gc.get_objects() if type(found) in kinds]
    return {kernel.py_func.__qualname__: set(map(str, kernel.signatures)) for kernel in kernels}


@pytest.mark.parametrize("changes", [{"specular": {"depth": 0}}, {}, {"camera": tiny.WALK, "reuse": {"n_r": 2}}])
def test_nothing_is_compiled_that_frames_do_not_need(changes):
    inputs = tiny.prepared(tiny.job(**changes))
    tiny.render_frames(inputs)
    before = compiled()
    assert "direct" in before
    with tiny.planned(inputs) as (setup, ambient):
        find_warnings(inputs, setup, ambient)
    assert compiled() == before


def test_radiance_is_that_of_the_render():
    """The mean over all pixels, by both ways; hits differ, so that noise remains."""
    inputs = tiny.prepared(tiny.job(samples={"hits": 16}))
    views, whole = views_of(inputs), tiny.render_frames(inputs).images[0]
    found = views.radiance[0].mean(axis=0)
    expected = whole.mean(axis=(1, 2))
    spread = views.radiance[0].std(axis=0) / np.sqrt(views.radiance.shape[1])
    assert (np.abs(found - expected) < 5 * spread).all()


def test_groups_shine_together():
    """The sum of all groups is what the same sources give without groups."""
    sources = [tiny.TABLE["light"]["sources"][0], tiny.SUN, tiny.RED]
    plain = views_of(tiny.prepared(tiny.job(light={"frames": 3, "sources": sources})))
    named = [source | {"group": f"g{k}"} for k, source in enumerate(sources)]
    grouped = views_of(tiny.prepared(tiny.job(light={"frames": 3, "sources": named}, output={"format": "exr"})))
    np.testing.assert_allclose(grouped.radiance, plain.radiance, rtol=0.02, atol=1e-3)  # walks of I_A round differently


def test_surfaces_sides_and_distances():
    inputs = tiny.prepared(*case().prepared_from())
    views = views_of(inputs)
    assert views.surface.all() and not views.back.any()
    turned = views_of(tiny.prepared(inputs.job, tiny.scene_of(ruined.outwards(*ruined.ROOM), ruined.WHITE)))
    assert turned.surface.all() and turned.back.all()
    assert views.distance.min() > 0 and views.distance.max() < 6.2  # the diagonal of the room


def test_a_long_job_is_sampled():
    keys = [{"frame": f, "eye": [0.2, 1.3, 1.7 - 0.001 * f], "target": [0, 0.9, -1]} for f in (0, 999)]
    lamp = tiny.TABLE["light"]["sources"][0]
    job = tiny.job(
        camera={"frames": 1000, "keys": keys, "resolution": [640, 480]}, light={"frames": 500, "sources": [lamp]}
    )
    views = views_of(tiny.prepared(job))
    assert len(views.eyes) == EYES and views.eyes[0] == 0 and views.eyes[-1] == 999
    assert abs(views.surface.shape[1] - PIXELS) < 20
    assert [at["light"] for at in views.positions.index][::7] == [0, 499]


def test_positions_of_groups_go_along_all_axes():
    lamp = tiny.RED | {"group": "red", "axis": "lamps"}
    job = tiny.job(light={"frames": 3, "axes": {"lamps": 5}, "sources": [tiny.SUN, lamp]}, output={"format": "exr"})
    inputs = tiny.prepared(job)
    positions = choose_positions(inputs.lights, inputs.light_arrays)
    assert [at["lamps"] for at in positions.index] == [0, 1, 2, 3, 4]
    assert [at["light"] for at in positions.index] == [0, 0, 1, 2, 2]
    assert positions.power == pytest.approx(1.0)


def test_numbers_and_names_of_places():
    assert evenly_from_end_to_end(3, 8) == [0, 1, 2]
    assert evenly_from_end_to_end(100, 4) == [0, 33, 66, 99]
    assert runs_text([True, True, False, True], [0, 33, 66, 99]) == "0-33,99"


def warnings_of(ruined: Case) -> tuple[str, ...]:
    job, scene = ruined.prepared_from()
    inputs = tiny.prepared(job, scene)
    with tiny.planned(inputs) as (setup, ambient):
        return find_warnings(inputs, setup, ambient)


@pytest.mark.parametrize("name", CASES)
def test_a_ruined_job_is_warned_of(name):
    found = warnings_of(CASES[name])
    assert any(all(word in text for word in CASES[name].words) for text in found), found
    assert len(found) <= 3


@pytest.mark.slow  # compiles kernels with maps
def test_a_sky_outside_a_closed_room():
    sky = {"type": "environment", "file": str(ROOT / "jobs" / "scenes" / "sky.exr"), "keys": [{"frame": 0}]}
    (found,) = warnings_of(case(light=lit(sky)))
    assert "reaches nothing that is seen: surfaces hide the sky" in found


def test_poses_of_every_frame_may_jump_through_a_wall(tmp_path):
    """The same way from two keys passes through it: see CASES."""
    columns = ",".join(f"{key}_{axis}" for key in ("eye", "target") for axis in "xyz")
    (tmp_path / "poses.csv").write_text(f"{columns}\n1.5,1.5,1.5,0,0.7,-1\n1.5,1.5,-0.5,-1,1,-1\n")
    rows = read_eyes(tmp_path / "poses.csv", None).keys
    keys = [{"frame": frame, **row} for frame, row in enumerate(rows)]
    found = warnings_of(case(scene={"wall": True}, camera={"frames": 2, "keys": keys}))
    assert not any("passes through" in text for text in found)


def test_the_job_that_they_are_made_from_is_good():
    """A closed white room, whose pictures are flat, on purpose."""
    assert warnings_of(case()) == ()


def test_long_lengths_are_written_without_an_exponent() -> None:
    (warning,) = range_warnings(tiny.job(obscurance={"range": 13000.0}), 1133.7, np.empty(0))
    assert "13000 scene units, in a scene of 1130:" in warning


JOBS = sorted(file.stem for file in (ROOT / "jobs").glob("*.toml") if not file.stem.endswith("-movie"))
WALKS = 512  # for the ambient light, which needs no more to tell black from white
SAMPLES = 2**14  # of cells, likewise


def warnings_about(inputs: Prepared) -> tuple[str, ...]:
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
    assert warnings_about(prepare(fast)) == ()


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
    "ambient occlusion": {"obscurance": {"falloff": "constant"}},
    "a short range": {"obscurance": {"range": 0.05}},
    "a long range": {"obscurance": {"range": 20.0}},
    "a far sky": {"obscurance": {"outside": "background"}, "scene": {"background": 0.3}},
    "many light positions": {"light": {"frames": 30, "sources": [LAMP]}},
    "automatic": {"reuse": {"n_r": "auto"}, "samples": {"hits": "auto"}, "camera": tiny.WALK},
}


@pytest.mark.parametrize("name", GOOD)
def test_tiny_jobs(name):
    assert warnings_about(tiny.prepared(tiny.job(**GOOD[name]))) == ()


def test_a_room_that_shows_its_backs_inside():
    """Its faces are turned: it looks like the inside of a solid, but the lamp lights it."""
    turned = tiny.scene_of(ruined.outwards(*ruined.ROOM), ruined.WHITE)
    assert warnings_about(tiny.prepared(case().prepared_from()[0], turned)) == ()


def test_a_sphere_below_a_white_sky():
    corners, normals = tiny.ball((0, 0, 0), 1.0)
    job = tiny.job(
        scene={"background": 1.0},
        camera=ruined.camera(((0, 0, 4), (0, 0, 0)), frames=1),
        light={"frames": 1, "sources": [OFF]},
        obscurance={"outside": "background"},
    )
    scene = tiny.scene_of(corners, tiny.Material(name="White", reflectivity=(1.0, 1.0, 1.0)), normals=normals)
    assert warnings_about(tiny.prepared(job, scene)) == ()


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
    assert warnings_about(inputs) == ()
