"""`framearray init`: what it reads from a file, what it chooses, and the job that it writes."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.models.shapes import Model, block, wall
from support.program import run
from support.scenes import Glb
from support.staged import LENS, QUARTER, animate, camera, light, shift, turn_y

from framearray_cli.base.arrays import box_of
from framearray_cli.base.colour import srgb_from_linear
from framearray_cli.base.errors import JobError, OutputError, SceneError
from framearray_cli.base.forms.toml import load_toml
from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from framearray_cli.scene.paths.paths import eyes, lights
from framearray_cli.scene.scene import load_scene
from framearray_cli.starter import Start, StartOptions, init, lighting
from framearray_cli.starter.draft import round_vector, table_of
from framearray_cli.starter.lighting import CLIPPED, LUMINANCE, ROOM, solve_exposure
from framearray_cli.starter.probe import directions_around
from framearray_cli.starter.walks import OUTLINE_DIRECTIONS, outline_of

FEW = StartOptions(frames=3, lights=2)


def room() -> Glb:
    """A room of 5 x 2.5 x 4, modelled from inside, with a cupboard, a table top and a stool."""
    glb = Glb()
    glb.part("Wall", [0.7, 0.7, 0.6], block([-2.5, 0, -2], [2.5, 2.5, 2], inwards=True))
    glb.part("Cupboard", [0.5, 0.3, 0.2], block([-2.4, 0.01, -1.9], [-1.6, 2.0, -0.9]))
    glb.part('Table "top"', [0.6, 0.5, 0.3], block([0.2, 0.7, -0.8], [1.4, 0.75, 0.2]))
    glb.part("Stool", [0.2, 0.3, 0.6], block([1.5, 0.01, 0.5], [1.9, 0.5, 0.9]))
    return glb


def init_job(glb: Glb, folder: Path, options: StartOptions = FEW) -> tuple[Start, Job]:
    """Run `init`; return its choices and the job read from its file."""
    scene, job_file = glb.save(folder / "scene.glb"), folder / "job.toml"
    start = init(scene, job_file, options)
    return start, read_job(job_file)


def test_a_vector_is_rounded_to_what_a_person_would_write() -> None:
    assert round_vector([1 / 3, -1.0, 2.2e-16]) == (0.333333, -1.0, 0.0)
    assert round_vector([0.0, -0.0, 1e-9]) == (0.0, 0.0, 1e-9), "small only beside larger ones"


def test_the_text_holds_the_choices(tmp_path: Path) -> None:
    start, job = init_job(room(), tmp_path)
    expected = Job.model_validate(table_of(start) | {"output": {"directory": str(tmp_path / "out" / "job")}})
    for table in ("camera", "light", "obscurance", "indirect", "scene", "name"):
        assert getattr(job, table) == getattr(expected, table)
    assert job.indirect.method == "cells"  # docs/decisions/reuse.md
    assert job.scene.file == tmp_path / "scene.glb"
    assert job.output.directory == tmp_path / "out" / "job"  # job and folder have the name of the file


def test_many_materials_stand_at_the_end(tmp_path: Path) -> None:
    glb = room()
    for i in range(20):
        glb.part(f"Box {i}", [0.5, 0.1, 0.04 * i], block([0.2 * i - 2, 0.01, 1], [0.2 * i - 1.9, 0.1, 1.1]))
    init_job(glb, tmp_path)
    text = (tmp_path / "job.toml").read_text()
    assert "# Its 24 materials are at the end of this file." in text
    assert text.index("[camera]") < text.index("[output]") < text.index('# [scene.materials."Wall"]')
    after = text[text.index('# [scene.materials."Wall"]') :].splitlines()
    (tmp_path / "job.toml").write_text(
        text + "\n".join(line.removeprefix("# ") for line in after if line.startswith("#"))
    )
    assert len(read_job(tmp_path / "job.toml").scene.materials) == 24


def test_every_key_has_a_comment_and_every_material_is_listed(tmp_path: Path) -> None:
    init_job(room(), tmp_path)
    lines = (tmp_path / "job.toml").read_text().splitlines()
    assert lines[1] == "#   framearray render job.toml"
    bare = [line for line in lines if " = " in line and not line.startswith(("#", "  {")) and "#" not in line]
    assert bare == []
    # uncommented, the materials are what was read: the job stays valid, and the same picture
    begin = lines.index('# [scene.materials."Wall"]')
    for i in range(begin, lines.index("", begin)):
        lines[i] = lines[i].removeprefix("# ")
    (tmp_path / "job.toml").write_text("\n".join(lines))
    found = read_job(tmp_path / "job.toml").scene.materials
    assert list(found) == ["Wall", "Cupboard", 'Table "top"', "Stool"]
    assert found["Stool"].reflectivity == pytest.approx((0.2, 0.3, 0.6), abs=5e-4)
    same, read = (load_scene(tmp_path / "scene.glb", overrides, as_file=True) for overrides in (found, None))
    for name in ("reflectivity", "specular", "roughness", "metallic"):
        np.testing.assert_allclose(getattr(same, name), getattr(read, name), atol=5e-4)
    assert read.is_glossy and read_job(tmp_path / "job.toml").scene.surfaces == "file"


def test_a_room_is_walked_through_by_an_eye_that_is_in_no_furniture(tmp_path: Path) -> None:
    start, job = init_job(room(), tmp_path, StartOptions(frames=9, lights=5))
    assert start.inside and start.outside == "average"
    for points, clear in ((eyes(job).position, 0.3 / 2), (lights(job).sources[0].vector, 0.15)):
        assert (np.abs(points) < [2.5 - clear, 9, 2 - clear]).all()
        assert (points[:, 1] > clear).all() and (points[:, 1] < 2.5 - clear).all()
        for low, high in (([-2.4, 0.0, -1.9], [-1.6, 2.0, -0.9]), ([0.2, 0.7, -0.8], [1.4, 0.75, 0.2])):
            outside = np.maximum(np.array(low) - points, points - np.array(high)).max(axis=1)
            assert (outside > clear / 2).all()
    np.testing.assert_allclose(eyes(job).position[:, 1], eyes(job).position[0, 1], atol=0.2)
    assert np.linalg.norm(np.diff(eyes(job).position[[0, -1]], axis=0)) > 0.3  # it goes somewhere


def test_the_eye_of_a_house_is_in_a_room_with_a_window(tmp_path: Path) -> None:
    house, window = room(), (1.0, 3.0, 0.8, 2.0)
    sides = [wall((3, -2), (3, 2), 2.5), wall((8, -2), (8, 2), 2.5, [window])]
    sides += [wall((3, z), (8, z), 2.5) for z in (-2, 2)]
    flat = [block([3, low, -2], [8, low + 0.1, 2]) for low in (-0.1, 2.5)]
    house.part("Plaster", [0.7, 0.7, 0.7], *sides, *flat)  # it has no furniture, so its views are duller
    start, job = init_job(house, tmp_path)
    assert start.inside and (eyes(job).position[:, 0] > 3).all()


def test_a_thing_is_whole_in_every_picture(tmp_path: Path) -> None:
    thing = Glb()
    thing.part("Low", [0.7, 0.5, 0.4], block([-1, 0, -0.5], [1, 1, 0.5]))
    thing.part("High", [0.3, 0.5, 0.7], block([-0.3, 1.01, -0.3], [0.3, 2, 0.3]))
    start, job = init_job(thing, tmp_path, StartOptions(frames=7, lights=3))
    assert not start.inside and start.outside == "background"
    assert [source.type for source in job.light.sources] == ["directional"]
    corners = load_scene(tmp_path / "scene.glb")
    points = corners.corners.reshape(-1, 3) + corners.centre
    width, height = job.camera.resolution
    tall = math.tan(math.radians(job.camera.fov) / 2)
    filled = []
    for matrix in eyes(job).world_from_camera:
        local = (points - matrix[:3, 3]) @ matrix[:3, :3]
        x, y = local[:, 0] / -local[:, 2] / (tall * width / height), local[:, 1] / -local[:, 2] / tall
        assert (local[:, 2] < 0).all() and np.abs([x, y]).max() < 0.95
        filled.append(np.abs([x, y]).max())
    assert max(filled) > 0.8  # and it fills the picture
    assert (lights(job).sources[0].vector[:, 1] < -0.4).all()  # light comes from above


def test_options_override_choices(tmp_path: Path) -> None:
    start, job = init_job(room(), tmp_path, StartOptions(frames=2, lights=1, inside=False))
    assert not start.inside
    assert (job.camera.frames, job.light.frames) == (2, 1)


def test_a_room_whose_faces_are_turned_outwards_is_one_with_the_option_inside(tmp_path: Path) -> None:
    """Other programs export surfaces that face either way."""
    glb = Glb()
    glb.part("Wall", [0.7, 0.7, 0.6], block([-2.5, 0, -2], [2.5, 2.5, 2]))
    (tmp_path / "first").mkdir()
    start, _ = init_job(glb, tmp_path / "first", StartOptions(frames=2, lights=2))
    assert not start.inside
    # then only the insides of furniture are closed from their fronts
    glb.part("Cupboard", [0.5, 0.3, 0.2], block([-2.4, 0.01, -1.9], [-1.6, 2.0, -0.9], inwards=True))
    start, job = init_job(glb, tmp_path, StartOptions(frames=2, lights=2, inside=True))
    assert start.inside and len(start.camera.keys) == 2 and start.light_frames == 2, "both have free ways"
    for points in (eyes(job).position, lights(job).sources[0].vector):
        assert (np.abs(points) < [2.5, 2.5, 2]).all()
        outside = np.maximum(np.array([-2.4, 0.01, -1.9]) - points, points - np.array([-1.6, 2.0, -0.9])).max(axis=1)
        assert (outside > 0).all()


def test_nothing_is_closed_around_a_table_top(tmp_path: Path) -> None:
    glb = Glb()
    top = tiny.quad((-1, 0.7, 1), (1, 0.7, 1), (1, 0.7, -1), (-1, 0.7, -1))
    glb.part("Wood", [0.6, 0.5, 0.3], top, tiny.quad((-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)))
    with pytest.raises(SceneError, match="--inside: nothing in it looks like the inside of a room"):
        init_job(glb, tmp_path, StartOptions(frames=2, lights=1, inside=True))


def test_an_animated_camera_is_converted_frame_by_frame(tmp_path: Path) -> None:
    """The job's matrices are those of the hierarchy, a turning arm, computed by hand."""
    glb = room()
    shot = camera(glb, translation=[0.0, 1.5, 1.0])
    arm = glb.node(children=[shot])
    animate(glb, arm, "rotation", [0.0, 0.5], [[0, 0, 0, 1], [0, QUARTER, 0, QUARTER]])
    start, job = init_job(glb, tmp_path, StartOptions(lights=1))
    found = eyes(job)
    assert found.n == 13  # half a second of 24 frames, and the last
    assert found.lenses[0].fov == pytest.approx(50, abs=1e-3)
    assert tuple(job.camera.resolution) == (360, 240)
    for frame, matrix in enumerate(found.world_from_camera):
        expected = turn_y(math.pi / 2 * frame / 12) @ shift(0, 1.5, 1.0)
        np.testing.assert_allclose(matrix, expected, atol=1e-4)
    assert start.inside


