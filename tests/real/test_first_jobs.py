"""`framearray init` and then `render`, without an edit in between: on real scenes, if any, and on broken files."""

from pathlib import Path

import numpy as np
import pytest
from support import ROOT
from support.nasty import nasty_files
from support.scenes import scenes_folder

from framearray_cli.array.images import read_codes, read_layers
from framearray_cli.array.manifest import image_path, layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.errors import SceneError
from framearray_cli.cli.main import main
from framearray_cli.job.read import read_job
from framearray_cli.starter import StartOptions, init

KINDS = (".glb", ".obj", ".stl")
REAL = sorted(file for file in scenes_folder().glob("*/*.*") if file.suffix in KINDS and file.parent.name != "nasty")
OWN = [ROOT / "jobs" / "scenes" / f"{name}.glb" for name in ("cabin", "kitchen", "stairs")]
NASTY = nasty_files(scenes_folder())
FEW = ("--frames", "5", "--lights", "3", "--quiet")
# Of 255. A recognisable picture has a mean in the middle of the scale, hardly any pixel without light, few that clip
# except in the sky, and contrast: a wall in front of the eye has a spread of 5 or less.
MEAN, BLACK, CLIPPED, SPREAD = (64, 170), 0.10, 0.10, 15


@pytest.mark.slow
@pytest.mark.parametrize("scene", [*REAL, *OWN], ids=lambda scene: scene.name)
def test_a_first_job_gives_pictures_that_one_can_recognise(scene: Path, tmp_path: Path) -> None:
    job_file = tmp_path / "job.toml"
    for command in (["init", str(scene), "-o", str(job_file), *FEW], ["render", str(job_file), "--quiet"]):
        main(command)  # raises SystemExit if it fails
    manifest = read_manifest(read_job(job_file).output.directory)
    for c in range(5):
        depth = read_layers(layers_path(manifest, c))["depth.Z"]
        surface = depth > 0
        assert surface.mean() > 0.2
        # nothing nearby fills the picture, as it does if the eye is inside a thing
        assert np.percentile(depth[surface], 50) > 0.5 * read_job(job_file).obscurance.range
        for l in range(3):
            codes = read_codes(image_path(manifest, c, l)).astype(float)[..., :3]
            assert MEAN[0] < codes.mean() < MEAN[1], (c, l)
            assert (codes.max(axis=-1) < 4)[surface].mean() < BLACK, (c, l)
            assert (codes.max(axis=-1) == 255)[surface].mean() < CLIPPED, (c, l)
            assert codes.mean(axis=-1).std() > SPREAD, (c, l)


@pytest.mark.slow
@pytest.mark.parametrize("name", NASTY)
def test_broken_files_make_a_job_or_one_clear_error(name: str, tmp_path: Path) -> None:
    job_file = tmp_path / "job.toml"
    try:
        init(scenes_folder() / "nasty" / name, job_file, StartOptions(frames=2, lights=2))
    except SceneError as error:
        assert str(error).startswith(str(scenes_folder() / "nasty" / name))
        assert "\n" not in str(error)
        assert not job_file.exists()
    else:
        read_job(job_file)
