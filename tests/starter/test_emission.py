"""Emission and measured lamps of a file in a first job, beside every kind of lamp and by themselves."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import QUAD_UVS, Glb, png
from support.staged import QUARTER, light
from support.tiny import box, quad

from framearray_cli.array.images import read_image
from framearray_cli.job.read import read_job
from framearray_cli.render.render import render
from framearray_cli.scene.paths.paths import lights
from framearray_cli.starter import StartOptions, init

FEW = StartOptions(frames=2, resolution=(48, 36))
SCREEN = np.array([[-1, 0.8, -1.95], [1, 0.8, -1.95], [1, 1.8, -1.95], [-1, 1.8, -1.95]], np.float32)

TEXELS = np.array([[[255, 40, 40], [40, 255, 40]], [[40, 40, 255], [255, 255, 255]]], np.uint8)
STRENGTH = {"KHR_materials_emissive_strength": {"emissiveStrength": 5.0}}
pytestmark = pytest.mark.usefixtures("obscurances")
EYE = {"type": "perspective", "perspective": {"yfov": 1.1}}


def room() -> Glb:
    """A room of 5 x 2.5 x 4 with a screen at its back that shines, and a camera that looks there."""
    glb = Glb()
    glb.part("Walls", [0.7, 0.7, 0.6], box((-2.5, 0, -2), (2.5, 2.5, 2)))
    glb.texture(png(np.kron(TEXELS, np.ones((8, 8, 1), np.uint8))))
    shines = {"emissiveFactor": [1.0, 1.0, 1.0], "emissiveTexture": {"index": 0}, "extensions": STRENGTH}
    material = glb.material("Screen", {"baseColorFactor": [0.1, 0.1, 0.1, 1.0]}, **shines)
    glb.node(glb.mesh(material, positions=SCREEN, TEXCOORD_0=glb.accessor(QUAD_UVS)))
    glb.node(name="Eye", translation=[0.0, 1.2, 1.6], camera=glb.add("cameras", EYE))
    return glb


def sources(folder: Path, glb: Glb) -> tuple[Any, Any, Any]:
    """The first job of a file, its sources, and the job."""
    start = init(glb.save(folder / "scene.glb"), folder / "job.toml", FEW)
    job = read_job(folder / "job.toml")
    return start, job.light.sources, job


@pytest.mark.parametrize("spots", [0, pytest.param(1, marks=pytest.mark.slow)])  # compiles kernels of its own
def test_every_light_of_a_file_becomes_a_source_and_the_screen_is_seen(
    spots: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the screen is, pictures show the colours of its texture, brighter than the walls."""
    # the exposure of the other tests; pictures for another one would compile kernels of their own
    monkeypatch.setattr("framearray_cli.starter.lighting.find_factors", lambda *_: (0.05, 1.0))
    glb = room()
    glb.node(name="Lamp", translation=[0.0, 2.2, 0.0], **light(glb, intensity=3.0))
    for _ in range(spots):
        glb.node(name="Beam", translation=[-1.0, 2.0, 1.0], **light(glb, "spot", intensity=5.0))
    glb.node(name="Sun", rotation=[-QUARTER, 0.0, 0.0, QUARTER], **light(glb, "directional", intensity=3.0))
    _, found, job = sources(tmp_path, glb)
    assert [source.type for source in found] == ["point", *["spot"] * spots, "directional", "mesh"]
    factor = found[0].keys[0].intensity[0] / 3.0
    np.testing.assert_allclose(found[-1].keys[0].intensity[0], factor, rtol=0.01)
    assert not found[-1].two_sided  # as materials of glTF are unless they say so
    assert found[-1].material == "Screen"
    render(job)
    file = next((tmp_path / "out").rglob("*c0000.l000.png"))
    picture = np.asarray(read_image(file), np.float64)
    screen = picture[8:22, 12:36]
    quarters = [screen[:6, :10], screen[:6, -10:], screen[-6:, :10], screen[-6:, -10:]]
    strongest = [int(quarter.mean(axis=(0, 1)).argmax()) for quarter in quarters[:3]]
    assert strongest == [0, 1, 2]
    assert quarters[3].mean() > 1.5 * picture[28:].mean()


def test_emission_alone_gets_a_light_that_moves(tmp_path: Path) -> None:
    _, found, job = sources(tmp_path, room())
    assert found[0].type == "mesh" and found[1].type in ("point", "directional")
    assert lights(job).n == 12


def test_faint_materials_are_left_out_and_named(tmp_path: Path) -> None:
    glb = room()
    for k in range(3):
        small = np.add(quad((0, 0, 0), (0.02, 0, 0), (0.02, 0.02, 0), (0, 0.02, 0)), [k / 9, 1, -1])
        glb.part(f"Led {k}", [1.0, 1.0, 1.0], small, emissiveFactor=[1.0, 0.0, 0.0])
    start, found, _ = sources(tmp_path, glb)
    assert [source.material for source in found if source.type == "mesh"] == ["Screen"]
    assert "the emission of faint materials is left out: Led 0, Led 1, Led 2" in start.about
