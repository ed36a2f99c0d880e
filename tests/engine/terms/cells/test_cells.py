"""Light from cells, against plain sums and the slow twin, also behind mirrors and glass."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.kept import KEPT, unpacked
from support.lit_rooms import GREY, lamp
from support.oracle_cells import LEVELS, SHARE, CellMap, CellOracle, side_of, solve, weights_of
from support.oracle_scene import Model
from support.pathtraced import path_traced
from support.tiny import RED, SUN, WALK
from support.ztests import difference, estimate

from framearray_cli.engine.frames.frame import find_frame
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.hits.hits import World
from framearray_cli.engine.inputs.panes import Sight
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.engine.terms.cells import solution
from framearray_cli.engine.terms.cells.lookup import ALL, Cells
from framearray_cli.engine.terms.cells.samples import Places, PlaceWork, Samples, SampleWalks, draw_samples, find_places
from framearray_cli.engine.terms.cells.solution import mean_by_cell, sweeps_for
from framearray_cli.engine.terms.obscurance import RAYS_TOGETHER
from framearray_cli.render.errortarget import _radiance
from framearray_cli.render.plan import eye_cameras, image_ambient, plan_work
from framearray_cli.render.prepare import Prepared, open_embree
from framearray_cli.scene.files import Material
from framearray_cli.scene.files.model import PaneGlass
from framearray_cli.scene.scene import Scene

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
    with open_embree(inputs) as embree, solution.TaskPool(2) as pool:
        setup, ambient = plan_work(inputs, embree)
        walks = SampleWalks(
            cams=eye_cameras(inputs),
            seed=inputs.job.seed,
            world=World(inputs.surfaces, Sight(embree.tracer)),
            lights=inputs.light_arrays,
            depth=setup.depth,
        )
        samples, _ = draw_samples(walks, inputs.job.indirect.samples, 2)
        assert setup.indirect.cells is not None
        grid = setup.indirect.cells.grid
        samples = samples.rows(solution._sorted(grid, samples))
        places = find_places(PlaceWork(grid=grid, samples=samples, tracer=embree.tracer, pool=pool))
        yield Case(inputs=inputs, setup=setup, ambient=ambient, samples=samples, places=places)


def test_samples_join_the_cells_that_they_lie_in_and_whose_guards_they_see() -> None:
    with built() as case:
        twin, samples, places = CellMap(case.cells, Model(case.inputs.scene)), case.samples, case.places
        np.testing.assert_array_equal(places.slots, case.cells.slots)
        position, normal = samples.position.astype(np.float64), samples.geometric.astype(np.float64)
        joined = np.zeros(len(places.other), int)
        for level in range(LEVELS):
            number = twin.numbers(level, position, side_of(samples.geometric))
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
        with solution.TaskPool(2) as pool:
            direct, _ = solution._direct_light(setup.lights, setup.world, samples, pool, 2)
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
    with built(tiny.room(mirrors=False), **changes) as case, solution.TaskPool(2) as pool:
        samples, setup, places = case.samples, case.setup, case.places
        joined = np.unique(places.sample[np.repeat(places.level, np.diff(places.first)) == LEVELS - 1])
        assert (len(joined) < samples.n / 2) == (edge < 0.01)
        direct, _ = solution._direct_light(setup.lights, setup.world, samples, pool, 2)
        members = solution._link(case.cells, places, samples, setup.world, pool)
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


def compared(room: Scene, changes: dict[str, Any], rounding: float) -> CellOracle:
    """Compare every pixel of a job with the twin's."""
    with built(room, **changes) as case, TracePool(case.setup, 2) as pool:
        rendered = tiny.frames_of(case.setup, case.ambient, pool)
        twin = CellOracle(case.inputs, case.ambient, case.cells)
        for c in range(len(rendered)):
            for l in range(case.inputs.n_lights):
                image, expected = rendered[c].images[l], twin.image(c, l)
                off = abs(image - expected) / (expected + expected.mean())
                assert (off > rounding).any(axis=-1).sum() <= FLIPS, f"camera {c}, light {l}"
    return twin


@pytest.mark.parametrize("name", IMAGES)
def test_every_pixel_is_that_of_the_twin(name: str) -> None:
    assert compared(tiny.room(mirrors=False), IMAGES[name], 128 * 2.0**-24).kept >= SHORT.get(name, 0)


@pytest.mark.parametrize(
    "name", ["sky", "three colours of light", "wide cells", "one mirror on the way", "more rays than packets hold"]
)
def test_every_pixel_that_shows_mirrors_is_that_of_the_twin(name: str) -> None:
    """Float32 sums of some rays, times a chance that is rounded, too."""
    assert compared(tiny.room(), IMAGES.get(name, {"specular": {"depth": 1}}), 256 * 2.0**-24).mirrored > 100


