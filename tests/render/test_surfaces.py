"""`scene.surfaces`: what an array is of, and what messages say."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.scenes import QUAD_UVS, Glb, png

from framearray_cli.job.job import Job
from framearray_cli.render.identity import job_fingerprint, scene_fingerprint
from framearray_cli.render.prepare import prepare


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    glb = Glb()
    image = {"index": glb.texture(png(tiny.bumps()[..., :3]))}
    glb.node(glb.mesh(glb.material("Wall", normalTexture=image), TEXCOORD_0=glb.accessor(QUAD_UVS)))
    return glb.save(tmp_path / "wall.glb")


def job(scene: Path, surfaces: Any = None) -> Job:
    return tiny.job(scene={"file": str(scene)} | ({"surfaces": surfaces} if surfaces else {}))


def test_an_array_of_other_surfaces_is_another_array(scene: Path) -> None:
    plain, diffuse, by_file = (prepare(job(scene, kind)) for kind in (None, "diffuse", "file"))
    assert job_fingerprint(plain) == job_fingerprint(diffuse) != job_fingerprint(by_file)
    assert scene_fingerprint(plain) != scene_fingerprint(by_file)
    by_file.scene.tangents[0, 0, 0] += np.float32(0.5)
    changed = prepare(job(scene, "file"))
    assert scene_fingerprint(by_file) != scene_fingerprint(changed)


def test_diffuse_surfaces_compile_nothing_for_maps(scene: Path) -> None:
    assert prepare(job(scene)).relief == ()
    assert len(prepare(job(scene, "file")).relief.tangents) == 2


def test_another_word_is_refused() -> None:
    with pytest.raises(ValueError, match="'diffuse' or 'file'"):
        tiny.job(scene={"surfaces": "glossy"})
