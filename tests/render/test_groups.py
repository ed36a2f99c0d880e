"""Light stored by group of sources: the sum equals a render of all sources."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from support import tiny
from support.divided import in_blocks

from framearray_cli.array.images import read_layers
from framearray_cli.array.manifest import array_files
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.pictures import Pictures, Relight
from framearray_cli.render.render import render
from framearray_cli.scene.paths.paths import Plane

SKY = [0.3, 0.4, 0.5]
LAMP = {**tiny.TABLE["light"]["sources"][0], "group": "lamps", "axis": "lamps"}
SUN = {
    "type": "directional",
    "group": "sun",
    "keys": [
        {"frame": 0, "direction": [-0.6, -1.0, -0.3], "irradiance": [3.0, 2.5, 1.5]},
        {"frame": 1, "direction": [0.5, -1.0, -0.2], "irradiance": [2.0, 2.5, 3.5]},
    ],
}
SOURCES = [LAMP, SUN, tiny.RED]  # RED is in no group: "main"
FACTORS = {"lamps": (0.5, 2.0, 1.0), "sun": (0.0, 0.0, 0.0), "main": (3.0, 3.0, 0.25)}


def rendered(
    scene: Path, folder: Path, sources: Any, background: Any = SKY, half: str = "never", **changes: Any
) -> Pictures:
    """Render a job whose number of light positions follows from its sources, and open its pictures."""
    tables = {"camera": tiny.walk(3), "reuse": {"n_r": 1}, "obscurance": {"outside": "background"}} | changes
    tables |= {"scene": {"background": background}, "light": {"frames": None, "sources": sources}}
    render(tiny.job_of_file(scene, folder, output={"compression": "none", "half": half}, **tables))
    return Pictures(read_manifest(folder))


def at(source: Any, frame: int, factor: Any = (1.0, 1.0, 1.0)) -> dict[str, Any]:
    """Return a fixed source, without a group, from one key frame of a source."""
    power = "irradiance" if "irradiance" in source["keys"][0] else "intensity"
    [key] = [key for key in source["keys"] if key["frame"] == frame]
    lit = (np.array(key[power]) * factor).tolist()
    return {"type": source["type"], "keys": [{**key, "frame": 0, power: lit}]}


@pytest.fixture(scope="module")
def grouped(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Pictures:
    return rendered(scene, tmp_path_factory.mktemp("groups") / "out", SOURCES)


def test_groups_are_stored_as_the_manifest_lists_them(grouped: Pictures) -> None:
    manifest = grouped.manifest
    assert manifest.axes == {"light": 2, "lamps": 3}
    assert [(group.name, group.axis, len(group.lights)) for group in manifest.groups] == [
        ("lamps", "lamps", 3),
        ("sun", "light", 2),
        ("main", "light", 2),
    ]
    names = {path.name for path in array_files(manifest)}
    assert names == {path.name for path in manifest.directory.glob("*.exr")}
    assert {"tiny.lamps.c0002.l001.exr", "tiny.main.c0000.l001.exr", "tiny.ambient.c0001.exr"} < names
    assert len(names) == 3 * (3 + 2 + 2 + 2 + 1), "groups, R W and background, layers"
    assert manifest.summary["images"] == 3 * 9
    assert "clipped" not in manifest.summary, "images are parts of pictures"


@pytest.mark.parametrize("place", [(0, 0), (1, 0), (0, 2)])
def test_a_pair_of_positions_equals_a_render_of_it(
    scene: Path, tmp_path: Path, grouped: Pictures, place: tuple[int, int]
) -> None:
    """Two light axes cover their full product."""
    sun, lamp = place
    whole = rendered(scene, tmp_path, [at(LAMP, lamp), at(SUN, sun), at(tiny.RED, 0)])
    for c in range(3):
        right = whole.picture(c, (0,))
        np.testing.assert_allclose(grouped.picture(c, place), right, rtol=2e-5, atol=2e-6)
        other = grouped.picture(c, (1 - sun, lamp))
        assert np.abs(other - right).max() > 0.01, "the comparison can fail"


def test_changed_light_equals_a_render_with_it(scene: Path, tmp_path: Path, grouped: Pictures) -> None:
    changed = [at(LAMP, 2, FACTORS["lamps"]), at(SUN, 1, FACTORS["sun"]), at(tiny.RED, 0, FACTORS["main"])]
    whole = rendered(scene, tmp_path, changed)
    for c in range(3):
        made = grouped.picture(c, (1, 2), Relight(groups=FACTORS))
        np.testing.assert_allclose(made, whole.picture(c, (0,)), rtol=2e-5, atol=2e-6)


def test_ambient_light_can_be_turned_off(scene: Path, tmp_path: Path, grouped: Pictures) -> None:
    dark = rendered(scene, tmp_path, [at(LAMP, 0), at(SUN, 0), at(tiny.RED, 0)], ambient=tiny.DARK)
    made = grouped.picture(1, (0, 0), Relight(ambient=(0.0, 0.0, 0.0)))
    np.testing.assert_allclose(made, dark.picture(1, (0,)), rtol=2e-5, atol=2e-6)


def test_half_floats_keep_half_precision(scene: Path, tmp_path: Path, grouped: Pictures) -> None:
    """Each file in the sum is within half a step of 2^-11."""
    halves = rendered(scene, tmp_path, SOURCES, half="auto")
    for place in ((0, 0), (1, 2)):
        made, exact = (pictures.picture(0, place, Relight(groups=FACTORS)) for pictures in (halves, grouped))
        np.testing.assert_allclose(made, exact, rtol=2**-11, atol=1e-6)


def test_the_ambient_light_of_groups_adds_up(scene: Path, tmp_path: Path) -> None:
    ambient = {"paths": 512}
    made = rendered(scene, tmp_path / "groups", SOURCES, ambient=ambient).manifest
    whole = rendered(scene, tmp_path / "whole", [at(LAMP, 2), at(SUN, 1), at(tiny.RED, 0)], ambient=ambient).manifest
    parts = [made.groups[0].lights[2], made.groups[1].lights[1], made.groups[2].lights[1]]
    total = np.sum([part.ambient for part in parts], axis=0) + made.background_ambient
    np.testing.assert_allclose(total, whole.lights[0].ambient, rtol=1e-5)
    assert (np.array(made.background_ambient) > 0).all()


def test_a_black_background_is_not_stored(scene: Path, tmp_path: Path) -> None:
    black: dict[str, Any] = {"background": [0.0] * 3, "obscurance": {"outside": "average"}}
    made = rendered(scene, tmp_path, SOURCES, **black)
    assert made.manifest.background_images == ""
    assert not list(tmp_path.glob("*background*"))
    whole = rendered(scene, tmp_path / "whole", [at(LAMP, 0), at(SUN, 0), at(tiny.RED, 0)], **black)
    np.testing.assert_allclose(made.picture(1, (0, 0)), whole.picture(1, (0,)), rtol=2e-5, atol=2e-6)


def test_blocks_of_light_positions_give_the_same(scene: Path, tmp_path: Path, grouped: Pictures) -> None:
    """A memory limit splits the positions of all groups into blocks, also in the middle of a group."""
    import framearray_cli.render.division as module

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "divide", in_blocks(range(0, 4), range(4, 8), range(8, 9)))
        made = rendered(scene, tmp_path / "blocks", SOURCES)
    for file in array_files(made.manifest):
        if "layers" not in file.name:
            np.testing.assert_array_equal(made._read(file), grouped._read(grouped.manifest.directory / file.name))


def test_halves_report_errors_of_groups(scene: Path, tmp_path: Path) -> None:
    made = rendered(scene, tmp_path, SOURCES, half="auto", samples={"halves": True})
    found = made.manifest.summary["standard_error"]
    assert found["group"] in ("lamps", "sun", "main") and found["light"] < 3
    assert {"error.R", "difference.G"} < set(read_layers(tmp_path / "tiny.sun.c0000.l001.exr"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"output": {"format": "png"}}, 'expected "exr" or "tif", as groups'),
        ({"samples": {"error": 0.1, "hits": None}}, "expected none, as the mean radiance"),
        ({"light": {"sources": [{**tiny.RED, "axis": "a"}]}}, "expected a `group` next to it"),
        ({"light": {"sources": [{**tiny.RED, "group": "layers"}]}}, "is reserved"),
        ({"light": {"sources": [{**tiny.RED, "group": "a b"}]}}, "at most 40 letters"),
        ({"light": {"sources": [LAMP, {**tiny.RED, "group": "lamps"}]}}, r'expected "lamps", as at sources\[0\]'),
        ({"light": {"sources": [LAMP], "axes": {"lamps": 2}}}, r"at most 1 \(frames = 2\), got 2"),
        ({"light": {"sources": [LAMP], "axes": {"lamp": 4}}}, "expected a source with this axis"),
        ({"light": {"sources": [LAMP], "frames": 4}}, "every source has an axis of its own"),
    ],
)
def test_jobs_that_groups_rule_out(changes: Any, message: str) -> None:
    light = {"frames": None, "sources": SOURCES} | changes.get("light", {})
    with pytest.raises(ValidationError, match=message):
        tiny.job(**changes | {"light": light})


def test_notes_name_groups(scene: Path) -> None:
    from dataclasses import replace

    from framearray_cli.engine.terms.ambient.intensity import Ambient
    from framearray_cli.render.plan import name_groups
    from framearray_cli.scene.paths.paths import lights

    found = lights(tiny.job(light={"frames": None, "sources": SOURCES}))
    assert found.planes == (Plane.LIGHT,) * 7 + (Plane.INDIRECT,)
    error = np.zeros(8)
    error[4] = 0.5
    ambient = Ambient(
        intensity=np.ones((8, 3), np.float32),
        standard_error=error,
        reflectivity=np.ones(3, np.float32),
        paths=1,
        rays=1,
        notes=("ambient: standard error 50 % at light 4 after 1 walks",),
    )
    assert name_groups(ambient, found).notes == ("ambient: standard error 50 % at light 1 of sun after 1 walks",)
    assert name_groups(ambient, replace(found, groups=())).notes == ambient.notes
