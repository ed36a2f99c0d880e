"""What pilots see: known shares of known scenes, with the kernels of the render, at its light positions."""

import gc

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher
from support import ruined, tiny

from framearray_cli.render.pilots.views import (
    EYES,
    PIXELS,
    Views,
    choose_positions,
    evenly_from_end_to_end,
    render_views,
    runs_text,
)
from framearray_cli.render.pilots.warn import find_warnings
from framearray_cli.render.prepare import Prepared


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
    inputs = tiny.prepared(ruined.case().prepared_from()[0], ruined.room())
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
