"""Options of `framearray init`: images, groups, the sun over a place, the way up, and equal positions."""

import re
import shlex
import tomllib
from datetime import date
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.models import rooms, things
from support.models.shapes import Model, block, wall
from support.program import run
from support.scenes import Glb, png
from support.staged import animate, light

from framearray_cli.base.colour import srgb_from_linear
from framearray_cli.base.errors import JobError
from framearray_cli.base.sundays import sun_days
from framearray_cli.cli.main import main
from framearray_cli.cli.options import load_job
from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from framearray_cli.render.preview import render_preview
from framearray_cli.scene.paths.paths import lights
from framearray_cli.starter import StartOptions, SunOption, init
from framearray_cli.starter.lighting import CLIPPED_ONCE, make_sun_day

JUNE, DECEMBER = date(2026, 6, 21), date(2026, 12, 21)


def read_first_job(scene: Path, **options: object) -> Job:
    job_file = scene.parent / "first.toml"
    init(scene, job_file, StartOptions(frames=2, **options), force=True)  # type: ignore[arg-type]
    return read_job(job_file)


def lit_wall() -> Glb:
    """A wall with two lamps before it, of nearly the same name."""
    glb = Glb()
    glb.node(glb.mesh(glb.material("Wall", {"baseColorFactor": [0.5, 0.5, 0.5, 1.0]})))
    for k, name in enumerate(("Lamp 1", "Lamp/1", "Light")):
        glb.node(name=name, translation=[float(k), 0.5, 2.0], **light(glb, intensity=100.0))
    return glb


def test_size_and_format_are_in_the_job(tmp_path: Path) -> None:
    job = read_first_job(things.mug().save(tmp_path / "mug.glb"), resolution=(200, 400), format="exr", lights=1)
    assert job.camera.resolution == (200, 400)
    assert job.output.format == "exr"
    assert (job.name, job.output.directory) == ("first", tmp_path / "out" / "first")


def test_every_source_of_the_file_is_a_group_with_a_name_of_its_own(tmp_path: Path) -> None:
    scene = lit_wall().save(tmp_path / "scene.glb")
    with pytest.raises(
        JobError, match="--groups: expected --format exr or tif, as groups are added up afterwards, got"
    ):
        read_first_job(scene, groups=True, format="png")
    job = read_first_job(scene, groups=True)
    assert job.output.format == "exr"
    assert [source.group for source in job.light.sources] == ["Lamp-1", "Lamp-1-2", "Light-2"]
    assert [group.name for group in lights(job).groups] == ["Lamp-1", "Lamp-1-2", "Light-2"]
    assert all(source.group is None for source in read_first_job(scene).light.sources)


def test_lights_at_rest_have_one_position_whatever_is_asked_for(tmp_path: Path) -> None:
    start = init(lit_wall().save(tmp_path / "scene.glb"), tmp_path / "job.toml", StartOptions(frames=2, lights=12))
    assert start.light_frames == 1
    assert any("They stand still: one light position" in line for line in start.about)


def test_a_name_keeps_its_letters_without_their_accents(tmp_path: Path) -> None:
    scene = lit_wall().save(tmp_path / "scene.glb")
    assert init(scene, tmp_path / "Wohnung Süd.toml", StartOptions(frames=2)).name == "Wohnung-Sud"


def box_with(texture: str, folder: Path) -> Path:
    """An OBJ of a cube with a texture."""
    box = Model()
    box.add("wall", (0.5, 0.5, 0.5), block((0, 0, 0), (1, 1, 1)))
    scene = box.save(folder / "box.obj")
    (folder / "box.mtl").write_text(f"newmtl wall\nKd 0.5 0.5 0.5\nmap_Kd {texture}\n")
    return scene


