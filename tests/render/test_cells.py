"""Renders with light from cells: parts give the bytes of the whole, and what cells cannot be built of."""

import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.handed import contents
from support.tiny import CELLS, RED, SUN, WALK

from framearray_cli.array.images import read_image
from framearray_cli.array.manifest import file_name, image_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.mixtures import Mixture
from framearray_cli.array.pictures import Pictures, Relight
from framearray_cli.array.record import read_records
from framearray_cli.base.errors import JobError
from framearray_cli.engine.frames.setup import Scratch
from framearray_cli.engine.terms.ambient.intensity import MIN_WALKS, Accuracy
from framearray_cli.engine.terms.cells.lookup import MOST_CELLS
from framearray_cli.job.job import Job
from framearray_cli.render.cells import extent, least_edge
from framearray_cli.render.events import AmbientEstimated
from framearray_cli.render.memory import (
    NO_LOOK,
    _gathering_memory,
    cells_memory,
    expected_build,
    expected_light,
    expected_table,
    light_blocks,
    memory_limit,
    require_memory,
    window_memory,
)
from framearray_cli.render.messages import ambient_lines
from framearray_cli.render.pilots.warn import indirect_warnings
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import Prepared, open_embree
from framearray_cli.render.render import render


def job(scene: Path, out: Path, threads: int, **more: Any) -> Job:
    tables = {"scene": {"background": [0.3, 0.4, 0.5]}, "camera": WALK, "reuse": {"n_r": 1}, "indirect": CELLS}
    return tiny.job_of_file(scene, out, render={"threads": threads}, **tables | more)


def test_images_of_groups_hold_all_light_of_their_sources(scene: Path, tmp_path: Path) -> None:
    """Nothing is left for ambient light; the picture is the sum of groups and background, relit as they are."""
    lamps = [{**lamp, "group": name} for lamp, name in ((tiny.TABLE["light"]["sources"][0], "a"), (SUN, "b"))]
    render(job(scene, tmp_path, 2, light={"sources": lamps}, camera={"resolution": [8, 6]}))
    manifest = read_manifest(tmp_path)
    assert not manifest.uses_ambient
    assert not read_image(tmp_path / file_name(manifest.ambient_images, 0)).any()
    a, b = (read_image(image_path(manifest, 0, 1, group)) for group in manifest.groups)
    sky = read_image(tmp_path / file_name(manifest.background_images, 0))
    pictures = Pictures(manifest)
    np.testing.assert_allclose(pictures.picture(0, (1,)), a + b + sky, rtol=1e-6)
    relit = Relight(groups={"a": (0.0,) * 3, "b": (2.0,) * 3}, ambient=(7.0,) * 3)
    np.testing.assert_allclose(pictures.picture(0, (1,), relit), 2 * b + sky, rtol=1e-6)
    mixture = Mixture(((0, (0.5,) * 3), (1, (2.0,) * 3)))
    mixed = pictures.picture(0, (mixture,), Relight(groups={"b": (0.0,) * 3, "background": (0.0,) * 3}))
    first = read_image(image_path(manifest, 0, 0, manifest.groups[0]))
    np.testing.assert_allclose(mixed, 0.5 * first + 2 * a, rtol=1e-5)


def test_parts_and_threads_give_the_bytes_of_the_whole(scene: Path, tmp_path: Path) -> None:
    summary = render(job(scene, tmp_path / "whole", 1))
    for part in ((0, 1, 5), (2, 3, 4)):
        render(job(scene, tmp_path / "parts", 3), cameras=part)
    assert contents(tmp_path / "whole") == contents(tmp_path / "parts") != {}
    note = next(note for note in summary.notes if note.startswith("indirect light differs from paths by"))
    manifest = read_manifest(tmp_path / "whole")
    assert note in manifest.summary["notes"]  # type: ignore[operator]  # values of a summary are of any type
    runs = read_records(tmp_path / "parts", manifest.fingerprint).runs
    assert len(runs) == 2 and len({run.cells for run in runs}) == 1 and runs[0].cells.startswith("sha256:")


@pytest.mark.parametrize("exact", [False, True])
def test_the_memory_of_threads_grows_with_the_light_positions_as_their_arrays_do(exact: bool) -> None:
    keys = {"exact": True} if exact else {"samples": 1024}
    sizes, expected = [], []
    for frames in (16, 160):
        inputs = tiny.prepared(tiny.job(indirect={"method": "cells", **keys}, light={"frames": frames}))
        with tiny.planned(inputs) as (setup, _):
            scratch = Scratch(setup, 2048)
        room = scratch.indirect
        if exact:
            arrays = [room.paths.work.sums, room.paths.work.irradiance]
        else:
            arrays = [a for one in (*room.near, room.smooth) for a in one if isinstance(a, np.ndarray)]
        sizes.append(sum(array.nbytes for array in arrays))
        expected.append(_gathering_memory(inputs, frames))
    assert expected[1] - expected[0] == sizes[1] - sizes[0]


