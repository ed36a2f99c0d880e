"""Jobs that differ in their sources only: those of the project with lights of every kind along the same path."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from support.iesfiles import ies

from bench.core.cases import job_named, with_resolution, with_tables
from framearray_cli.array.images import ImageFormat, write_image
from framearray_cli.base.arrays import Float32
from framearray_cli.base.forms.table import changed
from framearray_cli.job.job import Job

Source: TypeAlias = dict[str, Any]  # as in a job file
Sources: TypeAlias = list[Source]

RADIUS, SUN = 0.06, 0.53  # metres; degrees
SIDE, WIDE, SPECK = 0.1, 0.4, 1e-4  # of squares, metres; the last has no half-shadows
DOWN = (0.0, -1.0, 0.0)
ROWS = 64  # of maps, twice as many columns
SHARE_OF_SUN = 0.6  # of the light of a map with a sun
# Neither ambient nor indirect light beyond one obscurance ray: direct light is what differs.
DIRECT: Mapping[str, Mapping[str, Any]] = {
    "ambient": {"intensity": (0.0, 0.0, 0.0), "paths": 1},
    "samples": {"obscurance": 1},
}
# Nothing to estimate before the first frame.
KNOWN_AMBIENT: Mapping[str, Mapping[str, Any]] = {
    "ambient": {"intensity": (1.0, 1.0, 1.0), "paths": 1},
}


def job_with(job: Job, sources: Sources, tables: Mapping[str, Mapping[str, Any]], frames: int | None = None) -> Job:
    """The job with other sources, and some keys of its tables changed.

    Args:
        frames: light positions; None: as many as it has.
    """
    light = type(job.light).model_validate({"frames": frames or job.light.frames, "sources": sources})
    return with_tables(changed(job, light=light), tables)


def sky(with_sun: bool) -> Float32:
    """A panorama: a blue sky that is brightest at the horizon, brown ground, and the sun in one texel."""
    up = np.linspace(1, -1, 2 * ROWS + 1)[1::2]
    blue, brown = np.array([0.5, 0.7, 1.1]), np.array([0.22, 0.19, 0.15])
    rows = np.where(up[:, None] > 0, blue * (1.6 - 0.9 * np.abs(up[:, None])), brown)
    texels = np.repeat(rows[:, None], 2 * ROWS, axis=1)
    if with_sun:
        edges = np.sin(np.linspace(np.pi / 2, -np.pi / 2, ROWS + 1))
        solid_angle = (edges[:-1] - edges[1:]) * np.pi / ROWS
        light = (texels.mean(axis=2) * solid_angle[:, None]).sum()
        row = round(ROWS * 0.39)  # 18 degrees up
        colour = np.array([1.15, 1.0, 0.85])
        texels[row, ROWS] += colour * light * SHARE_OF_SUN / (1 - SHARE_OF_SUN) / solid_angle[row]
    return texels.astype(np.float32)


def write_map(file: Path, texels: Float32) -> str:
    """Write a panorama, and return its name."""
    file.parent.mkdir(parents=True, exist_ok=True)
    write_image(file, texels, ImageFormat(half="never"))
    return str(file)


def lamp_file(folder: Path) -> str:
    """An IES file of 25 x 37 angles."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "lamp.ies"
    file.write_text(ies(np.linspace(0, 180, 25).tolist(), np.linspace(0, 360, 37).tolist()[:-1]), encoding="utf-8")
    return str(file)


def kitchen_sources(folder: Path) -> dict[str, Sources]:
    """Suns and skies in place of the direction of the kitchen; maps turn once in 48 positions."""
    own = _own("kitchen")
    sun = [{**source, "keys": [{**key, "angle": SUN} for key in source["keys"]]} for source in own]
    turn = [{"frame": 0, "rotation": 0.0}, {"frame": 47, "rotation": 352.5}]
    skies = [
        {"type": "environment", "file": write_map(folder / name, sky(with_sun)), "keys": turn}
        for name, with_sun in (("sky.exr", False), ("sun.exr", True))
    ]
    return {
        "direction": own,
        "sun": sun,
        "sun, visible": [{**source, "visible": True} for source in sun],
        "two directions": [*own, *own],
        "sky": skies[:1],
        "sky and sun": skies[1:],
    }


def cabin_sources(folder: Path) -> dict[str, Sources]:
    """Lamps of every kind in place of the point of the cabin."""
    (own,) = _own("cabin")
    radius, down = {"radius": RADIUS}, {"direction": DOWN}
    sphere = _lamp(own, "point", **radius)
    square = {**down, "width": SIDE, "height": SIDE}
    wide, speck = ({**down, "width": side, "height": side} for side in (WIDE, SPECK))
    return {
        "point": [own],
        "sphere": [sphere],
        "sphere, visible": [{**sphere, "visible": True}],
        "spot": [_lamp(own, "spot", **down, inner=30.0, outer=70.0)],
        "IES": [{**_lamp(own, "point"), "ies": lamp_file(folder)}],
        "square": [_panel(own, "rect", **square)],
        "square of 40 cm": [_panel(own, "rect", **wide)],
        "speck": [_panel(own, "rect", **speck)],
        "disc": [_panel(own, "disc", **down, **radius)],
        "mesh": [{"type": "mesh", "material": "Lamp", "keys": [{"frame": 0, "radiance": 20.0}]}],
    }


def sources_of(name: str, folder: Path) -> dict[str, Sources]:
    """The sources for one of the two jobs, by name."""
    return {"kitchen": kitchen_sources, "cabin": cabin_sources}[name](folder)


def job_at(name: str, resolution: tuple[int, int]) -> Job:
    """A job of the project at a resolution."""
    return with_resolution(job_named(name, False), resolution)


def _own(name: str) -> Sources:
    """The sources of a job as its file has them."""
    return [source.model_dump(exclude_unset=True) for source in job_named(name, False).light.sources]


def _lamp(own: Source, kind: str, **values: Any) -> Source:
    return {"type": kind, "keys": [{**key, **values} for key in own["keys"]]}


def _panel(own: Source, kind: str, **values: Any) -> Source:
    """A panel along the way of a point, as bright along its normal."""
    bright = [(key, [np.pi * value for value in key["intensity"]]) for key in own["keys"]]
    keys = [{"frame": key["frame"], "position": key["position"], "power": p, **values} for key, p in bright]
    return {"type": kind, "keys": keys}
