"""Weights by area, light from cells, soft lights: parts, blocks and runs that stop write the bytes of the whole."""

from pathlib import Path
from typing import Any

import pytest
from support import tiny
from support.handed import contents
from support.iesfiles import ies
from support.tiny import WALK

import framearray_cli.render.render as rendering
from framearray_cli.base.errors import OutputError
from framearray_cli.job.job import Job
from framearray_cli.render.events import Event, ImagesWritten
from framearray_cli.render.render import render

Bytes = dict[str, bytes]


class Stopping:
    """Ends a run after some images."""

    def __init__(self, most: int) -> None:
        self.left = most

    def __call__(self, event: Event) -> None:
        self.left -= event.images if isinstance(event, ImagesWritten) else 0
        if self.left < 0:
            raise OutputError("stopped by the test")


SOFT = {
    "sources": [
        {"type": "point", "keys": [{**key, "radius": 0.2} for key in tiny.TABLE["light"]["sources"][0]["keys"]]},
        {"type": "directional", "keys": [{**key, "angle": 5.0} for key in tiny.SUN["keys"]]},
        {"type": "spot", "keys": [{"frame": 0, "position": [0.5, 1.9, 0.5], "target": [0, 0, 0], "intensity": 9.0}]},
        {
            "type": "rect",
            "keys": [
                {
                    "frame": 0,
                    "position": [-0.5, 1.9, 0],
                    "target": [0, 0, 0],
                    "power": 30.0,
                    "width": 0.5,
                    "height": 0.2,
                }
            ],
        },
        {
            "type": "spot",
            "ies": "lamp.ies",
            "keys": [{"frame": 0, "position": [0.2, 1.8, -0.5], "target": [0, 0, 0], "intensity": 4.0}],
        },
    ]
}


STUDY = {
    "frames": 3,
    "sources": [
        {
            "type": "sun", "latitude": 41.9, "longitude": 12.5, "date": "2026-06-21", "timezone": 1.0,
            "start": "08:00", "stop": "16:00", "irradiance": 3.0,
        }
    ],
}  # fmt: skip


def job(scene: Path, out: Path, threads: int, more: dict[str, Any]) -> Job:
    tables: dict[str, Any] = {
        "scene": {"file": str(scene), "background": [0.3, 0.4, 0.5]},
        "camera": WALK,
        "output": {"directory": str(out), "sun_hours": more.get("light") is STUDY},
        "reuse": {"n_r": 1, "weights": "area"},
        "render": {"threads": threads},
    }
    return tiny.job(**tables, **more)


@pytest.mark.parametrize(
    "more",
    [{}, {"indirect": tiny.CELLS}, {"light": SOFT}, {"light": STUDY}],
    ids=["area", "cells", "soft", "hours of sun"],
)
def test_any_way_to_render_writes_the_same_bytes(
    more: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = tiny.save_glb(tiny.room_meshes(), tmp_path / "room.glb")
    (tmp_path / "lamp.ies").write_text(ies())
    monkeypatch.chdir(tmp_path)
    render(job(scene, tmp_path / "whole", 1, more))
    whole = contents(tmp_path / "whole")
    assert len(set(whole.values())) == 6 * (3 + 1), "images and layers, all different"

    for part in ((2, 5), (0, 3), (1, 4)):
        render(job(scene, tmp_path / "parts", 5, more), cameras=part)
    assert contents(tmp_path / "parts") == whole

    for most in (2, 7):
        with pytest.raises(OutputError, match="stopped"):
            render(job(scene, tmp_path / "stopped", 2, more), Stopping(most))
    assert 0 < len(contents(tmp_path / "stopped")) < len(whole)
    render(job(scene, tmp_path / "stopped", 2, more))
    assert contents(tmp_path / "stopped") == whole

    monkeypatch.setattr(rendering, "light_blocks", lambda *_, **__: [range(0, 2), range(2, 3)])
    render(job(scene, tmp_path / "blocks", 2, more))
    assert contents(tmp_path / "blocks") == whole
