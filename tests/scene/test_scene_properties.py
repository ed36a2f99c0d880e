"""Any scene file gives arrays that can be rendered, or one error of one line that names the file."""

import json
import tempfile
from pathlib import Path
from random import Random

import numpy as np
import pytest
from fuzz.hostile import HOSTILE
from fuzz.mutations import BYTES, TEXT, TREE, mutate_text, mutate_tree
from fuzz.scenefiles import with_tree
from fuzz.sceneseeds import Seed, made_seeds, split_glb
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.files import read_stage
from framearray_cli.scene.scene import Scene, load_scene

SUFFIXES = ("glb", "gltf", "obj", "ply", "stl", "off", "3mf", "dae", "txt")
FEW = settings(max_examples=250, derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
SEEDS = st.integers(0, 2**32)
with tempfile.TemporaryDirectory() as scratch:
    MADE = {seed.name: seed for seed in made_seeds(Path(scratch))}
TREES = [seed for seed in MADE.values() if seed.suffix in (".glb", ".gltf")]
TEXTS = [seed for seed in MADE.values() if seed.suffix in (".obj", ".off", ".ply", ".stl") and seed.data.isascii()]


def scene_or_error(files: dict[str, bytes]) -> Scene | None:
    """Read the first of some files and check the result."""
    with tempfile.TemporaryDirectory() as folder:
        for name, data in files.items():
            (Path(folder) / name).write_bytes(data)
        file = Path(folder) / next(iter(files))
        try:
            scene = load_scene(file, memory=2**30)
            read_stage(file)
        except SceneError as error:
            assert str(error).startswith(f"{file}: ")
            assert "\n" not in str(error)
            assert len(str(error)) < 3000
            return None
    check(scene)
    return scene


def check(scene: Scene) -> None:
    """Assert that kernels can read a scene without checks of their own."""
    n, m = len(scene.corners), len(scene.material_names)
    assert n > 0
    for array in (
        scene.corners,
        scene.normals,
        scene.uvs,
        scene.colours,
        scene.reflectivity,
        scene.specular,
        scene.alpha,
    ):
        assert np.isfinite(array).all()
    for array in (scene.normals, scene.uvs, scene.colours):
        assert len(array) in (0, n)
    assert ((scene.material >= 0) & (scene.material < m)).all()
    total = scene.reflectivity + scene.specular
    assert ((total >= 0) & (total <= 1 + 1e-6)).all()
    for index in (scene.reflectivity_texture, scene.specular_texture, scene.alpha_texture):
        assert ((index >= -1) & (index < len(scene.textures))).all()
    starts, width, height = scene.textures.astype(np.int64).T
    assert ((width > 0) & (height > 0) & (starts >= 0)).all()
    assert (starts + width * height <= len(scene.texels)).all()


@pytest.mark.parametrize("name", MADE)
def test_seeds_are_whole(name: str) -> None:
    """The seeds can be read: otherwise mutations would only break what is broken already."""
    seed = MADE[name]
    assert scene_or_error({f"scene{seed.suffix}": seed.data, **seed.beside}) is not None


@FEW
@given(seed=st.sampled_from(TREES), how=st.sampled_from(sorted(TREE)), number=SEEDS)
def test_changed_trees(seed: Seed, how: str, number: int) -> None:
    tree = split_glb(seed.data)[0] if seed.suffix == ".glb" else json.loads(seed.data)
    text = json.dumps(mutate_tree(Random(number), tree, how)).encode()
    scene_or_error({f"scene{seed.suffix}": with_tree(seed.data, text), **seed.beside})


@FEW
@given(seed=st.sampled_from(TEXTS), how=st.sampled_from(sorted(TEXT)), number=SEEDS)
def test_changed_texts(seed: Seed, how: str, number: int) -> None:
    scene_or_error({f"scene{seed.suffix}": mutate_text(Random(number), seed.data, how), **seed.beside})


@FEW
@given(seed=st.sampled_from(list(MADE.values())), how=st.sampled_from(sorted(BYTES)), number=SEEDS)
def test_changed_bytes(seed: Seed, how: str, number: int) -> None:
    scene_or_error({f"scene{seed.suffix}": BYTES[how](Random(number), seed.data, MADE["room glb"].data), **seed.beside})


@FEW
@given(
    data=st.binary(max_size=200),
    suffix=st.sampled_from(["glb", "gltf", "obj", "ply", "stl", "off", "3mf", "dae", "txt"]),
)
def test_any_bytes(data: bytes, suffix: str) -> None:
    scene_or_error({f"scene.{suffix}": data})


@settings(FEW, max_examples=100)
@given(how=st.sampled_from(sorted(set(HOSTILE) - {"long texts", "millions of instances"})), number=SEEDS)
def test_files_that_were_made_to_do_harm(how: str, number: int) -> None:
    scene_or_error(HOSTILE[how](Random(number)))


def test_a_scene_that_no_kernel_can_read_would_be_seen() -> None:
    scene = scene_or_error({"scene.glb": MADE["room glb"].data})
    assert scene is not None
    scene.corners[0, 0, 0] = np.nan
    with pytest.raises(AssertionError):
        check(scene)
