"""The three kinds of movie of [FA], from rendered arrays: the light moves, the eye moves, both; decoded again."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny
from movies import decoded, path_file, rms

from framearray_cli.colour import srgb8_from_linear
from framearray_cli.images import read_image
from framearray_cli.job import Job
from framearray_cli.jobfile import read_job
from framearray_cli.manifest import Manifest, image_path
from framearray_cli.manifestfile import read_manifest
from framearray_cli.movie.assemble import assemble
from framearray_cli.movie.pathfile import load_movie_path
from framearray_cli.movie.timeline import timeline
from framearray_cli.render import render

pytest.importorskip("av")

JOBS = Path(__file__).resolve().parents[2] / "jobs"
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
        shots = timeline(path, load_movie_path(path), array).shots
        for suffix in containers:
            result = assemble(array.directory, path, folder / f"m{suffix}")
            movie = decoded(folder / f"m{suffix}")
            assert (len(movie.frames), result.n_frames) == (26, 26)
            assert movie.rate in (None, 24)
            for frame, shot in zip(movie.frames, shots, strict=True):
                c, l = shot.c, int(shot.positions[0])
                near = [(c + dc, l + dl) for dc, dl in ((-1, 0), (1, 0), (0, -1), (0, 1))]
                near = [(a, b) for a, b in near if 0 <= a < array.n_cameras and 0 <= b < array.n_lights]
                own = rms(frame, truth(c, l))
                assert own < min(rms(frame, truth(*other)) for other in near), (suffix, c, l)
                found[suffix].append(own)
    return found


def test_movies_of_a_tiny_room(tmp_path: Path) -> None:
    tiny.save_glb(tiny.room_meshes(), tmp_path / "tiny.glb")
    table = tiny.table(
        camera={**tiny.WALK, "resolution": [64, 48]}, light={"frames": 4}, scene={"file": str(tmp_path / "tiny.glb")}
    )
    table["light"]["sources"][0]["keys"][1]["frame"] = 3
    job = Job.model_validate({**table, "output": {"directory": str(tmp_path / "out")}})
    render(job)
    errors = check_movies(read_manifest(tmp_path / "out"), tmp_path, (".mp4", ".webp"))
    assert all(len(frames) == 3 * 26 for frames in errors.values())


@pytest.mark.slow
def test_movies_of_the_kitchen(tmp_path: Path) -> None:
    job = read_job(JOBS / "kitchen-small.toml")
    render(job.model_copy(update={"output": job.output.model_copy(update={"directory": tmp_path / "out"})}))
    for suffix, frames in check_movies(read_manifest(tmp_path / "out"), tmp_path, CONTAINERS).items():
        print(f"{suffix}: RMS of codes {np.mean(frames):.2f}, at most {np.max(frames):.2f}")
