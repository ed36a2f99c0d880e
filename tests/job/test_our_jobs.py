"""The project's own jobs and scenes: their properties, and that their generators reproduce them."""

import importlib
import math
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from support import ROOT
from support.scenes import area_vectors

from framearray_cli.base.arrays import Float64
from framearray_cli.base.forms.toml import load_toml
from framearray_cli.base.openimage import read_environment
from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from framearray_cli.scene.paths.paths import eyes, lights
from framearray_cli.scene.scene import Scene, load_scene

JOBS = ROOT / "jobs"
ROOMS = ("cabin", "kitchen", "stairs")
SCENES = (*ROOMS, "furnace")
WALKS = (
    "smoke",
    "kitchen-sun",
    "kitchen-sky",
    "kitchen-dome",
    "kitchen-gloss",
    *(f"{room}{size}" for room in ROOMS for size in ("", "-small")),
)
FURNACES = ("furnace-20", "furnace-50", "furnace-80")
CLEARANCE = 0.15  # metres between an eye and the nearest surface
LAMP_CLEARANCE = 0.25  # metres; a nearer lamp would burn a white spot into a surface
STEP, TURN_DEG = 0.12, 4.0  # metres, degrees between neighbouring eyes, so that they share most of what they see
ROUNDING = 3e-5  # metres; points are rounded to 1e-5 m when they are written


@pytest.fixture(scope="module")
def make() -> Iterator[Callable[[str, Path], None]]:
    """Make one of the scenes, by name, as a file."""
    sys.path.insert(0, str(JOBS.parent))
    yield importlib.import_module("jobs.generators.__main__").make
    sys.path.remove(str(JOBS.parent))
    for name in [name for name in sys.modules if name.split(".")[0] == "jobs"]:
        del sys.modules[name]


@cache
def job(name: str) -> Job:
    return read_job(JOBS / f"{name}.toml")


@cache
def scene(name: str) -> Scene:
    return load_scene(JOBS / "scenes" / f"{name}.glb")


