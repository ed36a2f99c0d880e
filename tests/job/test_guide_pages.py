"""The examples, commands and numbers of docs/guide/scenes.md, docs/guide/materials.md and docs/start/gallery.md."""

import math
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from support import ROOT, ifchouse, tiny
from support.guide import DOCS, blocks, job_file, rows
from support.program import run
from support.scenes import Glb

from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from framearray_cli.scene.scene import load_scene
from framearray_cli.starter import StartOptions, init

JOBS = ROOT / "jobs"
THREE, SMALL = rows("start/gallery.md", "The three tests of the paper"), rows("start/gallery.md", "Small jobs")
COMMANDS = re.findall(
    r"^    python -m jobs\.generators(.*?)(?:#.*)?$", (DOCS / "start/gallery.md").read_text(), re.MULTILINE
)


def job_with(folder: Path, page: str, word: str) -> Job:
    """Read a job with one of its tables from a page of the guide: the example that has a word."""
    (text,) = [block for block in blocks(f"guide/{page}.md", "toml") if word in block]
    name = re.findall(r"^\[+(\w+)", text, re.MULTILINE)[0]
    rest = {"scene": {"file": "a.glb"}} | {
        key: value for key, value in tiny.table().items() if key not in ("scene", name)
    }
    if "\nfile = " in text:
        del rest["scene"]
    return read_job(job_file(folder, tomli_w.dumps(rest), text))


def sizes(row: list[str]) -> list[tuple[str, str]]:
    """The jobs of a row of a table, and the sizes that it gives them."""
    return [(name, row[1]) for name in re.findall(r"`([\w-]+)\.toml`", row[0])]


def test_a_material_is_overridden_as_the_page_shows(tmp_path: Path) -> None:
    job = job_with(tmp_path, "materials", "Chrome")
    glb = Glb()
    glb.node(glb.mesh(glb.material("Chrome", {"metallicFactor": 1.0, "roughnessFactor": 0.0})))
    scene = load_scene(glb.save(tmp_path / "a.glb"), job.scene.materials)
    assert scene.reflectivity.tolist() == [pytest.approx([0.1] * 3)]
    assert scene.specular.tolist() == [pytest.approx([0.8] * 3)]


def test_surfaces_are_overridden_as_the_page_shows(tmp_path: Path) -> None:
    job, glb = job_with(tmp_path, "materials", "Window"), Glb()
    for name in ("Floor", "Window", "Sign"):
        glb.node(glb.mesh(glb.material(name)), translation=[0.0, 0.0, float(len(name))])
    scene = load_scene(glb.save(tmp_path / "a.glb"), job.scene.materials, as_file=True)
    floor, sign = scene.material_names.index("Floor"), scene.material_names.index("Sign")
    assert (scene.roughness[floor], scene.metallic[floor]) == (np.float32(0.2), 0)
    assert len(scene.pane_corners) > 0
    assert scene.emission[sign].tolist() == [8, 2, 1]


def test_a_folder_of_textures_is_relative_to_the_job(tmp_path: Path) -> None:
    scene = job_with(tmp_path, "scenes", "folders").scene
    assert scene.file == tmp_path / "models" / "house.gltf"
    assert scene.folders == (tmp_path / "textures",)


@pytest.mark.parametrize(
    ("page", "word", "key", "value"),
    [
        ("scenes", "time", "time", 1.25),
        ("materials", "hall.glb", "surfaces", "file"),
        ("materials", "back_faces", "back_faces", "hide"),
    ],
)
def test_keys_of_the_scene_are_as_the_pages_show(page: str, word: str, key: str, value: object, tmp_path: Path) -> None:
    assert getattr(job_with(tmp_path, page, word).scene, key) == value


def test_every_example_is_tested() -> None:
    pages = ("guide/scenes.md", "guide/materials.md", "start/gallery.md")
    assert [len(blocks(page, "toml")) for page in pages] == [2, 4, 0]
    assert (len(blocks("guide/scenes.md", "sh")), len(blocks("start/gallery.md", "sh"))) == (2, 0)