def test_fewer_frames_are_spread_over_the_same_time(tmp_path: Path) -> None:
    glb = room()
    shot = camera(glb, translation=[0.0, 1.5, 0.0])
    glb.tree["scenes"][0]["nodes"].append(shot)
    animate(glb, shot, "translation", [0.0, 4.0], [[-1, 1.5, 0], [1, 1.5, 0]])
    _, job = init_job(glb, tmp_path, StartOptions(frames=5, lights=1))
    np.testing.assert_allclose(eyes(job).position[:, 0], [-1, -0.5, 0, 0.5, 1], atol=1e-6)


def test_a_camera_is_chosen_by_its_name(tmp_path: Path) -> None:
    glb = room()
    for name, x in (("Left", -1.0), ("Right", 1.0)):
        glb.node(name=name, camera=glb.add("cameras", dict(LENS)), translation=[x, 1.5, 1.5])
    _, job = init_job(glb, tmp_path, StartOptions(camera="Right", lights=1))
    assert eyes(job).position[0].tolist() == [1.0, 1.5, 1.5]
    text = (tmp_path / "job.toml").read_text()
    assert '# the file also has the camera "Left": --camera "Left"' in text
    with pytest.raises(JobError, match='got "Middle"; it has "Left", "Right"'):
        init(tmp_path / "scene.glb", tmp_path / "other.toml", StartOptions(camera="Middle"))


