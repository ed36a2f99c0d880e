"""Lamps with IES files of a glTF file in a first job, and those that it cannot have."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starter.test_emission import room
from support.scenes import Glb
from support.staged import QUARTER

from framearray_cli.job.read import read_job
from framearray_cli.scene.paths.paths import lights
from framearray_cli.starter import StartOptions, init

IES = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 2 3 1 1 2 0 0 0\n1 1 10\n0 45 90\n0\n300 200 0\n"
pytestmark = pytest.mark.usefixtures("obscurances")
FEW = StartOptions(frames=2, resolution=(48, 36))
DOWN = [-QUARTER, 0.0, 0.0, QUARTER]  # -z turned to -y


def with_lamps(glb: Glb, profiles: list[dict[str, Any]], *instances: dict[str, Any]) -> Glb:
    glb.tree.setdefault("extensions", {})["EXT_lights_ies"] = {"lights": profiles}
    glb.tree["extensionsUsed"] = [*glb.tree.get("extensionsUsed", []), "EXT_lights_ies"]
    for k, instance in enumerate(instances):
        glb.node(name=f"Lamp {k}", translation=[k, 2.0, 0.0], rotation=DOWN, extensions={"EXT_lights_ies": instance})
    return glb


def test_a_measured_lamp_keeps_its_file_its_way_and_its_strength(tmp_path: Path) -> None:
    """The node looks down -z, here -y, and its x axis is horizontal angle 0; candela times multiplier and colour."""
    (tmp_path / "lights").mkdir()
    (tmp_path / "lights" / "a.ies").write_text(IES)
    tinted = {"light": 0, "multiplier": 0.5, "color": [1.0, 0.5, 0.25]}
    glb = with_lamps(room(screen=False), [{"uri": "lights/a.ies"}], {"light": 0}, tinted)
    init(glb.save(tmp_path / "scene.glb"), tmp_path / "job.toml", FEW)
    assert 'ies = "lights/a.ies"' in (tmp_path / "job.toml").read_text()
    job = read_job(tmp_path / "job.toml")
    first, second = (source for source in lights(job).sources if source.profile is not None)
    np.testing.assert_allclose(first.vector[0], [0, 2, 0], atol=1e-6)
    assert first.profile is not None
    np.testing.assert_allclose(first.profile.axis[0], [0, -1, 0], atol=1e-6)
    np.testing.assert_allclose(first.profile.zero[0], [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(second.intensity[0] / first.intensity[0], [0.5, 0.25, 0.125], rtol=0.02)
    assert first.intensity[0, 0] > 0


def test_lamps_that_a_job_cannot_have_are_noted(tmp_path: Path) -> None:
    (tmp_path / "broken.ies").write_text("TILT=NONE\n1 2\n")
    profiles = [{"uri": "gone.ies"}, {"uri": "broken.ies"}, {"bufferView": 0, "mimeType": "application/x-ies-lm-63"}]
    wrong: list[dict[str, Any]] = [{"light": 0}, {"light": 1}, {"light": 2}, {"light": 7}, {}]
    glb = with_lamps(room(), profiles, *wrong)
    init(glb.save(tmp_path / "scene.glb"), tmp_path / "job.toml", FEW)
    text = (tmp_path / "job.toml").read_text()
    assert "ies =" not in text
    for k, why in enumerate(("gone.ies: no such file", "broken.ies: line 2: expected", "lies inside the scene file")):
        assert f"light Lamp {k}: " in text and why in text
    assert text.count("its EXT_lights_ies is broken and is left out") == 2
