"""IFC: units, names, styles, glass, rooms, and the sun of the site."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from support import ifchouse
from support.program import run
from support.scenes import shared_scene

from framearray_cli.array.images import read_layers
from framearray_cli.array.manifest import layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.colour import linear_from_srgb
from framearray_cli.base.errors import SceneError
from framearray_cli.job.read import read_job
from framearray_cli.scene.files import read_stage
from framearray_cli.scene.paths.paths import lights
from framearray_cli.scene.scene import load_scene


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ifchouse.house(tmp_path_factory.mktemp("ifc") / "house.ifc")


def test_elements_have_metres_names_and_colours(house: Path) -> None:
    scene = load_scene(house, as_file=True)
    np.testing.assert_allclose(scene.corners.min(axis=(0, 1)) + scene.centre, (0, 0, -0.2), atol=1e-6)
    np.testing.assert_allclose(scene.corners.max(axis=(0, 1)) + scene.centre, (5, 4, 2.7), atol=1e-6)
    assert len(scene.corners) == 12 * len(ifchouse.WALLS)
    assert {f"Ground/{name}" for name in ifchouse.WALLS} <= set(scene.object_names)
    brick = scene.reflectivity[scene.material_names.index("Brick")]
    np.testing.assert_allclose(brick, linear_from_srgb(np.array(ifchouse.BRICK)), rtol=1e-5)


def test_transparent_styles_are_glass(house: Path) -> None:
    """Light passes both faces of a pane."""
    scene = load_scene(house, as_file=True)
    assert len(scene.pane_corners) == 12
    np.testing.assert_allclose(scene.pane_optics[:, :3] ** 2, 0.81, atol=1e-6)
    plain = load_scene(house)
    assert len(plain.pane_corners) == 0 and plain.report.dropped == {"transmissive": 12}


def test_the_site_and_the_rooms(house: Path) -> None:
    stage = read_stage(house)
    assert stage.earth is not None and (stage.up, stage.metres) == ("z", 1.0)
    assert (stage.earth.latitude, stage.earth.longitude) == pytest.approx((48 + 8 / 60 + 15 / 3600, 11.575))
    np.testing.assert_allclose(stage.earth.north, (-0.5, 3**0.5 / 2, 0), atol=1e-9)
    assert [room.name for room in stage.rooms] == ["01 Hall", "Ground"]
    for name in ("01 hall", "HALL", "01", "ground"):
        room = stage.room(name)
        assert room is not None
        np.testing.assert_allclose(room.box, np.array(ifchouse.HALL) / 1000, atol=1e-6)
    assert stage.room("garage") is None


def test_without_true_north_the_north_of_the_map_counts(tmp_path: Path) -> None:
    made = ifchouse.House()
    made.box("IfcWall", "wall", ((0, 0, 0), (1, 1, 1)))
    made.context.TrueNorth = None
    target = made.file.create_entity("IfcProjectedCRS", "EPSG:25832")
    made.file.create_entity("IfcMapConversion", made.context, target, 5e5, 5e6, 0.0, 0.8, 0.6)
    made.file.write(str(tmp_path / "map.ifc"))
    earth = read_stage(tmp_path / "map.ifc").earth
    # x points to (0.8, 0.6) of the map, y to (-0.6, 0.8)
    assert earth is not None and earth.north == pytest.approx((0.6, 0.8, 0.0))


def test_a_first_job_is_the_sun_study_of_its_place(house: Path, tmp_path: Path, capsys, monkeypatch) -> None:
    """Height and azimuth of the sun against an almanac, to 0.1 degrees."""
    pvlib = pytest.importorskip("pvlib", reason="the almanac")
    pandas = pytest.importorskip("pandas", reason="the almanac's times")
    monkeypatch.chdir(tmp_path)
    assert run(capsys, "init", house, "--room", "hall", "-o", "house.toml").code == 0
    text = Path("house.toml").read_text()
    assert "The file says where it stands" in text
    job = read_job(tmp_path / "house.toml")
    assert (job.scene.up, job.light.sources[0].type) == ("z", "sun")
    eyes = np.array([key["eye"] for key in tomllib.loads(text)["camera"]["keys"]])
    assert ((eyes > np.array(ifchouse.HALL[0]) / 1000) & (eyes < np.array(ifchouse.HALL[1]) / 1000)).all()
    (sun,) = lights(job).sources
    times = pandas.DatetimeIndex([sun.table(l)["time"] for l in range(job.light.frames)])
    found = pvlib.solarposition.get_solarposition(times, 48 + 8 / 60 + 15 / 3600, 11.575, altitude=0)
    to_sun = -sun.vector
    turn = np.radians(ifchouse.NORTH_DEG)
    north, east = np.array([-np.sin(turn), np.cos(turn), 0]), np.array([np.cos(turn), np.sin(turn), 0])
    azimuth = np.degrees(np.arctan2(to_sun @ east, to_sun @ north)) % 360
    height = np.degrees(np.arcsin(to_sun[:, 2] / np.linalg.norm(to_sun, axis=1)))
    np.testing.assert_allclose(height, found["elevation"], atol=0.1)
    np.testing.assert_allclose(azimuth, found["azimuth"], atol=0.1)


def test_an_unknown_room_is_named_with_those_that_there_are(house: Path, tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(capsys, "init", house, "--room", "garage", "-o", "a.toml")
    assert result.code == 2
    assert "--room: expected a room or storey of the file, one of 01 Hall, Ground, got" in result.err


def test_a_broken_file_is_one_clear_error(tmp_path: Path) -> None:
    pytest.importorskip("ifcopenshell")
    (tmp_path / "a.ifc").write_text("ISO-10303-21;\nHEADER;\nrubbish")
    with pytest.raises(SceneError, match=r"a\.ifc: .*IFC"):
        load_scene(tmp_path / "a.ifc")


def test_a_number_of_two_entities_is_one_clear_error(house: Path, tmp_path: Path) -> None:
    """IfcOpenShell would end the process."""
    text = house.read_text()
    wall, other = re.search(r"#(\d+)=IFCWALL\(", text), re.search(r"#(\d+)=IFCAXIS2PLACEMENT3D\(", text)
    assert wall and other
    (tmp_path / "a.ifc").write_text(text.replace(f"#{wall[1]}=IFCWALL(", f"#{other[1]}=IFCWALL("))
    with pytest.raises(SceneError, match=rf"a\.ifc: broken IFC: #{other[1]} is two entities"):
        load_scene(tmp_path / "a.ifc")


def test_a_broken_schema_is_one_clear_error(house: Path, tmp_path: Path) -> None:
    """IfcOpenShell would end the process."""
    text = house.read_text()
    assert "FILE_SCHEMA((" in text
    (tmp_path / "a.ifc").write_text(text.replace("FILE_SCHEMA((", "FILE_SCHEMA(Sjr7Vs',$,'Plot');\nFILE_SCHEMA((", 1))
    with pytest.raises(SceneError, match=r"a\.ifc: broken, or not IFC"):
        load_scene(tmp_path / "a.ifc")


def test_rooms_of_one_name_are_told_apart_by_their_storeys(tmp_path: Path) -> None:
    pytest.importorskip("ifcopenshell", reason="needs IfcOpenShell")
    made, file = ifchouse.House(), tmp_path / "a.ifc"
    made.box("IfcSpace", "01", ifchouse.HALL)
    made.storey = made.thing("IfcBuildingStorey", "Upper")
    above = [(x, y, z + 2700) for x, y, z in ifchouse.HALL]
    made.box("IfcSpace", "01", above)
    made.file.write(str(file))
    stage = read_stage(file)
    assert [room.name for room in stage.rooms] == ["01", "01, Upper", "Ground", "Upper"]
    upper = stage.room("01, upper")
    assert upper is not None
    np.testing.assert_allclose(upper.box, np.array(above) / 1000, atol=1e-6)


def test_a_storey_without_rooms_has_a_place_to_stand(tmp_path: Path, capsys, monkeypatch) -> None:
    """On a gallery, and neither in the hall below nor in the low space below the ridge."""
    monkeypatch.chdir(tmp_path)
    made, walls = ifchouse.House(), dict(ifchouse.WALLS)
    gallery, ground = ((0, 0, -200), (2500, 4000, 0)), made.storey
    for height, storey, parts in (
        (0, ground, {name: corners for name, corners in walls.items() if name != "roof"}),
        (2700, made.thing("IfcBuildingStorey", "1", LongName="Upper", Elevation=2700.0), walls | {"floor": gallery}),
        (5400, made.thing("IfcBuildingStorey", "Ridge", Elevation=5400.0), {"ridge": ((0, 0, 600), (5000, 4000, 700))}),
    ):
        made.storey = storey
        for name, corners in parts.items():
            made.box("IfcWall", name, [(x, y, z + height) for x, y, z in corners])
    made.storey = ground
    made.storey = made.box("IfcSpace", "01", ifchouse.HALL, LongName="Hall")
    made.box("IfcFurniture", "chair", ((1000, 1000, 0), (1500, 1500, 450)))
    made.file.write("a.ifc")
    assert {"Ground/01 Hall/chair", "1 Upper/roof"} <= set(load_scene(tmp_path / "a.ifc").object_names)
    for asked, level in (("ground", 0.0), ("upper", 2.7)):
        assert run(capsys, "init", "a.ifc", "--room", asked, "-o", f"{asked}.toml").code == 0
        eyes = [key["eye"] for key in tomllib.loads(Path(f"{asked}.toml").read_text())["camera"]["keys"]]
        assert [z for _, _, z in eyes] == pytest.approx([level + 1.5] * len(eyes), abs=0.01)
    result = run(capsys, "init", "a.ifc", "--room", "ridge", "-o", "ridge.toml")
    assert result.code != 0 and "--room: nothing there looks like the inside of a room" in result.err


def test_a_house_of_others() -> None:
    scene = load_scene(shared_scene("duplex/duplex.ifc"), as_file=True)
    assert "Level 1/Basic Wall:Exterior - Brick on Block:138062" in scene.object_names
    assert any(name.startswith("Level 1/A103 Kitchen/") for name in scene.object_names)
    assert len(scene.corners) > 20_000 and len(scene.pane_corners) > 200


def test_hours_of_sun_on_a_facade(house: Path, tmp_path: Path, capsys, monkeypatch) -> None:
    """The wall that faces -y, 30 degrees from the south: as long as an almanac's sun is up and before it."""
    pvlib = pytest.importorskip("pvlib", reason="the almanac")
    pandas = pytest.importorskip("pandas", reason="the almanac's times")
    monkeypatch.chdir(tmp_path)
    assert run(capsys, "init", house, "--outside", "-o", "house.toml").code == 0
    table = tomllib.loads(Path("house.toml").read_text())
    table["camera"] = {
        "resolution": [16, 8],
        "fov": 20.0,
        "frames": 1,
        "keys": [{"frame": 0, "eye": [2.5, -9.0, 1.2], "target": [2.5, 0.0, 1.2]}],
    }
    sun, _ = table["light"]["sources"]
    sun |= {"date": ["2026-03-21", "2026-06-21", "2026-12-21"], "start": "02:00", "stop": "23:00", "step": 10}
    table["light"].pop("frames", None)
    table["output"] |= {"sun_hours": True, "directory": "out"}
    Path("house.toml").write_text(tomli_w.dumps(table))
    assert run(capsys, "render", "house.toml", "-q").code == 0
    manifest = read_manifest(tmp_path / "out")
    layers = read_layers(layers_path(manifest, 0))
    outwards = np.array([0.0, -1.0, 0.0])
    turn = np.radians(ifchouse.NORTH_DEG)
    north, east = np.array([-np.sin(turn), np.cos(turn), 0]), np.array([np.cos(turn), np.sin(turn), 0])
    for day in sun["date"]:
        hour = "+02:00" if sun["timezone"] == 2 else "+01:00"
        times = pandas.date_range(f"{day}T02:00{hour}", f"{day}T23:00{hour}", freq="1min")
        found = pvlib.solarposition.get_solarposition(times, 48 + 8 / 60 + 15 / 3600, 11.575, altitude=0)
        height, azimuth = np.radians(found["elevation"].to_numpy()), np.radians(found["azimuth"].to_numpy())
        to_sun = np.cos(height)[:, None] * (np.sin(azimuth)[:, None] * east + np.cos(azimuth)[:, None] * north)
        known = ((height > 0) & (to_sun @ outwards > 0)).sum() / 60
        hours = np.asarray(layers[f"sun_hours.{day}"])
        np.testing.assert_allclose(np.median(hours), known, atol=1 / 6 + 2 / 60)  # a step, and a minute at both ends
