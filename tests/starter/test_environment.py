"""The image-based light of a glTF file in a first job: its panorama, what it lights, and files in its way."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.imagelights import add_light, coefficients, rgbd
from support.panoramas import irradiance
from support.scenes import Glb
from support.staged import light

from framearray_cli.array.images import read_image
from framearray_cli.base.errors import OutputError
from framearray_cli.base.openimage import FIXED_DATE
from framearray_cli.job.read import read_job
from framearray_cli.render.render import render
from framearray_cli.scene.paths.paths import lights
from framearray_cli.starter import STDOUT, StartOptions, init, planned_files, to_text

FEW = StartOptions(frames=1, resolution=(48, 36), format="exr")
MAP = "scene-environment.exr"
RED, GREEN, BLUE, BLACK = (4.0, 0.0, 0.0), (0.0, 4.0, 0.0), (0.0, 0.0, 4.0), (0.0, 0.0, 0.0)
WHITE = (4.0, 4.0, 4.0)


@pytest.fixture
def exposed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expose without pictures, whose kernels know environments and take half a minute to compile."""
    monkeypatch.setattr("framearray_cli.starter.lighting.find_factors", lambda *_: (0.5, 1.0))


def lectern() -> Glb:
    """Three quads that meet at a corner, turned to the left, to the right and upwards, in front of a camera at +z."""
    glb = Glb()
    white = glb.material("White", {"baseColorFactor": [0.8, 0.8, 0.8, 1.0]})
    left = [[-1, -1, -1], [0, -1, 0], [0, 0, 0], [-1, 0, -1]]
    right = [[0, -1, 0], [1, -1, -1], [1, 0, -1], [0, 0, 0]]
    top = [[-1, 0.02, 0], [1, 0.02, 0], [1, 1, -1], [-1, 1, -1]]
    for quad in (left, right, top):
        glb.node(glb.mesh(white, positions=np.array(quad, np.float32)))
    eye = {"type": "perspective", "perspective": {"yfov": 0.7, "aspectRatio": 4 / 3}}
    glb.node(name="Eye", translation=[0.0, 0.0, 3.0], camera=glb.add("cameras", eye))
    return glb


def lit(glb: Glb, colours: Any, **keys: Any) -> Glb:
    """Light from the six faces of a cube."""
    add_light(glb, [rgbd(np.broadcast_to(np.array(colour), (8, 8, 3))) for colour in colours], **keys)
    return glb


def start(folder: Path, glb: Glb, job: str = "scene.toml", **more: Any) -> Any:
    return init(glb.save(folder / "scene.glb"), folder / job, FEW, **more)


@pytest.mark.usefixtures("exposed")
def test_each_face_lights_what_is_turned_to_it(tmp_path: Path) -> None:
    """Irradiance by quadrature: face +x is glTF's -x, -x is its x, +y its y and -z its -z."""
    start(tmp_path, lit(lectern(), (RED, GREEN, BLUE, BLACK, BLACK, WHITE), intensity=0.5))
    job = read_job(tmp_path / "scene.toml")
    (source,) = job.light.sources
    assert source.type == "environment" and source.file == tmp_path / MAP
    assert job.scene.background == (0.0, 0.0, 0.0)
    (path,) = lights(job).sources
    around = path.environment
    assert around is not None
    np.testing.assert_allclose(around.factor, [[0.25] * 3])
    ahead, side = 0.5541, 0.1115  # irradiance under a face of radiance 1 / pi; under one behind it is 0
    for normal, expected in (
        ([-1, 0, 0], (ahead + side, side, 2 * side)),
        ([1, 0, 0], (side, ahead + side, 2 * side)),
        ([0, 1, 0], (2 * side, 2 * side, ahead + side)),
        ([0, 0, -1], (ahead + side, ahead + side, ahead + side)),
        ([0, 0, 1], (side, side, side)),
    ):
        found = irradiance(around.panorama.pixels, normal, float(around.rotation_deg[0]))
        np.testing.assert_allclose(found / (4 * np.pi), expected, atol=0.01)