@pytest.mark.parametrize(
    ("double_sided", "turned", "key"), [(False, True, "hide"), (True, True, "show"), (False, False, "show")]
)
def test_backs_are_hidden_where_the_camera_sees_some(
    double_sided: bool, turned: bool, key: str, tmp_path: Path
) -> None:
    """A card in a room; by the file, walls and card are seen from their fronts only."""
    glb = room()
    card = tiny.quad((-0.4, 1.1, -0.5), (-0.4, 1.9, -0.5), (0.4, 1.9, -0.5), (0.4, 1.1, -0.5))
    glb.part("Card", [1.0, 1.0, 1.0], card if turned else card[:, ::-1], doubleSided=double_sided)
    glb.root(camera(glb, translation=[0.0, 1.5, 1.0]))
    _, job = init_job(glb, tmp_path, StartOptions(lights=1))
    assert job.scene.back_faces == key


@pytest.mark.usefixtures("obscurances")
def test_lights_of_the_file_keep_their_places_and_relative_strengths(tmp_path: Path) -> None:
    glb = room()
    lamp = glb.node(name="Lamp", **light(glb, intensity=1000.0, color=[1.0, 0.5, 0.25]))
    cone = {"innerConeAngle": 0.2, "outerConeAngle": 0.6}
    glb.node(name="Beam", translation=[-1.0, 2.0, 1.0], **light(glb, "spot", intensity=500.0, spot=cone))
    down = {"rotation": [-QUARTER, 0.0, 0.0, QUARTER]}  # -z turned to -y
    glb.node(name="Sun", **down, **light(glb, "directional", intensity=30.0))
    glb.node(name="Off", **light(glb, intensity=0.0))
    animate(glb, lamp, "translation", [0.0, 1.0], [[-1.5, 2, 1], [1.5, 2, 1]])
    _, job = init_job(glb, tmp_path, StartOptions(frames=2))
    path = lights(job)
    assert path.n == 25  # a second of 24 frames, and the last
    moving, beam, sun = path.sources
    assert [moving.kind, beam.kind, sun.kind] == ["point", "point", "directional"]
    np.testing.assert_allclose(moving.vector[:, 0], np.linspace(-1.5, 1.5, 25), atol=1e-5)
    np.testing.assert_allclose(beam.vector[0], [-1, 2, 1])
    np.testing.assert_allclose(sun.vector[0], [0, -1, 0], atol=1e-6)
    factor = moving.intensity[0, 0] / 1000
    np.testing.assert_allclose(moving.intensity[0], np.array([1000, 500, 250]) * factor, rtol=0.01)
    np.testing.assert_allclose(beam.intensity[0], 500 * factor, rtol=0.01)
    np.testing.assert_allclose(sun.intensity[0], 30 * factor, rtol=0.01)
    np.testing.assert_allclose(beam.cone.axis[0], [0, 0, -1], atol=1e-6)
    np.testing.assert_allclose(beam.cone.angles_deg[0], np.degrees([0.2, 0.6]), atol=1e-4)


