"""Memory of a job: blocks of light positions that fit, and the estimate against what a window really holds."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.tiny import WALK

from framearray_cli.array.images import read_image
from framearray_cli.base.errors import JobError
from framearray_cli.engine.frames.kept_light import BLOCK_BYTES
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import Strip
from framearray_cli.engine.hits.row import LIT_BITS
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames
from framearray_cli.render.division import _pilot_reach, _share, look_at_hits
from framearray_cli.render.memory import (
    NO_LOOK,
    WHOLE,
    PilotHits,
    cells_memory,
    hits_memory,
    light_blocks,
    require_memory,
    window_memory,
)
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import Prepared, open_embree
from framearray_cli.render.render import render
from framearray_cli.scene.files import Material, Meshes, Part
from framearray_cli.scene.files.model import PaneGlass
from framearray_cli.scene.scene import Scene, build_scene

TALL = tiny.walk(3, resolution=[64, 192])
LAMP = {"type": "point", "keys": [{"frame": 0, "position": [0, 1, 0], "intensity": [1.0, 2.0, 3.0]}]}
SHINING = {"type": "mesh", "material": "Panel", "keys": [{"frame": 0, "radiance": 2.0}]}
CASES: dict[str, dict[str, Any]] = {
    "light": {},
    "no reuse": {"reuse": {"n_r": 0}},
    "average": {"reuse": {"n_r": 1, "weights": "average"}},
    "balance": {"reuse": {"n_r": 1, "weights": "balance"}},
    "layers": {"output": {"layers": True}},
    "aov": {"output": {"layers": True, "position": True, "uv": True, "cryptomatte": True}},
    "sun hours": {"light": {"frames": 18, "sources": [tiny.STUDY]}, "output": {"layers": True, "sun_hours": True}},
    "alpha": {"output": {"alpha": True}},
    "cells": {"indirect": tiny.CELLS},
    "area lights": {"light": {"sources": [SHINING]}},
    "unlisted emission": {"scene": {"surfaces": "file"}},
    "glass": {"scene": {"surfaces": "file"}},
    "gloss": {"scene": {"surfaces": "file"}},
    "all": {
        "scene": {"surfaces": "file"}, "indirect": tiny.CELLS, "light": {"sources": [LAMP, SHINING]},
        "output": {"layers": True, "position": True, "uv": True, "cryptomatte": True, "alpha": True},
    },
}  # fmt: skip


def room(name: str) -> Scene:
    """A closed room with a panel; and a pane, gloss and a mirror where the case has them."""
    every = name == "all"
    glass = PaneGlass(colour=(0.9, 0.9, 0.9)) if every or name == "glass" else None
    gloss = {"roughness": 0.3, "metallic": 1.0} if every or name == "gloss" else {}
    emission = (1.0, 1.0, 1.0) if every or name == "unlisted emission" else (0.0, 0.0, 0.0)
    corners = {
        Material(name="Walls", reflectivity=(0.7, 0.5, 0.3)): tiny.box((-2, 0, -2), (2, 2.5, 2)),
        Material(name="Panel"): tiny.quad((-1, 2.4, -1), (1, 2.4, -1), (1, 2.4, 1), (-1, 2.4, 1)),
        Material(name="Glow", emission=emission): tiny.quad((-2, 1, -1.9), (0, 1, -1.9), (0, 2, -1.9), (-2, 2, -1.9)),
        Material(name="Floor", **gloss): tiny.quad((-2, 0.01, 2), (2, 0.01, 2), (2, 0.01, -2), (-2, 0.01, -2)),
        Material(name="Pane", glass=glass): tiny.quad((-2, 0, -1), (1, 0, -1), (1, 2, -1), (-2, 2, -1)),
    }
    if glass is None:
        corners = {material: quad for material, quad in corners.items() if material.name != "Pane"}
    parts = tuple(Part(material=i, corners=quad) for i, quad in enumerate(corners.values()))
    meshes = Meshes(parts=parts, materials=tuple(corners), textures=(), dropped={}, notes=())
    return build_scene(meshes, {}, as_file=bool(gloss or glass or any(emission)))


def inputs_of(name: str, camera: Any = WALK) -> Prepared:
    """A case of three light positions, prepared."""
    light = {"frames": 3, "sources": [LAMP]} | CASES[name].get("light", {})
    usual = {"render": {"threads": 1}, "camera": camera, "reuse": {"n_r": 1, "weights": "area"}}
    return tiny.prepared(tiny.job(**usual | CASES[name] | {"light": light}), room(name))


def lent(inputs: Prepared, strips: Sequence[range] = ()) -> list[tuple[int, int]]:
    """The most bytes of hits that the window of a job holds, and the estimate; of each strip, if there are any."""
    found = []
    with open_embree(inputs) as embree:
        setup, ambient = plan_work(inputs, embree, compare=False)
        look, reached = look_at_hits(setup, 1), _pilot_reach(setup, 1) if strips else ()
        parts = [(replace(setup, strip=Strip(rows=rows)), _share(setup, rows, reached, look)) for rows in strips]
        for part, share in parts or [(setup, WHOLE)]:
            with TracePool(part, 1) as pool:
                window = Window(part, ambient, pool)
                for _ in ready_frames(window, part, range(part.n_frames), pool):
                    pass
                found.append((pool.arrays.peak, hits_memory(inputs, inputs.n_lights, look, share=share)))
    return found


@pytest.mark.parametrize("name", CASES)
def test_a_window_holds_what_the_estimate_says(name: str) -> None:
    """Never more; and little less, unless reflected hits are estimated by their largest number."""
    ((held, estimate),) = lent(inputs_of(name))
    assert held <= estimate
    if name not in ("glass", "gloss", "all"):
        assert held >= 0.9 * (estimate - 3 * BLOCK_BYTES)  # a block of each eye is not full


def test_pilots_of_some_bits_see_as_much_light_as_those_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hit keeps 128 of 1,536 light positions in a row if one of them lights it, by a beam that goes to and fro."""
    beam = {"direction": [0.0, -1.0, 0.0], "intensity": 5.0, "outer": 10.0}
    keys = [beam | {"frame": 1535 * k // 24, "position": [1.9 * (-1) ** k, 2.0, 0.0]} for k in range(25)]
    light = {"frames": 1536, "sources": [{"type": "spot", "keys": keys}]}
    job = tiny.job(render={"threads": 1}, camera=WALK | {"resolution": [24, 18]}, light=light)
    with tiny.planned(tiny.prepared(job, room("light"))) as (setup, _):
        some = look_at_hits(setup, 1).of_native.lit
        monkeypatch.setattr("framearray_cli.render.division.PILOT_BITS", LIT_BITS)
        every = look_at_hits(setup, 1).of_native.lit
    assert 0.05 < every < 0.95 and some == pytest.approx(every, rel=0.05)


def test_the_window_with_the_most_light_counts() -> None:
    """Eyes of half the path look into the light of a beam, the others away from it."""
    beam = {"direction": [0.0, 0.0, -1.0], "position": [0.0, 1.2, -1.0], "intensity": 5.0, "outer": 60.0, "frame": 0}
    light = {"frames": 16, "sources": [{"type": "spot", "keys": [beam]}]}
    eye, ahead, back = [0.0, 1.2, 0.0], [0.0, 1.2, -1.0], [0.0, 1.2, 1.0]

    def lit(*targets: list[float]) -> float:
        keys = [{"frame": 4 * k + f, "eye": eye, "target": to} for k, to in enumerate(targets) for f in (0, 3)]
        camera = {"resolution": [24, 18], "frames": 4 * len(targets), "keys": keys}
        job = tiny.job(render={"threads": 1}, camera=camera, light=light, reuse={"n_r": 1})
        with tiny.planned(tiny.prepared(job, room("light"))) as (setup, _):
            return look_at_hits(setup, 1).of_native.lit

    assert lit(back) < 0.1 < lit(ahead) == pytest.approx(lit(ahead, back), rel=0.05)


@pytest.mark.parametrize("name", CASES)
def test_a_window_of_a_strip_holds_what_the_estimate_says(name: str) -> None:
    inputs = inputs_of(name, TALL)
    strips = [range(first, first + 64) for first in range(0, TALL["resolution"][1], 64)]
    ((whole, _),) = lent(inputs)
    for held, estimate in lent(inputs, strips):
        assert held <= estimate
        assert held < whole


def test_every_feature_is_measured() -> None:
    found = {feature.name for name in CASES for feature in inputs_of(name).features}
    assert found == {"emission", "unlisted emission", "glass", "gloss", "alpha", "surface", "aov", "sun_hours"}


LAMPS = {"frames": 40, "sources": [*tiny.TABLE["light"]["sources"], tiny.RED]}


MARKS = {"alpha": True, "position": True, "uv": True, "cryptomatte": True}


def job(folder: Path, memory: Any = None, output: Any = None) -> Any:
    """A walk through the room of mirrors under 40 lights of three channels."""
    scene = tiny.save_glb(tiny.room_meshes(), folder / "room.glb")
    tables = {"scene": {"background": [0.2, 0.3, 0.4]}, "camera": WALK, "light": LAMPS, "reuse": {"n_r": 1}}
    changes = tables | {"output": output or {}, "render": {"memory": memory}}
    return tiny.job_of_file(scene, folder / f"out{memory}", **changes)


@pytest.fixture(autouse=True)
def _program_of_no_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits in this file are some kilobytes, so the program itself does not count."""
    monkeypatch.setattr("framearray_cli.render.memory.program_memory", lambda: 0)


@pytest.mark.parametrize("output", [{}, MARKS])
def test_blocks_give_the_same_bytes(tmp_path: Path, output: dict[str, Any]) -> None:
    whole = job(tmp_path, output=output)
    inputs = tiny.prepared(whole)
    limit = window_memory(inputs, 16, PilotHits(4.0))
    cut = job(tmp_path, limit, output=output)
    with tiny.planned(tiny.prepared(cut)) as (setup, _):
        assert len(light_blocks(tiny.prepared(cut), look_at_hits(setup, 1))) > 1
    summaries = [render(whole), render(cut)]
    files = sorted(file.name for file in whole.output.directory.glob("*.exr"))
    assert len(files) == 6 * 40 + 6 == len(list(cut.output.directory.glob("*.exr")))
    for name in files:
        assert (whole.output.directory / name).read_bytes() == (cut.output.directory / name).read_bytes(), name
    assert summaries[0].images == summaries[1].images == 240
    assert summaries[0].hits_per_pixel == summaries[1].hits_per_pixel
    assert np.max(read_image(whole.output.directory / files[0])) > 0


def test_blocks_are_as_few_and_as_even_as_can_be(tmp_path: Path) -> None:
    for size, expected in ((40, [40]), (32, [20, 20]), (20, [20, 20]), (16, [14, 14, 12]), (1, [1] * 40)):
        inputs = tiny.prepared(job(tmp_path, window_memory(tiny.prepared(job(tmp_path)), size)))
        assert [len(block) for block in light_blocks(inputs)] == expected
        require_memory(inputs)


def test_a_limit_below_one_light_is_refused(tmp_path: Path) -> None:
    inputs = tiny.prepared(job(tmp_path, window_memory(tiny.prepared(job(tmp_path)), 1) - 1))
    with pytest.raises(JobError, match=r"rendering needs at least .* takes less"):
        require_memory(inputs)


def test_mirrors_are_seen_before_the_first_frame(tmp_path: Path) -> None:
    with tiny.planned(tiny.prepared(tiny.job())) as (setup, _):
        assert 1 < look_at_hits(setup, 1).reflected < 10
    with tiny.planned(tiny.prepared(tiny.job(), tiny.room(mirrors=False))) as (setup, _):
        assert look_at_hits(setup, 1).reflected == 0.0


def test_the_limit_is_that_of_the_whole_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory that the program already holds is not available to frames."""
    inputs = tiny.prepared(job(tmp_path, window_memory(tiny.prepared(job(tmp_path)), 32) + 1000))
    monkeypatch.setattr("framearray_cli.render.memory.program_memory", lambda: 1000)
    assert [len(block) for block in light_blocks(inputs)] == [20, 20]
    monkeypatch.setattr("framearray_cli.render.memory.program_memory", lambda: 2**40)
    with pytest.raises(JobError, match=r"needs at least 1,099,52\d,\d{3},\d{3} bytes"):
        require_memory(inputs)


def test_blocks_of_light_positions_hold_their_cells_once_more() -> None:
    inputs = tiny.prepared(tiny.job(indirect={"method": "cells", "samples": 2048}, light=LAMPS))
    with tiny.planned(inputs) as (setup, _):
        assert setup.indirect.cells is not None and setup.at(range(40)) is setup
        assert cells_memory(setup, 40) == setup.indirect.cells.light.nbytes > 0
        one = setup.for_block(range(1)).indirect.cells
        assert one is not None and one.light.nbytes == cells_memory(setup, 1)
        fits_two = window_memory(inputs, 20)
        assert [len(block) for block in light_blocks(inputs, NO_LOOK, fits_two)] == [20, 20]
        assert [len(block) for block in light_blocks(inputs, NO_LOOK, fits_two, setup=setup)] == [14, 14, 12]
        fits_all = window_memory(inputs, 40)
        assert light_blocks(inputs, NO_LOOK, fits_all, setup=setup) == [range(40)]