def test_the_room_in_usd_becomes_a_job_as_the_page_types_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pxr")
    # pictures for the exposure would compile kernels of their own
    monkeypatch.setattr("framearray_cli.starter.lighting.find_factors", lambda *_: (0.5, 1.0))
    text, _ = blocks("guide/scenes.md", "sh")
    make, start, render = (line.split() for line in text.splitlines())
    assert make[:2] == ["PYTHONPATH=tests", "python"] and start[:2] == ["framearray", "init"]
    assert render == ["framearray", "render", "room.toml"]
    subprocess.run(
        [sys.executable, ROOT / make[2], *make[3:]],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT / "tests")}, check=True,
    )  # fmt: skip
    init(tmp_path / start[2], tmp_path / render[2], StartOptions(frames=2, lights=2))
    job = read_job(tmp_path / render[2])
    assert job.scene.surfaces == "file" and {source.type for source in job.light.sources} == {"rect", "point"}


def test_a_house_in_ifc_becomes_jobs_as_the_page_types_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ifchouse.house(tmp_path / "house.ifc")
    monkeypatch.setattr("framearray_cli.starter.lighting.find_factors", lambda *_: (0.5, 1.0))
    monkeypatch.chdir(tmp_path)
    _, text = blocks("guide/scenes.md", "sh")
    for line in text.splitlines():
        assert run(capsys, *shlex.split(line, comments=True)[1:]).code == 0
    dates = [read_job(tmp_path / f"{name}.toml").light.sources[0].date for name in ("house", "hall", "winter")]
    assert [date[5:] for date in dates] == ["06-21", "06-21", "01-15"]


@pytest.mark.parametrize(("name", "size"), [pair for row in (*THREE, *SMALL) for pair in sizes(row)])
def test_jobs_have_the_sizes_that_the_page_gives(name: str, size: str) -> None:
    job = read_job(JOBS / f"{name}.toml")
    found = re.fullmatch(r"(\d+) x (?:(\d+)|\((\d+) \+ (\d+)\))(?: at (\d+) x (\d+))?", size)
    assert found is not None, size
    eyes, lights, first, second, width, height = (int(text) if text else None for text in found.groups())
    assert job.camera.frames == eyes
    assert [job.light.frames, *job.light.axes.values()] == ([first, second] if first else [lights])
    assert job.camera.resolution == (width or 400, height or 300)


def test_all_jobs_are_on_the_page() -> None:
    text = (DOCS / "start/gallery.md").read_text(encoding="utf-8")
    assert [file.name for file in JOBS.glob("*.toml") if f"`{file.name}`" not in text] == []


@pytest.mark.parametrize("row", THREE, ids=lambda row: row[0])
def test_scenes_have_the_triangles_and_textures_that_the_page_gives(row: list[str]) -> None:
    scene = load_scene(read_job(JOBS / row[0].strip("`")).scene.file)
    assert f"{scene.report.triangles:,}" == row[3]
    assert str(scene.report.textures) == row[4]


def test_furnaces_follow_from_their_reflectivity() -> None:
    heads = [0.2, 0.5, 0.8]
    formulas = {
        "E, W/m2": lambda r: 1 / (1 - r),
        "I_A = E / pi": lambda r: 1 / (1 - r) / math.pi,
        "W": lambda r: r,
        "indirect radiance R I_A W": lambda r: r * r / (1 - r) / math.pi,
    }
    table = rows("start/gallery.md", "Furnaces")
    assert [row[0] for row in table] == list(formulas)
    for row in table:
        for cell, r in zip(row[1:], heads, strict=True):
            assert float(cell) == pytest.approx(formulas[row[0]](r), abs=0.6 * 10.0 ** -len(cell.partition(".")[2]))


def test_generators_have_the_names_that_commands_use() -> None:
    text = (JOBS / "generators" / "__main__.py").read_text(encoding="utf-8")
    names = re.findall(r'"(\w+)"', re.findall(r"^NAMES = \((.*)\)$", text, re.MULTILINE)[0])
    assert len(COMMANDS) == 3 and "all four scenes and the sky" in (DOCS / "start/gallery.md").read_text(
        encoding="utf-8"
    )
    assert len(names) == 5
    assert {words.split()[0] for words in COMMANDS if words.strip()} <= set(names)
