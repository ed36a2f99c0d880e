"""The dome of a USD file in a first job: its panorama, what it lights, and files in its way."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.panoramas import irradiance
from support.usdfiles import mesh, new_stage, pxr, save

from framearray_cli.base.errors import OutputError
from framearray_cli.base.openimage import FIXED_DATE, write_environment
from framearray_cli.job.read import read_job
from framearray_cli.scene.paths.paths import lights
from framearray_cli.starter import STDOUT, StartOptions, init, planned_files, to_text

FEW = StartOptions(frames=1, resolution=(48, 36), format="exr")
MAP = "scene-environment.exr"


@pytest.fixture
def exposed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expose without pictures, whose kernels know environments and take half a minute to compile."""
    monkeypatch.setattr("framearray_cli.starter.lighting.find_factors", lambda *_: (0.5, 1.0))


def lit(folder: Path) -> Path:
    """A rectangle before a camera, lit by a dome that is red in the west, and by a lamp."""
    stage = new_stage(folder / "scene.usda")
    mesh(stage, "/World/Square")
    library = pxr()
    library.UsdGeom.XformCommonAPI(library.UsdGeom.Camera.Define(stage, "/World/Eye")).SetTranslate((1, 1, 9))
    pixels = np.full((16, 32, 3), 4.0, np.float32)
    pixels[:, :16] = (4.0, 0.0, 0.0)  # longitudes 0 to pi: +x of the light
    write_environment(folder / "sky.exr", pixels)
    dome = library.UsdLux.DomeLight_1.Define(stage, "/World/Dome")
    dome.CreateTextureFileAttr("./sky.exr")
    dome.CreateIntensityAttr(0.5)
    library.UsdLux.SphereLight.Define(stage, "/World/Lamp").CreateRadiusAttr(0.1)
    return save(stage)


def start(folder: Path, job: str = "scene.toml", **more: Any) -> Any:
    return init(folder / "scene.usda", folder / job, FEW, **more)


@pytest.mark.usefixtures("exposed")
def test_a_dome_lights_what_is_turned_to_it_beside_a_lamp(tmp_path: Path) -> None:
    lit(tmp_path)
    start(tmp_path)
    job = read_job(tmp_path / "scene.toml")
    assert sorted(source.type for source in job.light.sources) == ["environment", "point"]
    assert job.scene.background == (0.0, 0.0, 0.0)
    around = next(path.environment for path in lights(job).sources if path.environment is not None)
    found = {x: irradiance(around.panorama.pixels, [x, 0, 0], float(around.rotation_deg[0])) for x in (-1, 1)}
    assert found[1][1] < 0.01 * found[1][0] and found[-1][1] == pytest.approx(found[-1][0])


@pytest.mark.usefixtures("exposed")
def test_a_panorama_in_the_way_is_not_replaced(tmp_path: Path) -> None:
    lit(tmp_path)
    (tmp_path / MAP).write_bytes(b"mine")
    with pytest.raises(OutputError, match=f"{MAP}: is there already; .* --force"):
        start(tmp_path)
    assert (tmp_path / MAP).read_bytes() == b"mine" and not (tmp_path / "scene.toml").exists()
    start(tmp_path, force=True)
    first = (tmp_path / MAP).read_bytes()
    assert first != b"mine" and FIXED_DATE.encode() in first
    start(tmp_path, job="other.toml")  # the same panorama serves another job of the scene
    assert (tmp_path / MAP).read_bytes() == first
    assert f'file = "{MAP}"' in (tmp_path / "other.toml").read_text()


@pytest.mark.usefixtures("exposed")
def test_a_job_without_a_place_has_no_environment(tmp_path: Path) -> None:
    found = init(lit(tmp_path), STDOUT, FEW)
    assert "environment.exr" not in to_text(found, STDOUT)
    assert any("the environment of the file is left out" in line for line in found.about)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["scene.usda", "sky.exr"]


@pytest.mark.usefixtures("exposed")
def test_the_panorama_is_among_the_planned_files(tmp_path: Path) -> None:
    scene, job = lit(tmp_path), tmp_path / "scene.toml"
    assert planned_files(scene, job) == [job, tmp_path / MAP]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["scene.usda", "sky.exr"]
    init(scene, job, FEW)
    assert planned_files(scene, tmp_path / "other.toml") == [tmp_path / "other.toml"], "the very panorama is there"
    assert planned_files(scene, STDOUT) == []
    (tmp_path / MAP).write_bytes(b"mine")
    with pytest.raises(OutputError, match=f"{MAP}: is there already"):
        planned_files(scene, tmp_path / "other.toml")
    assert planned_files(scene, job, force=True) == [job, tmp_path / MAP]