def test_the_message_names_the_option_that_allows_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The words of the message work as they are, and the job keeps the folder; `check` accepts the same option."""
    for folder in ("shots", "my assets/walls"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "my assets" / "walls" / "brick.png").write_bytes(png(np.full((2, 2, 3), 200, np.uint8)))
    scene = box_with("../my assets/walls/brick.png", tmp_path / "shots")
    monkeypatch.chdir(tmp_path)
    arguments = ["init", str(scene), "--frames", "2"]
    refused = run(capsys, *arguments)
    found = re.search(r"allow the folder with (--folder '[^']+') \(", refused.err)
    assert refused.code == 3 and found is not None and found[1] == "--folder 'my assets'"
    main([*arguments, *shlex.split(found[1])])
    assert 'folders = ["my assets"]' in Path("box.toml").read_text()
    assert read_job(Path("box.toml")).scene.folders == (tmp_path / "my assets",)
    assert load_job(Path("box.toml"), None, None, None, [tmp_path]).scene.folders == (tmp_path / "my assets", tmp_path)
    refused = run(capsys, *arguments, "--folder", "gone")
    assert refused.code == 2 and 'expected a folder, got "gone"' in refused.err


def test_what_is_missing_beside_the_scene_is_a_note(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = run(capsys, "init", box_with("brick.png", tmp_path), "-o", tmp_path / "box.toml", "--frames", "2")
    assert made.code == 0 and "note: texture left out, brick.png: no such file next to the scene" in made.err


def test_equal_positions_of_lights_are_one(tmp_path: Path) -> None:
    """A lamp that goes there and back stands at three places, and one that is animated but at rest at one."""
    glb = lit_wall()
    nodes = glb.tree["nodes"]
    animate(glb, len(nodes) - 1, "translation", [0.0, 1.0, 2.0], [[2, 0.5, 2], [1, 0.5, 2], [2, 0.5, 2]])
    job = read_first_job(glb.save(tmp_path / "scene.glb"), lights=5)
    assert job.light.frames == 3
    still = lit_wall()
    animate(still, len(nodes) - 1, "translation", [0.0, 1.0], [[2, 0.5, 2], [2, 0.5, 2]])
    assert read_first_job(still.save(tmp_path / "scene.glb"), lights=5).light.frames == 1


@pytest.mark.usefixtures("obscurances")
def test_a_sun_over_a_place_shines_in_every_picture(tmp_path: Path) -> None:
    scene = rooms.street().save(tmp_path / "street.glb")
    job = read_first_job(scene, sun=SunOption(48.1, 11.6, (JUNE,)), lights=3)
    source, sky = job.light.sources
    assert (sky.type, sky.latitude, sky.stop) == ("sky", 48.1, source.stop)
    assert (source.type, source.latitude, source.longitude, source.date) == ("sun", 48.1, 11.6, "2026-06-21")
    found = lights(job).sources[0]
    assert (found.vector[:, 1] < -0.15).all()  # from above, and not from the horizon
    assert (found.intensity > 0).all()


def test_the_sun_through_one_window_clips_little_at_every_position(tmp_path: Path) -> None:
    """A room below eaves: the sun of the first, middle and last position lights nothing in it."""
    house, corners = Model(), [(0, 0), (5, 0), (5, 4), (0, 4), (0, 0)]
    walls = [wall(*ends, 2.7, [(1.5, 3.5, 0.8, 2.2)] if k == 2 else []) for k, ends in enumerate(pairwise(corners))]
    house.add("Plaster", (0.75, 0.75, 0.72), *walls, block([-0.5, 2.7, -0.5], [5.5, 3.0, 6.0]))
    house.add("Floor", (0.5, 0.35, 0.25), block([-0.2, -0.2, -0.2], [5.2, 0, 4.2]))
    scene, sun = house.save(tmp_path / "house.obj"), SunOption(48.1, 11.6, (JUNE,))
    job = read_first_job(scene, inside=True, up="y", resolution=(48, 36), sun=sun)
    pictures = np.stack([render_preview(job, 0, {"light": k})[0] for k in range(job.light.frames)])
    clipped = (pictures[..., 0] > 1).mean(axis=(1, 2))  # the sky, which is seen through the window, is not red
    assert clipped.max() < CLIPPED_ONCE + 0.05, "other eyes, cells and random numbers change some hundredths"
    means = srgb_from_linear(pictures).mean(axis=(1, 2, 3))
    assert means.max() > means.min() + 0.1, "the sun shows"


@pytest.mark.usefixtures("obscurances")
@pytest.mark.parametrize(("latitude", "north"), [(48.1, None), (-33.9, None), (-33.9, (1.0, 0.0, 0.0))])
def test_a_thing_is_seen_from_the_side_of_the_noon_sun(
    latitude: float, north: tuple[float, float, float] | None, tmp_path: Path
) -> None:
    scene = things.mug().save(tmp_path / "mug.glb")
    job = read_first_job(scene, sun=SunOption(latitude, 11.6, (date(2026, 9, 21),), north), lights=3)
    to_noon_sun = -lights(job).sources[0].vector[1]
    expected = np.sign(latitude) * -np.array(north or (0.0, 0.0, -1.0))  # in the south of the northern hemisphere
    assert to_noon_sun @ expected > 0.5
    for key in job.camera.keys:
        assert np.subtract(key.eye, key.target)[[0, 2]] @ to_noon_sun[[0, 2]] > 0


def test_a_north_that_is_up_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(JobError, match="--north: expected a direction across the up axis"):
        read_first_job(things.mug().save(tmp_path / "mug.glb"), sun=SunOption(0.0, 0.0, (JUNE,), (0.0, 2.0, 0.0)))


@pytest.mark.usefixtures("obscurances")
def test_a_sun_study_counts_hours_once_its_comments_are_followed(tmp_path: Path) -> None:
    """The key is a comment, as a dozen positions that leave out both ends of the day would count too few hours."""
    scene = rooms.street().save(tmp_path / "street.glb")
    file = tmp_path / "street.toml"
    init(scene, file, StartOptions(frames=1, resolution=(32, 24), sun=SunOption(48.1, 11.6, (JUNE,))))
    text = file.read_text(encoding="utf-8")
    assert not read_job(file).output.sun_hours
    before, table, rest = text.partition("\n[light]\n")
    text = before + table + re.sub("frames = .*\n", "", rest, count=1)
    for key in ("step", "sun_hours"):
        assert text.count(f"\n# {key} = ") == 1
        text = text.replace(f"\n# {key} = ", f"\n{key} = ")
    file.write_text(text, encoding="utf-8")
    job = read_job(file)
    (day,) = job.sun_days
    assert day.step_h == 0.25 and len(day.lights) == job.light.frames > 40


@pytest.mark.parametrize(
    ("latitude", "dates", "problem"),
    [
        (80.0, ["2026-12-21"], "a day on which the sun rises, got 2026-12-21 at latitude 80"),
        (80.0, ["2026-06-21", "2026-12-21"], "a day on which the sun rises, got 2026-12-21 at latitude 80"),
        # the last and the first day with a sun, 11:42 to 11:48 and 11:49 to 12:36: noon depends on the season
        (71.04, ["2026-11-19", "2027-01-23"], "daylight at a common time of day, got 2026-11-19, 2027-01-23"),
    ],
)
def test_days_without_daylight_are_an_error(latitude: float, dates: list[str], problem: str) -> None:
    with pytest.raises(JobError, match=f"--sun: expected {problem}"):
        make_sun_day(SunOption(latitude, 0.0, tuple(map(date.fromisoformat, dates))), Path("scene.glb"))


@pytest.mark.usefixtures("obscurances")
@pytest.mark.parametrize(("asked", "n"), [(None, 24), (3, 4), (4, 4)])
def test_several_days_have_equally_many_positions(asked: int | None, n: int, tmp_path: Path) -> None:
    """The sun is up at all of them: the times of the short day are those of the long one."""
    scene = rooms.street().save(tmp_path / "street.glb")
    job = read_first_job(scene, sun=SunOption(41.9, -87.6, (JUNE, DECEMBER)), lights=asked)
    source, _ = job.light.sources
    assert source.date == ("2026-06-21", "2026-12-21")
    assert "\nframes = " in (tmp_path / "first.toml").read_text().partition("[light]")[2]
    assert job.light.frames == n
    days = sun_days(job.light.moments["light"])
    assert [len(day.lights) for day in days] == [n // 2, n // 2]
    assert (lights(job).sources[0].intensity > 0).all()


@pytest.mark.usefixtures("obscurances")
def test_a_step_determines_the_number_of_positions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The key `frames` is left out; `check` accepts the job, with hours of sun once the comments are followed."""
    monkeypatch.chdir(tmp_path)
    rooms.street().save(tmp_path / "street.glb")
    main(["init", "street.glb", "--frames", "2", "--sun", "41.9,-87.6,2026-06-21,2026-12-21", "--step", "15"])
    text = Path("street.toml").read_text(encoding="utf-8")
    assert "frames" not in tomllib.loads(text)["light"] and "# step" not in text
    job = read_job(Path("street.toml"))
    days = sun_days(job.light.moments["light"])
    assert [(day.step_h, len(day.lights)) for day in days] == [(0.25, job.light.frames // 2)] * 2
    assert f"2 camera positions x {job.light.frames} light positions" in capsys.readouterr().out
    assert f"# {job.light.frames} positions of the light" in text
    assert text.count("\n# sun_hours = ") == 1 and "`frames` of [light]" not in text
    Path("street.toml").write_text(text.replace("\n# sun_hours = ", "\nsun_hours = "), encoding="utf-8")
    main(["check", "street.toml"])
    assert f"sun: 2026-12-21 08:11 to 15:26: light positions {len(days[0].lights)}-" in capsys.readouterr().out


@pytest.mark.usefixtures("obscurances")
@pytest.mark.parametrize("up", ["y", "z"])
def test_degrees_of_north_turn_it_clockwise(up: str, tmp_path: Path) -> None:
    """Seen from above: at 90 degrees it points along x, where east is by default."""
    scene = saved(TOWER, tmp_path / "tower.obj", up)
    for name, north in (("degrees", "90"), ("vector", "1,0,0")):
        job = tmp_path / f"{name}.toml"
        main(["init", str(scene), "-o", str(job), "--up", up, "--sun", "41.9,0,2026-06-21", "--north", north])
    degrees, known = (read_job(tmp_path / name) for name in ("degrees.toml", "vector.toml"))
    assert degrees.light.sources[0].north == known.light.sources[0].north == (1.0, 0.0, 0.0)
    assert degrees.camera == known.camera
    assert (lights(degrees).sources[0].vector == lights(known).sources[0].vector).all()


def test_no_degrees_are_the_default_north() -> None:
    sun = SunOption(0.0, 0.0, (JUNE,), 0.0)
    assert [sun.with_axis(up).north for up in ("y", "z")] == [(0.0, 0.0, -1.0), (0.0, 1.0, 0.0)]


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ("--north 0", "--north: needs --sun"),
        ("--step 15", "--step: needs --sun"),
        ("--sun 1,2,2026-06-21 --step 15 --lights 3", "--step: does not go with --lights"),
        ("--resolution 640", "expected width and height of 1 to 16384 pixels, such as 640x480, got"),
        ("--resolution 0x99999", "expected width and height of 1 to 16384 pixels"),
        ("--sun 48.1,11.6", "expected latitude, longitude and one or more dates, such as 48.1,11.6,2026-06-21, got"),
        ("--sun 91,0,2026-06-21", "expected a latitude from -90 to 90 and a longitude from -180 to 180, got"),
        ("--sun 1,2,2026-02-30", "expected latitude, longitude and one or more dates"),
        ("--sun 1,2,2026-06-21,", "expected latitude, longitude and one or more dates"),
        ("--sun 1,2,2026-06-21,2026-06-21", "expected different dates, got"),
        ("--north 1,2", "expected degrees from -360 to 360, or a direction of the scene such as 0,0,-1, got"),
        ("--north 361", "expected degrees from -360 to 360, or a direction"),
        ("--north nan", "expected degrees from -360 to 360, or a direction"),
        ("--step 0", "expected a number from 1 to 1440, got"),
        ("--format gif", "expected png, exr, tif or jpg, got"),
        ("--up x", "expected y or z"),
    ],
)
def test_values_that_make_no_job(
    options: str, problem: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = things.mug().save(tmp_path / "mug.glb")
    refused = run(capsys, "init", scene, "-o", tmp_path / "job.toml", *options.split())
    assert refused.code == 2 and problem in refused.err
    assert not (tmp_path / "job.toml").exists()


TOWER = (([-1, 0, -0.5], [1, 1, 0.5]), ([-0.3, 1, -0.3], [0.3, 2, 0.3]))
LEGS = tuple(([x, 0, z], [x + 0.1, 0.7, z + 0.1]) for x in (-0.6, 0.5) for z in (-0.4, 0.3))
TABLE = (([-1, 0.7, -0.8], [1, 0.75, 0.8]), *LEGS)


def saved(boxes: tuple[tuple[list[float], list[float]], ...], file: Path, up: str) -> Path:
    """Save boxes, whose y points up, as an OBJ that does not say so; with z up they are turned."""
    model = Model()
    model.add("Wood", (0.5, 0.5, 0.5), *(block(low, high) for low, high in boxes))
    return model.save(file, up=up)


def test_a_model_with_z_up_is_walked_around_as_one_with_y_up(tmp_path: Path) -> None:
    options = {"y": StartOptions(frames=4, lights=1), "z": StartOptions(frames=4, lights=1, up="z")}
    files = {up: saved(TOWER, tmp_path / f"{up}.obj", up) for up in options}
    shots = {up: init(files[up], tmp_path / f"{up}.toml", options[up]) for up in options}
    assert {up: start.up for up, start in shots.items()} == {"y": "y", "z": "z"}
    assert "z is taken for up, as --up asks for." in shots["z"].about
    level, turned = (np.array([(key["eye"], key["target"]) for key in shots[up].camera.keys]) for up in options)
    assert turned == pytest.approx(level[..., [0, 2, 1]] * (1.0, -1.0, 1.0), abs=1e-3)


@pytest.mark.parametrize("overruled", [False, True])
@pytest.mark.parametrize(("name", "up", "usual"), [("table.obj", "z", "y"), ("tower.stl", "y", "z")])
def test_a_guess_can_be_overruled(
    name: str, up: str, usual: str, overruled: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A table stands on its feet, and a tower on its base."""
    scene, job = saved(TABLE if name == "table.obj" else TOWER, tmp_path / name, up), tmp_path / "job.toml"
    main(["init", str(scene), "-o", str(job), "--frames", "2", *(["--up", usual] if overruled else [])])
    said = capsys.readouterr().err
    assert (f"{up} is taken for up; --up {usual} says otherwise." in said) == (not overruled)
    assert f'up = "{usual if overruled else up}"' in job.read_text()