@pytest.mark.parametrize("name", ["sky", "three colours of light"])
def test_radiance_of_records_is_that_of_images(name: str) -> None:
    """Pilots take the radiance of hits from their records; with one hit per pixel it is the image."""
    changes = {**IMAGES[name], "samples": {"hits": 1}}
    with built(tiny.room(mirrors=False), **changes) as case, TracePool(case.setup, 1) as pool:
        setup = case.setup
        image = tiny.frames_of(setup, case.ambient, pool)[0].images.reshape(setup.lights.n_lights, -1, 3)
        frame = find_frame(setup, 0, pool)
        radiance = _radiance(setup, case.ambient, unpacked(frame.records, setup.stored))
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
                    parts.append([frame.images for frame in tiny.frames_of(part, ambient.at(block), few)])
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
    np.testing.assert_allclose(planes[:3] + planes[3:6] + planes[7], whole, rtol=2 * KEPT, atol=1e-5)


ORDER = [2, 0, 1]


def images_of(case: Case) -> Any:
    """(n_frames, n_lights, height, width, 3)."""
    with TracePool(case.setup, 2) as pool:
        return np.array([frame.images for frame in tiny.frames_of(case.setup, case.ambient, pool)], np.float64)


def test_light_positions_of_a_table_permute() -> None:
    with built(**SKY) as case:
        images = images_of(case)
        turned = case.setup.at(ORDER)
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
    """Four times the light, and none, without the background; factors of two change no digit of kept numbers."""
    found = []
    for factor in (1.0, 4.0, 0.0):
        scaled = [
            {**lamp, "keys": [{**key, "intensity": [factor * i for i in key["intensity"]]} for key in lamp["keys"]]}
            for lamp in sources
        ]
        with built(**SKY, light={"sources": scaled}) as case:
            found.append(images_of(case))
    once, more, sky = found
    assert sky.mean() > 0.01 and (once - sky).mean() > 0.01
    np.testing.assert_allclose(more - sky, 4 * (once - sky), rtol=ROUNDING, atol=ROUNDING)


# A room of 3 x 2.5 x 4 whose wall at x = WALL is a mirror; a lamp in a bucket lights the ceiling, not that wall.
WALL, BUCKET = 1.5, (-0.6, 0.9, 0.3)
LOOK = {"keys": [{"frame": 0, "eye": [-1.2, 1.3, 1.7], "target": [1.0, 1.1, -1.2]}], "resolution": [32, 24]}
SHINING = Material(name="mirror", reflectivity=(0.0, 0.0, 0.0), specular=(1.0, 1.0, 1.0))


def furnished(side: float) -> list[Any]:
    """The walls but that of the mirror, and what stands in the room; side -1: mirrored at that wall."""

    def at(x: float) -> float:
        return WALL + side * (x - WALL)

    def quad(*corners: Any) -> Any:
        return tiny.quad(*((at(x), y, z) for x, y, z in corners))

    def block(low: Any, high: Any) -> Any:
        (x0, y0, z0), (x1, y1, z1) = low, high
        return tiny.box((min(at(x0), at(x1)), y0, z0), (max(at(x0), at(x1)), y1, z1))

    x, y, z, h = BUCKET[0], BUCKET[1], BUCKET[2], 2.5
    return [
        quad((-1.5, 0, -2), (WALL, 0, -2), (WALL, 0, 2), (-1.5, 0, 2)),
        quad((-1.5, h, -2), (WALL, h, -2), (WALL, h, 2), (-1.5, h, 2)),
        quad((-1.5, 0, -2), (-1.5, 0, 2), (-1.5, h, 2), (-1.5, h, -2)),
        quad((-1.5, 0, -2), (WALL, 0, -2), (WALL, h, -2), (-1.5, h, -2)),
        quad((-1.5, 0, 2), (WALL, 0, 2), (WALL, h, 2), (-1.5, h, 2)),
        block((0.3, 0, -1.0), (0.9, 1.0, -0.4)),
        *(quad((x - a, y, z - b), (x - c, y, z - d), (x - c, y + 0.7, z - d), (x - a, y + 0.7, z - b))
          for a, b, c, d in ((0.3, 0.3, -0.3, 0.3), (-0.3, 0.3, -0.3, -0.3), (-0.3, -0.3, 0.3, -0.3),
                             (0.3, -0.3, 0.3, 0.3))),
        quad((x - 0.3, y, z - 0.3), (x + 0.3, y, z - 0.3), (x + 0.3, y, z + 0.3), (x - 0.3, y, z + 0.3)),
    ]  # fmt: skip


def with_mirror() -> Scene:
    wall = tiny.quad((WALL, 0, -2), (WALL, 0, 2), (WALL, 2.5, 2), (WALL, 2.5, -2))
    grey = Material(name="grey", reflectivity=GREY)
    return tiny.scene_with((grey, np.concatenate(furnished(1.0))), (SHINING, wall))


def doubled() -> Scene:
    corners = np.concatenate([*furnished(1.0), *furnished(-1.0)])
    return tiny.scene_of(corners, Material(name="grey", reflectivity=GREY))