def distance(point: Float64, corners: Float64) -> float:
    """Distance from a point to the nearest of n triangles (n, 3, 3), or 1 where none is nearer than 1."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    box_vec = np.maximum(np.maximum(low - point, point - high), 0.0)
    near = corners[(box_vec**2).sum(axis=1) < 1.0]
    nearest = trimesh.triangles.closest_point(near, np.broadcast_to(point, (len(near), 3)))
    return float(np.linalg.norm(nearest - point, axis=1).min(initial=1.0))


def blocked(start: Float64, end: Float64, corners: Float64) -> bool:
    """Whether a triangle crosses the segment between two points."""
    ray_vec = end - start
    edge_1, edge_2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(ray_vec, edge_2)
    det = (edge_1 * p).sum(axis=1)
    det = np.where(np.abs(det) < 1e-18, np.inf, det)
    s = start - corners[:, 0]
    u = (s * p).sum(axis=1) / det
    q = np.cross(s, edge_1)
    v, t = (ray_vec * q).sum(axis=1) / det, (edge_2 * q).sum(axis=1) / det
    return bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1)).any())


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in ("kitchen", "stairs") else name for name in SCENES]
)
def test_a_generator_makes_the_same_file_each_time(
    make: Callable[[str, Path], None], name: str, tmp_path: Path
) -> None:
    files = [tmp_path / f"{i}.glb" for i in range(2)]
    for file in files:
        make(name, file)
    assert files[0].read_bytes() == files[1].read_bytes()
    # the last bits of sines and coded pictures depend on the machine: compare the committed file by value
    made, committed = load_scene(files[0]), scene(name)
    assert made.material_names == committed.material_names
    np.testing.assert_array_equal(made.material, committed.material)
    np.testing.assert_allclose(made.corners + made.centre, committed.corners + committed.centre, rtol=0, atol=ROUNDING)
    np.testing.assert_array_equal(made.reflectivity, committed.reflectivity)
    np.testing.assert_array_equal(made.textures, committed.textures)
    if len(made.texels):
        assert np.abs(made.texels.astype(float) - committed.texels).mean() < 0.5  # of 255


def test_one_command_makes_a_scene(tmp_path: Path) -> None:
    file = tmp_path / "ball.glb"
    command = [sys.executable, "-m", "jobs.generators", "furnace", str(file)]
    subprocess.run(command, cwd=JOBS.parent, check=True)
    assert file.read_bytes()[:4] == b"glTF"


def test_the_sky_is_what_its_generator_makes_with_the_sun_in_the_middle(
    make: Callable[[str, Path], None], tmp_path: Path
) -> None:
    made = tmp_path / "sky.exr"
    make("sky", made)
    sky, _ = read_environment(JOBS / "scenes" / "sky.exr")
    np.testing.assert_allclose(read_environment(made)[0], sky, rtol=2**-10)  # one step of half
    height, width, _ = sky.shape
    elevation = np.pi * (0.5 - (np.arange(height) + 0.5) / height)
    solid_angle = np.cos(elevation)[:, None, None] * (np.pi / height) ** 2
    sun = sky > 100 * sky.mean()
    np.testing.assert_allclose((sky * sun * solid_angle).sum(axis=(0, 1)), [24.0, 21.5, 18.0], rtol=0.01)
    rows, columns = np.nonzero(sun.any(axis=-1))
    assert np.degrees(elevation[rows]).mean() == pytest.approx(35.0, abs=0.1)
    assert columns.mean() == pytest.approx((width - 1) / 2)


def test_the_folder_of_scenes_holds_only_scenes_and_a_sky() -> None:
    names = {file.name for file in (JOBS / "scenes").iterdir() if file.is_file()}
    assert names == {"sky.exr", *(f"{name}.glb" for name in SCENES)}


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_has_what_the_paper_asks_for(name: str) -> None:
    room = scene(name)
    assert 20_000 <= room.report.triangles <= 150_000
    assert room.report.dropped == {}
    assert room.report.notes == ()
    assert room.report.textures >= 1
    assert room.has_mirrors
    assert all(re.fullmatch("[A-Z][A-Za-z]+", material) for material in room.material_names)
    assert set(range(len(room.material_names))) == set(room.material.tolist())
    assert (JOBS / "scenes" / f"{name}.glb").stat().st_size < 6e6


@pytest.mark.parametrize("name", ROOMS)
def test_reflectivities_are_believable(name: str) -> None:
    room = scene(name)
    plain = (room.reflectivity_texture < 0) & (room.specular.max(axis=1) == 0)
    assert float(room.reflectivity[plain].max()) <= 0.9
    assert float(room.reflectivity[plain].min()) >= 0.02
    span = room.reflectivity[plain].mean(axis=1)
    assert span.min() < 0.25 and span.max() > 0.7


@pytest.mark.parametrize(("name", "n_c"), [("cabin", 192), ("kitchen", 288), ("stairs", 144)])
def test_the_three_jobs_have_the_sizes_of_the_paper(name: str, n_c: int) -> None:
    main = job(name)
    assert (main.camera.frames, main.light.frames) == (n_c, 48)
    assert tuple(main.camera.resolution) == (400, 300)
    assert (main.samples.hits, main.samples.obscurance, main.reuse.n_r) == (2, 5, 3)
    assert main.light.sources[0].type == ("point" if name == "cabin" else "directional")


@pytest.mark.parametrize("name", WALKS)
def test_eyes_walk_smoothly_and_keep_clear_of_every_surface(name: str) -> None:
    path = eyes(job(name))
    assert np.linalg.norm(np.diff(path.position, axis=0), axis=1).max() < STEP
    look_dir = -path.world_from_camera[:, :3, 2]
    turn = np.degrees(np.arccos(np.clip((look_dir[1:] * look_dir[:-1]).sum(axis=1), -1, 1)))
    assert turn.max() < TURN_DEG
    room = load_room(name)
    every = 3  # three steps are far shorter than the clearance that the eyes have
    assert min(distance(eye, room) for eye in path.position[::every]) > CLEARANCE + STEP


def load_room(name: str) -> Float64:
    """Corners (n, 3, 3) of a job's scene, in the file's own coordinates."""
    room = scene(job(name).scene.file.stem)
    return room.corners.astype(np.float64) + room.centre


@pytest.mark.parametrize("name", ["cabin", "cabin-small"])
def test_the_lamp_hangs_free_and_is_seen_from_the_aisle(name: str) -> None:
    corners = load_room(name)
    lamp = lights(job(name)).sources[0].vector
    assert min(distance(position, corners) for position in lamp) > LAMP_CLEARANCE
    assert not any(blocked(a, b, corners) for a, b in pairwise(lamp))
    eye = eyes(job(name)).position[0]
    assert not any(blocked(eye, position, corners) for position in lamp[:: max(1, len(lamp) // 8)])


def test_distance_and_blocked_can_fail() -> None:
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    assert distance(np.array([0.2, 0.2, 0.1]), corners) == pytest.approx(0.1)
    assert distance(np.array([-0.3, 0.5, 0.0]), corners) == pytest.approx(0.3)
    assert distance(np.array([0.8, 0.8, 0.0]), corners) == pytest.approx(math.sqrt(0.18))
    assert distance(np.array([0.2, 0.2, 9.0]), corners) == 1.0
    assert blocked(np.array([0.2, 0.2, 1.0]), np.array([0.2, 0.2, -1.0]), corners)
    assert not blocked(np.array([0.8, 0.8, 1.0]), np.array([0.8, 0.8, -1.0]), corners)


def test_the_furnace_is_a_sphere() -> None:
    sphere = scene("furnace").corners.astype(np.float64) + scene("furnace").centre
    assert np.linalg.norm(area_vectors(sphere), axis=1).sum() == pytest.approx(4 * math.pi, rel=1e-6)
    assert np.abs(np.linalg.norm(sphere, axis=2) - 1).max() < 1e-4
    assert np.abs(np.linalg.norm(sphere.mean(axis=1), axis=1) - 1).max() < 1e-4


@pytest.mark.parametrize("name", FURNACES)
def test_the_answers_in_the_furnace_jobs_are_right(name: str) -> None:
    furnace = job(name)
    reflectivity = furnace.scene.materials["Wall"].reflectivity
    assert reflectivity is not None
    r = reflectivity[0]
    assert reflectivity == (r, r, r) and f"-{round(100 * r)}" in name
    assert furnace.obscurance.falloff == "constant" and furnace.obscurance.range < 0.02
    intensity = lights(furnace).sources[0].intensity
    np.testing.assert_array_equal(intensity, 1.0)
    text = (JOBS / f"{name}.toml").read_text()
    irradiance = 4 * math.pi / (4 * math.pi * (1 - r))
    expected = {
        "R": r,
        "E": irradiance,
        "I_A": irradiance / math.pi,
        "W = R": r,
        "R I_A W": r * r * irradiance / math.pi,
        "R E / pi": r * irradiance / math.pi,
    }
    for quantity, value in expected.items():
        found = re.search(rf"^#.*\b{re.escape(quantity)} (?:=.*)?= ([0-9.]+)", text, re.MULTILINE)
        found = found or re.search(rf"^#.*  {re.escape(quantity)} = ([0-9.]+)", text, re.MULTILINE)
        assert found, quantity
        assert float(found[1]) == pytest.approx(value, abs=6e-7), quantity  # six decimals are printed


def test_every_job_file_can_be_read_and_has_its_scene() -> None:
    names = {file.stem for file in JOBS.glob("*.toml") if "scene" in load_toml(file)}
    assert set(WALKS) | set(FURNACES) <= names
    for name in names:
        assert job(name).scene.file.is_file(), name
