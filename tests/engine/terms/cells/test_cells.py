"""Cells against their slow twin: which samples they hold, all bounces between them, and every pixel that reads them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.oracle_cells import LEVELS, SHARE, CellMap, CellOracle, side_of, solve, weights_of
from support.oracle_scene import Model
from support.tiny import RED, SUN, WALK

from framearray_cli.engine.frames.frame import find_frame
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.hits.hits import World
from framearray_cli.engine.terms.ambient.estimate import Ambient
from framearray_cli.engine.terms.cells import build
from framearray_cli.engine.terms.cells.places import Places, PlaceWork, find_places
from framearray_cli.engine.terms.cells.samples import Samples, SampleWalks, draw_samples
from framearray_cli.engine.terms.cells.sweeps import mean_by_cell, sweeps_for
from framearray_cli.engine.terms.cells.table import ALL, Cells
from framearray_cli.engine.terms.obscurance import RAYS_TOGETHER
from framearray_cli.render.ambient_groups import image_ambient
from framearray_cli.render.plan import eye_cameras, plan_work
from framearray_cli.render.prepare import Prepared, open_embree
from framearray_cli.render.target.pilot import _radiance

CELLS = {"indirect": {"method": "cells", "samples": 4096, "cell": 0.1, "filter": 0}}
SKY = {"scene": {"background": [0.3, 0.4, 0.5]}}
LAMP = tiny.TABLE["light"]["sources"][0]
# rays within rounding of a border that may read another cell than the twin's, in pixels per image
FLIPS = 2
# rounding of float32 sums of some hundred samples
ROUNDING = 512 * 2.0**-24


@dataclass(frozen=True)
class Case:
    """A tiny job with cells, the samples that they were built of in the order of the build, and their places."""

    inputs: Prepared
    setup: FrameSetup
    ambient: Ambient
    samples: Samples
    places: Places

    @property
    def cells(self) -> Cells:
        assert self.setup.indirect.cells is not None
        return self.setup.indirect.cells

    @property
    def members(self) -> list[Any]:
        """The samples of each cell."""
        return [self.places.sample[a:b] for a, b in pairwise(self.places.first)]


@contextmanager
def built(room: Any = None, **changes: Any) -> Iterator[Case]:
    """Plan a tiny job with cells; draw and place its samples again."""
    inputs = tiny.prepared(tiny.job(**{**CELLS, **changes}), room)
    with open_embree(inputs) as embree, build.TaskPool(2) as pool:
        setup, ambient = plan_work(inputs, embree)
        walks = SampleWalks(
            cams=eye_cameras(inputs),
            seed=inputs.job.seed,
            world=World(inputs.surfaces, embree.tracer),
            lights=inputs.light_arrays,
            depth=setup.depth,
        )
        samples, _ = draw_samples(walks, inputs.job.indirect.samples, 2)
        assert setup.indirect.cells is not None
        grid = setup.indirect.cells.grid
        samples = samples.rows(build._sorted(grid, samples))
        places = find_places(PlaceWork(grid=grid, samples=samples, tracer=embree.tracer, pool=pool))
        yield Case(inputs=inputs, setup=setup, ambient=ambient, samples=samples, places=places)


def test_samples_join_the_cells_that_they_lie_in_and_whose_guards_they_see() -> None:
    with built() as case:
        twin, samples, places = CellMap(case.cells, Model(case.inputs.scene)), case.samples, case.places
        assert (side_of(samples.geometric) == samples.side).all()
        np.testing.assert_array_equal(places.slots, case.cells.slots)
        position, normal = samples.position.astype(np.float64), samples.geometric.astype(np.float64)
        joined = np.zeros(len(places.other), int)
        for level in range(LEVELS):
            number = twin.numbers(level, position, samples.side)
            known = np.flatnonzero(number > 0)
            sees = twin.sees(position[known], normal[known], number[known])
            joined += np.bincount(number[known[sees]], minlength=len(joined))
        sizes = np.diff(places.first)
        first = np.array(sorted(twin.number.values()))
        assert len(first) > 500 and (sizes[1:] >= 4).all()
        # a ray that passes an edge within rounding may fall on either side
        assert (sizes[first] != joined[first]).mean() < 0.005
        # a cell that some sample of its place does not see has another slot
        blind = np.setdiff1d(np.flatnonzero(joined[first]), np.flatnonzero(sizes[first]))
        assert len(blind) == 0 and 0.01 < (places.other[first] >= 0).mean() < 0.7


def test_light_of_cells_is_that_of_plain_sums() -> None:
    with built(tiny.room(mirrors=False), **SKY) as case:
        samples, setup = case.samples, case.setup
        twin = CellMap(case.cells, Model(case.inputs.scene))
        with build.TaskPool(2) as pool:
            direct, _ = build._direct_light(setup.lights, setup.world, samples, pool, 2)
        escaped = np.isinf(samples.length)
        length = np.where(escaped, 1.0, samples.length)
        target = twin.find(samples.end.astype(np.float64), samples.end_normal.astype(np.float64), length)
        target[escaped] = -1
        reflectivity = samples.reflectivity.astype(np.float64)
        sweeps = sweeps_for(reflectivity[~escaped].sum(axis=0) / samples.n)
        wanted = np.log2(np.maximum(SHARE * samples.first_length.astype(np.float64) / case.cells.grid.edge, 1e-9))
        weights = weights_of(case.members, case.places.level, wanted)
        light = solve(case.members, weights, direct, target, reflectivity, sweeps)
    weights = case.cells.weights.astype(np.float64)
    expected = np.einsum("kcl,c->kl", light, weights)
    tint = light.mean(axis=2) / (light.mean(axis=2) @ weights)[:, None]
    assert len(light) > 500 and expected.mean() > 0.1 and np.ptp(tint) > 0.1
    off = abs(case.cells.light[:, 0] / expected - 1)
    assert np.median(off) < ROUNDING
    assert (off < 1e-3).mean() > 0.99  # a link within rounding of a border may meet another cell
    np.testing.assert_allclose(np.median(abs(case.cells.tint[:, :3] - tint)), 0, atol=ROUNDING)


@pytest.mark.parametrize("edge", [0.1, 0.002])
def test_the_last_resort_is_the_mean_of_all_samples(edge: float) -> None:
    """Whether they joined a cell of the coarsest level, or as with tiny cells hardly any did."""
    changes = {"indirect": {**CELLS["indirect"], "samples": 1024, "cell": edge}}
    with built(tiny.room(mirrors=False), **changes) as case, build.TaskPool(2) as pool:
        samples, setup, places = case.samples, case.setup, case.places
        joined = np.unique(places.sample[np.repeat(places.level, np.diff(places.first)) == LEVELS - 1])
        assert (len(joined) < samples.n / 2) == (edge < 0.01)
        direct, _ = build._direct_light(setup.lights, setup.world, samples, pool, 2)
        members = build._link(case.cells, places, samples, setup.world, pool)
        found = mean_by_cell(members, direct, pool)[ALL]
    np.testing.assert_allclose(found, direct.mean(axis=0, dtype=np.float64), rtol=1e-5)
    assert (case.cells.light[ALL] > found).all() and found.min() > 0  # and all bounces


IMAGES: dict[str, dict[str, Any]] = {
    "black outside": {},
    "sky": SKY,
    "three colours of light": {"light": {"sources": [LAMP, SUN, RED]}},
    "one ray, one hit": {"samples": {"hits": 1, "obscurance": 1}},
    "more rays than packets hold": {"samples": {"hits": 1, "obscurance": 300}, "camera": {"resolution": [4, 3]}},
    "wide cells": {"indirect": {**CELLS["indirect"], "cell": 0.6}},
    "cells as wide as the room": {"indirect": {**CELLS["indirect"], "cell": 3.9}, "camera": {"resolution": [28, 21]}},
    "reuse": {"camera": WALK | {"resolution": [8, 6]}, "reuse": {"n_r": 2}, **SKY},
    "one light": {"light": {"frames": 1, "sources": [RED]}, **SKY},
    "a camera at rest": {"camera": {"frames": 3, "resolution": [8, 6]}, "reuse": {"n_r": 1}},
    "more lights than are solved together": {"light": {"frames": 19}, "camera": {"resolution": [4, 3]}},
}
# rays that are too short for cells: at least that many
SHORT = {"wide cells": 50, "cells as wide as the room": RAYS_TOGETHER * 3 // 4}


@pytest.mark.parametrize("name", IMAGES)
def test_every_pixel_is_that_of_the_twin(name: str) -> None:
    with built(tiny.room(mirrors=False), **IMAGES[name]) as case, TracePool(case.setup, 2) as pool:
        rendered = tiny.frames_of(case.setup, case.ambient, pool)
        twin = CellOracle(case.inputs, case.ambient, case.cells)
        for c in range(len(rendered)):
            for l in range(case.inputs.n_lights):
                image, expected = rendered[c].images[l], twin.image(c, l)
                off = abs(image - expected) / (expected + expected.mean())
                assert (off > 128 * 2.0**-24).any(axis=-1).sum() <= FLIPS, f"camera {c}, light {l}"
        assert twin.kept >= SHORT.get(name, 0)


@pytest.mark.parametrize("name", ["sky", "three colours of light"])
def test_radiance_of_records_is_that_of_images(name: str) -> None:
    """Pilots take the radiance of hits from their records; with one hit per pixel it is the image."""
    changes = {**IMAGES[name], "samples": {"hits": 1}}
    with built(tiny.room(mirrors=False), **changes) as case, TracePool(case.setup, 1) as pool:
        setup = case.setup
        image = tiny.frames_of(setup, case.ambient, pool)[0].images.reshape(setup.lights.n_lights, -1, 3)
        frame = find_frame(setup, 0, pool)
        radiance = _radiance(setup, case.ambient, frame.records)
        hits = frame.places[0]
    assert len(radiance) == setup.n_pixels and image.mean() > 0.01
    np.testing.assert_allclose(radiance[hits.order], image.swapaxes(0, 1), rtol=1e-4, atol=1e-5)


def test_light_of_short_rays_counts_where_cells_are_dark() -> None:
    with built(tiny.room(mirrors=False), **IMAGES["wide cells"]) as case:
        tint, light = case.cells.tint * np.float32(0.0), case.cells.light * np.float32(0.0)
        cells = case.cells._replace(tint=tint, light=light)
        dark = replace(case, setup=replace(case.setup, indirect=replace(case.setup.indirect, cells=cells)))
        twin, images = CellOracle(case.inputs, case.ambient, dark.cells), images_of(dark)
        expected = np.array([[twin.image(0, l) for l in range(case.inputs.n_lights)]])
        off = abs(images[:1] - expected) / (expected + expected.mean())
        assert (off > 128 * 2.0**-24).any(axis=-1).sum() <= FLIPS * case.inputs.n_lights
        assert twin.gathered(twin.native(0), 1)[0].mean() > 0.01


def test_threads_and_blocks_of_lights_change_no_bit() -> None:
    jobs = [tiny.job(**CELLS, **SKY, camera=WALK, reuse={"n_r": 2}, render={"threads": n}) for n in (1, 3)]
    found = []
    for job in jobs:
        with tiny.planned(tiny.prepared(job)) as (setup, ambient), TracePool(setup, job.render.threads or 1) as pool:
            found.append((setup.indirect.cells, [frame.images for frame in tiny.frames_of(setup, ambient, pool)]))
            parts = []
            for block in (range(1), range(1, 3)):
                part = setup.for_block(block)
                with TracePool(part, 2) as few:
                    parts.append([frame.images for frame in tiny.frames_of(part, ambient.for_lights(block), few)])
    (one, images), (other, again) = found
    assert one is not None and other is not None
    for a, b in ((one.slots, other.slots), (one.tint, other.tint), (one.light, other.light)):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(images, again)
    np.testing.assert_array_equal(images, np.concatenate(parts, axis=1))


def test_light_of_groups_adds_up_to_that_of_all_sources() -> None:
    """In a grey room under white light, where one colour per cell is exact; the background has a plane of its own."""
    walls = np.concatenate([tiny.box((-2, 0, -2), (2, 2.5, 2))[2:], tiny.box((-1, 0, -1), (0, 1, 0), 0.3)])
    grey = tiny.scene_of(walls, tiny.Material(name="Grey", reflectivity=(0.5, 0.5, 0.5)))
    lamps = [
        {"type": "point", "keys": [{"frame": f, "position": [x + 0.3 * f, 2.0, y], "intensity": 5.0} for f in (0, 2)]}
        for x, y in ((-1.0, 0.5), (0.8, -0.6))
    ]
    grouped = [{**lamp, "group": name} for lamp, name in zip(lamps, "ab", strict=True)]
    found = []
    for sources in (lamps, grouped):
        light = {"frames": 3, "sources": sources}
        with built(grey, **SKY, light=light, output={"format": "exr"}) as case, TracePool(case.setup, 2) as pool:
            ambient = image_ambient(case.ambient, case.inputs.lights)
            found.append(tiny.frames_of(case.setup, ambient, pool)[0].images.astype(np.float64))
    whole, planes = found
    assert len(planes) == 8 and planes[7].mean() > 0.01 and planes[:6].mean() > 0.1
    np.testing.assert_allclose(planes[:3] + planes[3:6] + planes[7], whole, rtol=2e-4, atol=1e-5)


ORDER = [2, 0, 1]


def images_of(case: Case) -> Any:
    """(n_frames, n_lights, height, width, 3)."""
    with TracePool(case.setup, 2) as pool:
        return np.array([frame.images for frame in tiny.frames_of(case.setup, case.ambient, pool)], np.float64)


def test_light_positions_of_a_table_permute() -> None:
    with built(**SKY) as case:
        images = images_of(case)
        turned = case.setup.at_lights(ORDER)
        ambient = replace(case.ambient, intensity=case.ambient.intensity[ORDER])
        permuted = images_of(replace(case, setup=turned, ambient=ambient))
    np.testing.assert_array_equal(images[:, ORDER], permuted)


def test_light_positions_of_a_job_permute() -> None:
    """Cells are solved anew; only the colour of a cell, a mean over all positions, is rounded differently."""
    keys, found = LAMP["keys"], []
    ends = [keys[0], {"frame": 1, "position": [0.1, 2.0, 0.9], "intensity": [1.0, 2.0, 9.0]}, keys[1]]
    for order in ([0, 1, 2], ORDER):
        lamp = {"type": "point", "keys": [{**ends[l], "frame": k} for k, l in enumerate(order)]}
        with built(**SKY, light={"sources": [lamp]}) as case:
            found.append(images_of(case))
    assert abs(found[0][:, 1] - found[0][:, 0]).mean() > 0.01
    np.testing.assert_allclose(found[0][:, ORDER], found[1], rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize("sources", [[LAMP], [LAMP, RED]])
def test_light_is_linear_in_its_sources(sources: list[Any]) -> None:
    """Three times the light, and none, the light of the background taken off."""
    found = []
    for factor in (1.0, 3.0, 0.0):
        scaled = [
            {**lamp, "keys": [{**key, "intensity": [factor * i for i in key["intensity"]]} for key in lamp["keys"]]}
            for lamp in sources
        ]
        with built(**SKY, light={"sources": scaled}) as case:
            found.append(images_of(case))
    once, thrice, sky = found
    assert sky.mean() > 0.01 and (once - sky).mean() > 0.01
    np.testing.assert_allclose(thrice - sky, 3 * (once - sky), rtol=ROUNDING, atol=ROUNDING)
