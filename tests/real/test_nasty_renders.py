"""Every file of the nasty set, if there is one, gives pictures or one clear error, and no other output."""

import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from support import ROOT
from support.nasty import job_table, nasty_files
from support.program import run
from support.scenes import scenes_folder

from framearray_cli.array.images import read_image
from framearray_cli.base.errors import SceneError
from framearray_cli.scene.scene import Scene, load_scene

FILES = nasty_files(scenes_folder())
RESOLUTION = (40, 30)
AS_A_COMMAND = ("trimesh/fuze.obj", "assimp/invalid/OutOfMemory.off")


def write_job(name: str, folder: Path, surfaces: str) -> tuple[Path, Scene | None]:
    file, scene = scenes_folder() / "nasty" / name, None
    with suppress(SceneError):
        scene = load_scene(file, as_file=surfaces == "file")
    job, table = folder / "job.toml", job_table(file, scene, RESOLUTION, folder / "out")
    table["scene"]["surfaces"] = surfaces
    job.write_text(tomli_w.dumps(table))
    return job, scene


@pytest.mark.skipif(not FILES, reason="no nasty set; set FRAMEARRAY_SCENES to the folder of scenes")
def test_the_set_is_there():
    assert set(AS_A_COMMAND) <= set(FILES)


@pytest.mark.parametrize("surfaces", ["diffuse", "file"])
@pytest.mark.parametrize("name", FILES)
def test_pictures_or_a_clear_error(name, surfaces, tmp_path, capfd):
    job, scene = write_job(name, tmp_path, surfaces)
    done = run(capfd, "render", "-q", job)
    assert done.out == ""
    if scene is None:
        assert done.code == 3
        assert done.err.startswith(str(scenes_folder() / "nasty" / name))
        assert done.err.count("\n") == 1
        assert "Error" not in done.err.split("(")[0]
        return
    assert (done.code, done.err) == (0, "")
    pictures = np.array([read_image(file) for file in sorted((tmp_path / "out").glob("*.png"))])
    assert pictures.shape == (4, RESOLUTION[1], RESOLUTION[0], 3)
    # the corner shows the background; something else is in the picture, and the lamp of every other one lights it
    assert np.abs(pictures - pictures[:, :1, :1]).max(axis=(1, 2, 3)).min() > 0.02
    assert pictures[1::2].mean() > pictures[::2].mean()


@pytest.mark.parametrize("name", [name for name in AS_A_COMMAND if name in FILES])
def test_as_a_command(name, tmp_path):
    file, (job, scene) = scenes_folder() / "nasty" / name, write_job(name, tmp_path, "file")
    command = [sys.executable, "-m", "framearray_cli", "render", str(job)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=ROOT)
    assert "Traceback" not in done.stderr
    assert done.returncode == (3 if scene is None else 0)
    lines = done.stderr.splitlines()
    if scene is None:
        assert len(lines) == 1
    else:  # what was read, and the ambient light
        assert [line.partition(" ")[0] for line in lines if not line.startswith("note: ")] == [f"{file}:", "ambient"]