@pytest.mark.parametrize("edge", [1e-300, 1e-6, 4.2, 1e12])
def test_an_edge_beyond_the_scene_or_the_keys_of_cells_is_refused(edge: float) -> None:
    """The room is 4 units wide; keys tell 2^19 cells apart."""
    with pytest.raises(JobError, match=r"indirect.cell: expected a number from 7.6e-06 to 4, as the scene .* got .*"):
        tiny.prepared(tiny.job(indirect={**CELLS, "cell": edge}))


def test_edges_from_the_least_to_the_scene_are_taken() -> None:
    scene = tiny.room()
    for edge in (least_edge(scene), extent(scene)):
        tiny.prepared(tiny.job(indirect={**CELLS, "cell": edge}), scene)
    assert MOST_CELLS * least_edge(scene) == pytest.approx(extent(scene)) == pytest.approx(4.0)


def test_the_edge_that_the_program_chooses_stays_within_the_keys() -> None:
    """Rays in the room are a metre long; a 30th of that is less than the keys of the whole scene hold."""
    small, far = tiny.room_meshes(mirrors=False, textured=False), 1e7  # a triangle 10,000 km away
    corners = np.concatenate([*(part.corners for part in small.parts), [[[far, 0, 0], [far, 1, 0], [far, 0, 1]]]])
    scene = tiny.scene_of(corners)
    inputs = tiny.prepared(tiny.job(indirect=CELLS), scene)
    with tiny.planned(inputs) as (setup, _):
        assert setup.indirect.cells is not None and setup.indirect.cells.grid.edge == least_edge(scene) > 10


def accuracy(mean: float, rms: float, noise: float = 0.01) -> Accuracy:
    return Accuracy(bias=mean, bias_error=noise, error=rms, error_error=noise, points=1024, paths=256)


@pytest.mark.parametrize(
    ("found", "warns"),
    [
        (accuracy(0.02, 0.15), False),
        (accuracy(-0.08, 0.15), True),
        (accuracy(0.0, 0.3), True),
        (accuracy(-0.08, 0.3, 0.1), False),
        (None, False),
    ],
)
def test_what_is_far_from_paths_by_more_than_noise_is_a_warning(found: Accuracy | None, warns: bool) -> None:
    job = tiny.job(indirect={**CELLS, "cell": 0.1})
    with tiny.planned(tiny.prepared(job)) as (setup, _):
        warnings = list(indirect_warnings(job, setup, found))
    assert len(warnings) == warns
    for text in warnings:
        assert text.startswith("indirect.cell, indirect.samples: indirect light differs from paths by")
        assert "with cells of 0.1 scene units and 4,096 samples" in text
        assert text.endswith("; leave indirect.cell out, or raise indirect.samples")


def small_job(folder: Path, **more: Any) -> Any:
    scene = tiny.save_glb(tiny.room_meshes(mirrors=False), folder / "room.glb")
    return tiny.job_of_file(scene, folder / "out", **{"camera": {"resolution": [8, 6]}, "indirect": CELLS} | more)


def test_the_manifest_has_the_error_in_numbers_and_the_warning(tmp_path: Path) -> None:
    """Cells of a millimetre have fewer than four samples, and all surfaces the same light."""
    summary = render(small_job(tmp_path, indirect={**CELLS, "samples": 1024, "cell": 0.001}))
    manifest = read_manifest(tmp_path / "out").summary
    table = manifest["indirect"]
    assert isinstance(table, dict) and set(table) == {"mean", "mean_error", "rms", "rms_error", "points", "paths"}
    assert table["rms"] > 0.25 and (table["points"], table["paths"]) == (64, 256)
    note = next(note for note in summary.notes if note.startswith("indirect light differs from paths by"))
    assert f"{table['rms']:.1%}" in note and f"{table['mean']:+.1%}" in note
    (warning,) = manifest["warnings"]
    assert warning.startswith("indirect.cell, indirect.samples: ") and note in warning


def test_too_few_points_to_compare_are_said(tmp_path: Path) -> None:
    """An eye that sees the sky only, but for a corner of a wall."""
    keys = [{"frame": 0, "eye": [0.0, 2000.0, 0.5], "target": [0.0, 0.0, 0.0]}]
    summary = render(small_job(tmp_path, camera={"resolution": [8, 6], "keys": keys}))
    (note,) = (note for note in summary.notes if "paths" in note)
    assert note.startswith("indirect light was not compared with paths: expected at least 32 of 4,096 points")
    assert "indirect" not in read_manifest(tmp_path / "out").summary