def test_lights_that_light_nothing_give_way_to_chosen_ones(tmp_path: Path) -> None:
    glb = room()
    glb.node(name="Outside", translation=[0.0, 50.0, 0.0], **light(glb, intensity=1000.0))
    start, job = init_job(glb, tmp_path)
    assert "The lights of the file light nothing that its pictures show, so others were chosen." in start.about
    assert np.abs(lights(job).sources[0].vector).max() < 3


@pytest.mark.parametrize("place", [[1e13, 0.0, 0.0], [1e300, 1e300, 1e300]])
def test_lights_too_far_away_are_one_error(tmp_path: Path, place: list[float]) -> None:
    glb = room()
    glb.node(name="Far", translation=place, **light(glb, intensity=1000.0))
    with pytest.raises(SceneError, match=r"scene\.glb: its cameras or lights do not make a job: light") as caught:
        init_job(glb, tmp_path)
    assert "\n" not in str(caught.value)


def test_exposure_makes_the_mean_right_and_spares_highlights() -> None:
    def mean(factor: float, lit: Any, dark: Any) -> float:
        return float((srgb_from_linear(factor * lit + dark) @ LUMINANCE).mean())

    rng = np.random.default_rng(1)
    even, none = rng.uniform(0.4, 0.6, (1000, 3)), np.zeros((1000, 3))
    assert mean(solve_exposure(even, none, ROOM), even, none) == pytest.approx(ROOM.mean, abs=1e-4)
    assert mean(solve_exposure(1e-6 * even, none, ROOM), 1e-6 * even, none) == pytest.approx(ROOM.mean, abs=1e-4)
    dark = np.full((1000, 3), 0.05)
    assert mean(solve_exposure(even, dark, ROOM), even, dark) == pytest.approx(ROOM.mean, abs=1e-4)
    harsh = np.where(np.arange(1000)[:, None] < 100, 30.0, 1.0) * even  # a tenth lies in the sun
    clipped = ((solve_exposure(harsh, none, ROOM) * harsh).max(axis=1) > 1).mean()
    assert 0.5 * CLIPPED < clipped <= CLIPPED or mean(solve_exposure(harsh, none, ROOM), harsh, none) < 0.301
    for share, low, high in ((0.02, lighting.MOST / 2, np.inf), (0.2, 1.0, 3.0)):  # too little; at one of 12 positions
        patch = np.zeros((12, 1000, 3))
        patch[3, : round(share * 1000)] = even[: round(share * 1000)]
        assert low < solve_exposure(patch, none, ROOM) < high, "a patch that lights nothing else cannot make a mean"


