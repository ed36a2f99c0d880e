"""The three kinds of movie of [FA], from rendered arrays: the light moves, the eye moves, both; decoded again."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import ROOT, tiny
from support.making import assemble_movie
from support.movies import decoded, path_file, rms

from framearray_cli.array.images import read_image
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from framearray_cli.render.render import render
from framearray_cli.tools.movie.pathfile import load_movie_path
from framearray_cli.tools.movie.timeline import make_timeline

pytest.importorskip("av")

JOBS = ROOT / "jobs"
KINDS = {
    "light": "camera = {at}\nlight = [0, -1]",
    "eye": "camera = [0, -1]\nlight = {at}",
    "both": "camera = [0, -1]\nlight = [-1, 0]",
}
CONTAINERS = (".mp4", ".webm", ".mov", ".gif", ".webp")


def check_movies(array: Manifest, folder: Path, containers: tuple[str, ...]) -> dict[str, list[float]]:
    """Cut all kinds of movie; every frame must be nearer to its own image than to every neighbour in the array.

    Returns:
        For each container the error of each frame, RMS of 8-bit codes.
    """
    found: dict[str, list[float]] = {suffix: [] for suffix in containers}
    codes: dict[tuple[int, int], Any] = {}

    def truth(c: int, l: int) -> Any:
        if (c, l) not in codes:
            codes[c, l] = srgb8_from_linear(read_image(image_path(array, c, l)))
        return codes[c, l]

    for text in KINDS.values():
        path = path_file(folder, f"[[segments]]\nframes = 26\n{text.format(at=2)}\n")
        shots = make_timeline(path, load_movie_path(path), array).shots
        for suffix in containers:
            result = assemble_movie(array.directory, path, folder / f"m{suffix}")
            movie = decoded(folder / f"m{suffix}")
            frames = movie.shown(result.fps)
            assert (len(frames), result.frames, result.fps) == (26, 26, 24)
            assert movie.rate in (None, 24)
            for frame, shot in zip(frames, shots, strict=True):
                c, l = shot.c, int(shot.positions[0])
                near = [(c + dc, l + dl) for dc, dl in ((-1, 0), (1, 0), (0, -1), (0, 1))]
                near = [(a, b) for a, b in near if 0 <= a < array.n_cameras and 0 <= b < array.n_lights]
                own = rms(frame, truth(c, l))
                assert own < min(rms(frame, truth(*other)) for other in near), (suffix, c, l)
                found[suffix].append(own)
    return found


def test_movies_of_a_tiny_room(tmp_path: Path) -> None:
    scene = tiny.save_glb(tiny.room_meshes(), tmp_path / "tiny.glb")
    [lamp] = tiny.TABLE["light"]["sources"]
    table = tiny.table(
        camera={**tiny.WALK, "resolution": [64, 48]},
        light={"frames": 4, "sources": [{**lamp, "keys": [lamp["keys"][0], {**lamp["keys"][1], "frame": 3}]}]},
        scene={"file": str(scene)},
    )
    job = Job.model_validate({**table, "output": {"directory": str(tmp_path / "out")}})
    render(job)
    errors = check_movies(read_manifest(tmp_path / "out"), tmp_path, (".mp4", ".webp"))
    assert all(len(frames) == 3 * 26 for frames in errors.values())


LAMP = {**tiny.TABLE["light"]["sources"][0], "group": "lamp", "axis": "lamp"}
SUN = {**tiny.SUN, "group": "sun"}
CURVES = """
[[segments]]
frames = 3
camera = [0, 2]
axes = { lamp = [0, 2] }
[groups.lamp]
intensity = [{ time = 0, value = 2.0 }, { time = "100%", value = 0.5 }]
color = [1.0, 0.5, 0.25]
[groups.sun]
intensity = [{ time = "50%", value = 1.0 }, { time = "100%", value = 0.0 }]
"""
FACTORS = {"lamp": [(2.0, 1.0, 0.5), (1.25, 0.625, 0.3125), (0.5, 0.25, 0.125)], "sun": [(1.0,) * 3] * 2 + [(0.0,) * 3]}


def room(folder: Path, sources: list[Any], light: dict[str, Any] | None = None) -> Manifest:
    """Render three eyes of the tiny room under a sky, with some sources."""
    tiny.save_glb(tiny.room_meshes(), folder.parent / "tiny.glb")
    table = tiny.table(
        camera=tiny.walk(3),
        scene={"file": str(folder.parent / "tiny.glb"), "background": [0.3, 0.4, 0.5]},
        reuse={"n_r": 1},
        obscurance={"outside": "background"},
        output={"directory": str(folder), "format": "exr", "compression": "none"},
    )
    table["light"] = {"sources": sources, **(light or {})}
    render(Job.model_validate(table))
    return read_manifest(folder)


def test_a_movie_lit_by_curves_is_a_render_with_those_intensities(tmp_path: Path) -> None:
    """Frame k has eye k, lamp k, and sun and lamp as bright as the curves say; the render has them at light index k."""
    grouped = room(tmp_path / "groups", [LAMP, SUN])
    assert grouped.axes == {"light": 1, "lamp": 3}
    assemble_movie(grouped.directory, path_file(tmp_path, CURVES), tmp_path / "f.#.exr")
    sources = []
    for group, power in (("lamp", "intensity"), ("sun", "irradiance")):
        lights = next(found.lights for found in grouped.groups if found.name == group)
        keys = []
        for k in range(3):
            known = {key: value for key, value in lights[k % len(lights)].sources[0].items() if key != "type"}
            keys.append({**known, "frame": k, power: (np.array(known[power]) * FACTORS[group][k]).tolist()})
        sources.append({"type": {"lamp": "point", "sun": "directional"}[group], "keys": keys})
    whole = room(tmp_path / "whole", sources)
    for k in range(3):
        made, right = read_image(tmp_path / f"f.{k}.exr"), read_image(image_path(whole, k, k))
        # half a step of 2^-10 in the array's files, in the frame and in the render
        np.testing.assert_allclose(made, right, rtol=3 * 2**-11, atol=1e-5)
        other = read_image(image_path(whole, k, (k + 1) % 3))
        assert np.abs(other - right).max() > 0.05, "the comparison can fail"


@pytest.mark.slow
def test_movies_of_the_kitchen(tmp_path: Path) -> None:
    job = read_job(JOBS / "kitchen-small.toml")
    render(job.model_copy(update={"output": job.output.model_copy(update={"directory": tmp_path / "out"})}))
    for suffix, frames in check_movies(read_manifest(tmp_path / "out"), tmp_path, CONTAINERS).items():
        print(f"{suffix}: RMS of codes {np.mean(frames):.2f}, at most {np.max(frames):.2f}")