def inputs_of(scene: Scene, *, twice: bool = False, place: Any = None, **changes: Any) -> Any:
    x, y, z = place or (BUCKET[0], BUCKET[1] + 0.5, BUCKET[2])
    lamps = [lamp((at, y, z)) for at in ((x, 2 * WALL - x) if twice else (x,))]
    tables: dict[str, Any] = {
        "camera": LOOK, "light": {"frames": 1, "sources": lamps}, "samples": {"hits": 16, "obscurance": 16},
        "indirect": {"method": "cells", "samples": 2**18},
    }  # fmt: skip
    return tiny.prepared(tiny.job(**{**tables, **changes}), scene)


def image_of(inputs: Any) -> Any:
    return tiny.render_frames(inputs, threads=2).images[0, 0].astype(np.float64)


def test_light_beside_a_mirror_is_that_of_paths() -> None:
    """A lamp beside the mirror, which as a diffuse surface would light the room by another 30 %."""
    keys = {"place": (1.1, 1.6, 0.3), "indirect": {"method": "cells", "samples": 2**16}}
    images = [image_of(inputs_of(with_mirror(), seed=seed, **keys)).mean() for seed in range(3)]
    right = estimate(path_traced(inputs_of(with_mirror(), **keys), 0, 512).mean(axis=(1, 2, 3)))
    off = difference(estimate(np.array(images)), right)
    assert right.error < 0.005 * right.mean
    assert abs(off.mean) < 3 * off.error + 0.01 * right.mean


@pytest.mark.slow
def test_a_room_with_a_mirror_is_as_bright_as_one_twice_as_large() -> None:
    keys = {"indirect": {"method": "cells", "samples": 2**18}}
    one, two = (
        estimate(np.array([image_of(inputs_of(scene, twice=twice, seed=seed, **keys)).mean() for seed in range(4)]))
        for scene, twice in ((with_mirror(), False), (doubled(), True))
    )
    off = difference(one, two)
    assert off.error < 0.01 * two.mean
    assert abs(off.mean) < 3 * off.error + 0.01 * two.mean


TINT = (0.5, 0.25, 0.8)
WALLS = tiny.box((-2, 0, -2), (2, 2.5, 2))
LOW, HIGH = (-0.6, 0.8), (0.6, 1.9)  # x and y of the window, in the wall at z = -2


def wall_with_window() -> Any:
    """The wall at z = -2 as a frame of four quads."""

    def piece(x0: float, y0: float, x1: float, y1: float) -> Any:
        return tiny.quad((x0, y0, -2), (x1, y0, -2), (x1, y1, -2), (x0, y1, -2))

    (x0, y0), (x1, y1) = LOW, HIGH
    return np.concatenate([piece(-2, 0, x0, 2.5), piece(x1, 0, 2, 2.5), piece(x0, 0, x1, y0), piece(x0, y1, x1, 2.5)])


def room(colour: Any) -> Scene:
    """A room with a pane in its window, which covers and mirrors nothing."""
    others = WALLS[~(WALLS[..., 2] == -2).all(axis=1)]
    (x0, y0), (x1, y1), z = np.subtract(LOW, 0.5), np.add(HIGH, 0.5), -2.05
    pane = tiny.quad((x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z))
    return tiny.scene_with(
        (Material(name="Walls", reflectivity=(0.7, 0.6, 0.5)), np.concatenate([others, wall_with_window()])),
        (Material(name="Pane", glass=PaneGlass(colour=colour, ior=1.0, covers=True)), pane),
    )


def picture(colour: Any, background: float, intensity: float, indirect: dict[str, Any]) -> Any:
    eye = {"frame": 0, "eye": [1.2, 1.4, 1.7], "target": [-0.6, 0.6, -1.0]}
    lamp = {"type": "point", "keys": [{"frame": 0, "position": [0.0, 1.3, -2.6], "intensity": intensity}]}
    job = tiny.job(
        scene={"background": background},
        camera={"frames": 1, "resolution": [32, 24], "fov": 60.0, "keys": [eye]},
        light={"frames": 1, "sources": [lamp]},
        samples={"hits": 4, "obscurance": 4},
        reuse={"n_r": 0},
        indirect=indirect,
    )
    return tiny.render_frames(tiny.prepared(job, room(colour)), threads=2).images[0, 0].astype(np.float64)


@pytest.mark.parametrize("indirect", [tiny.CELLS, {"method": "cells", "exact": True}, {"method": "obscurance"}])
@pytest.mark.parametrize(("background", "intensity"), [(1.0, 1e-9), (0.0, 3.0)])
def test_all_light_behind_a_window_has_its_colour(
    background: float, intensity: float, indirect: dict[str, Any]
) -> None:
    """Pixel by pixel, as all rays are the same: light that leaves the room does not come back."""
    clear = picture((1.0, 1.0, 1.0), background, intensity, indirect)
    tinted = picture(TINT, background, intensity, indirect)
    lit = clear.min(axis=2) > 1e-3 * clear.max()
    assert lit.mean() > (0.6 if "exact" in indirect else 0.9)  # few paths of a pixel leave by the window
    ratio = tinted[lit] / clear[lit]
    np.testing.assert_allclose(np.median(ratio, axis=0), TINT, rtol=1e-4)
    assert (np.abs(ratio / TINT - 1) < 0.01).mean() > 0.98