@pytest.mark.slow
@pytest.mark.usefixtures("obscurances")
def test_pictures_show_what_each_face_lights(tmp_path: Path) -> None:
    """Face +x is left in the picture, -x right, +y above. What is seen of the map is black."""
    start(tmp_path, lit(lectern(), (RED, GREEN, BLUE, BLACK, BLACK, BLACK)))
    job = read_job(tmp_path / "scene.toml")
    render(job)
    picture = np.asarray(read_image(next((tmp_path / "out").rglob("*c0000.l000.exr"))), np.float64)
    left, right, top = picture[21:28, 14:22], picture[21:28, 26:34], picture[9:15, 16:32]
    for place, channel in ((left, 0), (right, 1)):
        means = place.mean(axis=(0, 1))
        assert means[channel] > 4 * means[1 - channel]
    assert top.mean(axis=(0, 1)).argmax() == 2
    assert (picture[:2] == 0).all()  # behind is -z, which is black


@pytest.mark.usefixtures("exposed")
def test_it_stands_beside_the_other_lights_of_the_file(tmp_path: Path) -> None:
    """All strengths are multiplied by one factor, with the intensity of the light among them."""
    glb = lit(lectern(), [(1.0, 1.0, 1.0)] * 6, intensity=0.5, irradianceCoefficients=coefficients(1.0))
    used = glb.tree["extensionsUsed"]
    image_based = dict(glb.tree["extensions"])
    glb.node(name="Lamp", translation=[0.0, 1.0, 2.0], **light(glb, intensity=2.0))
    glb.tree["extensionsUsed"] += used
    glb.tree["extensions"] |= image_based
    start(tmp_path, glb)
    around, lamp = read_job(tmp_path / "scene.toml").light.sources
    assert (around.type, lamp.type) == ("environment", "point")
    assert around.keys[0].intensity[0] / lamp.keys[0].intensity[0] == pytest.approx(0.25, rel=0.01)


@pytest.mark.usefixtures("exposed")
def test_a_panorama_in_the_way_is_not_replaced(tmp_path: Path) -> None:
    glb = lit(lectern(), (RED, GREEN, BLUE, RED, GREEN, BLUE))
    (tmp_path / MAP).write_bytes(b"mine")
    with pytest.raises(OutputError, match=f"{MAP}: is there already; .* --force"):
        start(tmp_path, glb)
    assert (tmp_path / MAP).read_bytes() == b"mine" and not (tmp_path / "scene.toml").exists()
    start(tmp_path, glb, force=True)
    first = (tmp_path / MAP).read_bytes()
    assert first != b"mine" and FIXED_DATE.encode() in first
    start(tmp_path, glb, job="other.toml")  # the same panorama serves another job of the scene
    assert (tmp_path / MAP).read_bytes() == first
    assert f'file = "{MAP}"' in (tmp_path / "other.toml").read_text()


@pytest.mark.usefixtures("exposed")
def test_a_job_without_a_place_has_no_environment(tmp_path: Path) -> None:
    glb = lit(lectern(), [(1.0, 1.0, 1.0)] * 6)
    found = init(glb.save(tmp_path / "scene.glb"), STDOUT, FEW)
    assert "environment.exr" not in to_text(found, STDOUT)
    assert any("the environment of the file is left out" in line for line in found.about)
    assert [file.name for file in tmp_path.iterdir()] == ["scene.glb"]


@pytest.mark.usefixtures("exposed")
def test_the_panorama_is_among_the_planned_files(tmp_path: Path) -> None:
    scene, job = lit(lectern(), (WHITE,) * 6).save(tmp_path / "scene.glb"), tmp_path / "scene.toml"
    assert planned_files(scene, job) == [job, tmp_path / MAP]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["scene.glb"]
    init(scene, job, FEW)
    assert planned_files(scene, tmp_path / "other.toml") == [tmp_path / "other.toml"], "the very panorama is there"
    assert planned_files(scene, STDOUT) == []
    (tmp_path / MAP).write_bytes(b"mine")
    with pytest.raises(OutputError, match=f"{MAP}: is there already"):
        planned_files(scene, tmp_path / "other.toml")
    assert planned_files(scene, job, force=True) == [job, tmp_path / MAP]