def test_no_ambient_light_is_estimated_or_printed_that_images_do_not_have() -> None:
    job = tiny.job(indirect=CELLS, ambient={"paths": 100_000}, light={"frames": 100})
    with tiny.planned(tiny.prepared(job)) as (_, ambient):
        assert ambient.paths == 0 and ambient.rays < 8 * MIN_WALKS
        assert ambient.intensity.shape == (100, 3) and not ambient.intensity.any()
        assert not any("I_A" in line for line in ambient_lines(AmbientEstimated.of(ambient)))


def limited(inputs: Prepared, memory: int) -> Prepared:
    job = tiny.job(indirect={"method": "cells", "samples": 2**17}, render={"threads": 2, "memory": memory})
    return replace(inputs, job=job)


@pytest.mark.parametrize("lights", [3, 40])
def test_building_takes_about_the_memory_that_was_estimated(lights: int) -> None:
    job = tiny.job(indirect={"method": "cells", "samples": 2**16}, light={"frames": lights})
    inputs, first = tiny.prepared(job), tiny.prepared(tiny.job(indirect=CELLS, light={"frames": lights}))
    with open_embree(first) as embree:
        plan_work(first, embree, compare=False)  # loads the kernels
    with open_embree(inputs) as embree:
        tracemalloc.start()
        setup, _ = plan_work(inputs, embree, compare=False)
        kept, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert 0.5 * expected_build(inputs) < peak < expected_build(inputs)
    assert 0.3 * expected_table(inputs) < kept < 1.5 * expected_table(inputs)
    assert cells_memory(setup, lights) < 1.5 * expected_light(inputs, lights)


def test_cells_that_do_not_fit_are_refused_before_any_ray() -> None:
    """`check`, `render` and parts ask the same function; frames would fit."""
    inputs = limited(tiny.prepared(tiny.job()), 2**40)
    frames, cells = 3 * window_memory(inputs, 3), expected_build(inputs)
    program = 2**40 - memory_limit(inputs)
    assert frames < cells
    with pytest.raises(JobError, match=r"needs at least .* may be used; cells take .* and a smaller indirect.samples"):
        require_memory(limited(inputs, program + frames))
    require_memory(limited(inputs, program + cells + frames))


def test_no_block_is_chosen_where_not_even_one_light_position_fits_beside_the_cells() -> None:
    inputs = tiny.prepared(tiny.job(indirect=CELLS))
    with tiny.planned(inputs) as (setup, _):
        least = window_memory(inputs, 1) + cells_memory(setup, 1)
        assert [len(block) for block in light_blocks(inputs, NO_LOOK, least, setup=setup)] == [1, 1, 1]
        with pytest.raises(JobError, match="rendering needs at least"):
            light_blocks(inputs, NO_LOOK, least - 1, setup=setup)


def test_the_whole_table_is_no_part_of_what_frames_may_take() -> None:
    """Whether it is there or, as in `check`, only some of it."""
    inputs = limited(tiny.prepared(tiny.job()), 2**31)
    with tiny.planned(inputs) as (setup, _):
        one = setup.at([0])
        for known in (setup, one):
            assert memory_limit(inputs, known) <= 2**31 - inputs.held - cells_memory(setup, inputs.n_lights)


STILL = {**WALK, "keys": [WALK["keys"][0], {**WALK["keys"][0], "frame": 5}]}


@pytest.mark.parametrize(
    "changes",
    [
        {"light": {"frames": 1, "sources": [RED]}},
        {"reuse": {"n_r": 0}, "camera": WALK | {"resolution": [8, 6]}},
        {"reuse": {"n_r": 1}, "camera": {"frames": 1, "resolution": [8, 6]}},
        {"reuse": {"n_r": 1}, "camera": STILL | {"resolution": [8, 6]}},
    ],
    ids=["one light position", "no reuse", "one camera", "a camera at rest"],
)
def test_the_smallest_arrays_have_the_light_of_paths(changes: dict[str, Any], tmp_path: Path) -> None:
    """The mean of all images; with cells, and with paths in their place, which have the noise."""
    means, single = [], []
    for name, indirect in (("cells", {**CELLS, "samples": 2**15}), ("paths", {"method": "cells", "exact": True})):
        out = {"output": {"directory": str(tmp_path / name)}, "samples": {"hits": 16, "obscurance": 16}}
        render(small_job(tmp_path, **{"indirect": indirect, **out, **changes}))
        images = np.stack([read_image(file) for file in sorted((tmp_path / name).glob("tiny.c*.exr"))])
        means.append(images.mean(axis=(0, 1, 2)))
        single.append(images)
    assert np.isfinite(single[0]).all()
    np.testing.assert_allclose(means[0], means[1], rtol=0.03)