@pytest.mark.parametrize(("seconds", "eyes_tried"), [(None, 1), (1.0, lighting.PICTURES)])
def test_an_animated_camera_at_rest_is_exposed_from_several_pictures(
    seconds: float | None, eyes_tried: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their mean has less noise than one of them; a camera without animation has one eye."""
    glb = room()
    shot = glb.node(camera=glb.add("cameras", dict(LENS)), translation=[0.0, 1.5, 1.0])
    if seconds is not None:
        animate(glb, shot, "translation", [0.0, seconds], [[0.0, 1.5, 1.0]] * 2)
    pixels = []

    def record(lit: Any, dark: Any, levels: lighting.Levels) -> float:
        pixels.append(len(dark))
        return solve_exposure(lit, dark, levels)

    monkeypatch.setattr(lighting, "solve_exposure", record)
    _, job = init_job(glb, tmp_path, StartOptions(lights=1))
    assert eyes(job).at_rest
    width, height = lighting.SIZE
    assert pixels == [eyes_tried * width * height]  # walls are all around


def test_an_existing_file_stays(tmp_path: Path) -> None:
    scene, job_file = room().save(tmp_path / "scene.glb"), tmp_path / "job.toml"
    job_file.write_text("mine")
    with pytest.raises(OutputError, match=r"job.toml: is there already; give another name with --output, or --force"):
        init(scene, job_file, FEW)
    assert job_file.read_text() == "mine"
    init(scene, job_file, FEW, force=True)
    assert load_toml(job_file)["name"] == "job"
    with pytest.raises(OutputError, match="expected a file, got a folder or a device; give another name"):
        init(scene, tmp_path, FEW)


def test_the_command_reports_what_it_did(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    room().save(tmp_path / "my room (1).glb")
    monkeypatch.chdir(tmp_path)
    made = run(capsys, "init", "my room (1).glb", "--frames", "2", "--lights", "3")
    assert made.code == 0 and "so it is taken for a room" in made.err
    assert made.out.startswith("my room (1).toml: 2 camera positions x 3 light positions = 6 images")
    assert read_job(tmp_path / "my room (1).toml").name == "my-room-1"
    gone = run(capsys, "init", "none.glb")
    assert gone.code == 3 and "none.glb: no such scene file" in gone.err
    assert run(capsys, "init", "my room (1).glb").code == 4
    wrong = run(capsys, "init", "my room (1).glb", "--force", "--camera", "Shot")
    assert wrong.code == 2 and 'got "Shot"; it has no camera\n1 problem; nothing was written.' in wrong.err


def test_what_no_light_shows_on_gets_a_job(tmp_path: Path) -> None:
    """Black surfaces that do not shine, and smooth chrome."""
    soot, chrome, corners = Model(), Glb(), block([-1, 0, -1], [1, 1, 1])
    soot.add("soot", (0, 0, 0), corners)
    chrome.part("Chrome", [0.9, 0.9, 0.9], corners, pbr={"metallicFactor": 1.0, "roughnessFactor": 0.0})
    for scene in (soot.save(tmp_path / "soot.obj"), chrome.save(tmp_path / "chrome.glb")):
        start = init(scene, scene.with_suffix(".toml"), FEW)
        assert lighting.UNLIT in start.about and len(start.sources) == 1
        assert 0 < max(start.background) <= 1.05


def test_glass_is_in_the_picture(tmp_path: Path) -> None:
    """A glass box beside an opaque one lies in every picture, and a scene of glass alone has pictures."""
    glb = Glb()
    clear = {"KHR_materials_transmission": {"transmissionFactor": 1.0}}
    glb.part("Glass", [1.0, 1.0, 1.0], block([2, 0, 0], [3, 2, 1]), pbr={"roughnessFactor": 0.0}, extensions=clear)
    init_job(glb, tmp_path)
    glb.part("Wood", [0.5, 0.3, 0.2], block([-1, 0, 0], [0, 1, 1]))
    (tmp_path / "both").mkdir()
    _, job = init_job(glb, tmp_path / "both")
    corners = np.array([[x, y, z] for x in (2, 3) for y in (0, 2) for z in (0, 1)])
    path = eyes(job)
    for matrix, lens in zip(path.world_from_camera, path.lenses, strict=True):
        place, depth = lens.project(job.camera.resolution, (corners - matrix[:3, 3]) @ matrix[:3, :3])
        assert (depth > 0).all() and (place >= 0).all() and (place <= job.camera.resolution).all()


def test_the_outline_reaches_as_far_as_all_corners() -> None:
    """Points in order, as triangles of a file are, and at random, so that no part can be skipped."""
    rng = np.random.default_rng(4)
    ball = rng.normal(size=(20_000, 3)) * [1.0, 3.0, 0.2]
    for points in (ball, ball[np.argsort(ball[:, 1])], ball * [1.0, 1.0, 0.0], ball[:1], ball[:3]):
        outline, directions = outline_of(points), directions_around(OUTLINE_DIRECTIONS)
        np.testing.assert_allclose(
            (outline @ directions.T).max(axis=0), (points @ directions.T).max(axis=0), atol=1e-12
        )
        np.testing.assert_array_equal(box_of(outline), [points.min(axis=0), points.max(axis=0)])
        assert (outline[:, None] == points).all(axis=2).any(axis=1).all()
