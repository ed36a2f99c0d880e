"""Real scenes, if there are any: what is seen and lit agrees with shares measured by other means."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import real_jobs
from support.scenes import scenes_folder, shared_scene
from support.stages import images

from framearray_cli.array.images import read_image, read_layers
from framearray_cli.array.manifest import Manifest, image_path, layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.job.job import Job
from framearray_cli.render.render import render

SCENES = real_jobs.scene_names(scenes_folder())
# The noted shares were measured with some thousand rays, so they are known to about 0.01.
NOTED = 0.025

pytestmark = pytest.mark.skipif(not SCENES, reason="no real scenes; set FRAMEARRAY_SCENES to their folder")


def notes(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(shared_scene(f"{name}/camera.json").read_text())
    return found


def table(name: str, kind: str, out: Path, **changes: Any) -> dict[str, Any]:
    """The job of a scene, with some keys of its tables changed."""
    job = real_jobs.job_table(scenes_folder(), name, kind)
    for key, value in changes.items():
        job[key] = job.get(key, {}) | value
    job["output"]["directory"] = str(out)
    return job


def rendered(job: dict[str, Any]) -> Manifest:
    summary = render(Job.model_validate(job))
    assert not [note for note in summary.notes if "not finite" in note]
    return read_manifest(Path(job["output"]["directory"]))


def first_eye(name: str) -> dict[str, Any]:
    camera = notes(name)["camera"]
    return {"frames": 1, "keys": [{"frame": 0, "eye": camera["eye"], "target": camera["target"]}]}


def noted_lights(name: str) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """One light position per noted light, suns first: the table of a job, and the notes in that order."""
    found = notes(name)["lights"]
    suns, lamps = found["directional"], found["point"]
    sun = [{"direction": [-x for x in light["to_light"]], "irradiance": 1.0} for light in suns]
    sun += [sun[-1] | {"irradiance": 0.0}] * len(lamps)
    lamp = [{"position": light["position"], "intensity": 1.0} for light in lamps]
    lamp = [lamp[0] | {"intensity": 0.0}] * len(suns) + lamp
    sources = [
        {"type": kind, "keys": [{"frame": l} | key for l, key in enumerate(keys)]}
        for kind, keys in (("directional", sun), ("point", lamp))
    ]
    return {"frames": len(suns) + len(lamps), "sources": sources}, suns + lamps


@pytest.mark.parametrize("name", SCENES)
def test_what_is_seen_and_lit_is_what_was_noted(name, tmp_path):
    """One ray per pixel and only direct light, so that each pixel is either lit or not."""
    light, noted = noted_lights(name)
    plain = {"reuse": {"n_r": 0}, "ambient": {"intensity": 0.0}, "specular": {"depth": 0}, "scene": {"background": 0.0}}
    once = {"samples": {"hits": 1, "obscurance": 1}}
    manifest = rendered(table(name, "sun", tmp_path, camera=first_eye(name), light=light, **plain, **once))
    layers = read_layers(layers_path(manifest, 0))
    seen = layers["depth.Z"] > 0
    diffuse = seen & (np.max([layers[f"reflectivity.{letter}"] for letter in "RGB"], axis=0) > 0)
    assert seen.mean() == pytest.approx(notes(name)["camera"]["hit_fraction"], abs=NOTED)
    for l, light in enumerate(noted):
        lit = (read_image(image_path(manifest, 0, l)).max(axis=-1) > 0)[diffuse].mean()
        assert lit == pytest.approx(light.get("lit_fraction_at_camera0", lit), abs=NOTED), light
        assert lit > 0


def test_an_obj_and_a_glb_of_one_scene_look_the_same(tmp_path):
    """Both have textures the right way up and on the right surfaces."""
    small = {"camera": first_eye("modern_hall"), "samples": {"hits": 4, "obscurance": 1}, "reuse": {"n_r": 0}}
    found = []
    for name in ("modern_hall", "modern_hall_obj"):
        found.append(read_layers(layers_path(rendered(table(name, "sun", tmp_path / name, **small)), 0)))
    for channel in found[0]:
        if channel.startswith(("reflectivity", "normal", "depth")):
            # texture coordinates are rounded in the OBJ; an image upside down would differ by half its contrast
            assert np.abs(found[0][channel] - found[1][channel]).mean() < 0.02 * np.std(found[0][channel]), channel
    assert np.std(found[0]["reflectivity.R"]) > 0.1


def test_the_mirror_of_the_grey_and_white_room_shows_the_room(tmp_path):
    key = notes("grey_white_room")["camera_path"]["keyframes"][2]
    camera = {"frames": 1, "keys": [{"frame": 0, "eye": key["eye"], "target": key["target"]}]}
    shown = {}
    for depth in (0, 4):
        job = table("grey_white_room", "lamp", tmp_path / str(depth), camera=camera, specular={"depth": depth})
        shown[depth] = images(rendered(job))[0]
    black = (shown[0] == 0).all(axis=(0, -1))  # under every light
    assert 0.05 < black.mean() < 0.2
    assert (shown[4][:, black].max(axis=(0, -1)) > 0.02).mean() > 0.95
    assert np.std(shown[4][:, black]) > 0.05  # it is a picture, not a plane colour
    assert shown[4][:, ~black].mean() == pytest.approx(shown[0][:, ~black].mean(), rel=0.02)


@pytest.fixture(scope="module", params=[f"{name}-{kind}" for name in SCENES for kind in real_jobs.KINDS])
def array(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, str, Any]]:
    """The array of a scene's job, as images."""
    name, kind = request.param.rsplit("-", 1)
    yield name, kind, images(rendered(table(name, kind, tmp_path_factory.mktemp("array"))))


@pytest.mark.slow
def test_reuse_changes_only_noise(array, tmp_path):
    """The job of each scene, against the same without reuse: with as many samples, and with six times that number.

    The mean agrees. Noise is that of fewer samples, as the eyes are far apart; the ends of the path have no more of it.
    """
    name, kind, reused = array
    plain, reference = (
        images(rendered(table(name, kind, tmp_path / str(n), reuse={"n_r": 0}, samples={"hits": n, "obscurance": 5})))
        for n in (10, 64)
    )
    assert reused.mean() == pytest.approx(reference.mean(), rel=3e-3)
    assert 0.02 < reused.mean() < 1.5  # well exposed
    error, plain_error = (
        np.sqrt(((np.minimum(some, 2) - np.minimum(reference, 2)) ** 2).mean(axis=(1, 2, 3, 4)))
        for some in (reused, plain)
    )
    ratio = error / plain_error
    assert max(ratio[0], ratio[-1]) < 1.5 * np.median(ratio)
