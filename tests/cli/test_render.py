"""`render` and `check` of a small job: output, files, and the array that owns the folder."""

import re
import tomllib

import numpy as np
import OpenImageIO as oiio
import pytest
from support import tiny
from support.handed import contents
from support.program import finish, names, run, start, write_job

from framearray_cli.array.images import read_image

IMAGES = {f"tiny.c0000.l{l:03d}.png" for l in range(3)}
FILES = IMAGES | {"tiny.layers.c0000.exr", "manifest.toml", "records"}


def test_a_render_prints_what_it_did(tmp_path, capsys):
    result = run(capsys, "render", write_job(tmp_path))
    assert result.code == 0
    lines = [line for line in (result.err + result.out).splitlines() if not line.startswith("compil")]
    assert re.fullmatch(r".*tiny\.glb: \d+ triangles, \d+ materials, 1 texture", lines[0])
    assert re.fullmatch(r"ambient light: I_A [\d.]+ to [\d.]+ \(standard error at most .*\)", lines[1])
    assert re.fullmatch(r"3 images in .*: .* ms per image, .* images per second", lines[2])
    assert re.search(
        r"rays per pixel per image \+ .* for mirrors, .* Mrays/s, .* hits per pixel, peak memory", lines[3]
    )
    assert lines[-1] == f"images and manifest: {tmp_path / 'out'}"
    assert names(tmp_path / "out") == FILES
    assert tomllib.loads((tmp_path / "out" / "manifest.toml").read_text())["summary"]["finished"] is True


def test_each_note_is_printed_once(tmp_path, capsys):
    floor = tiny.quad((-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9))  # no surface for walks to hit
    material = tiny.Material(name="Floor", reflectivity=(0.5, 0.5, 0.5))
    part = tiny.Part(material=0, corners=floor)
    meshes = tiny.Meshes(parts=(part,), materials=(material,), textures=(), dropped={}, notes=())
    tiny.save_glb(meshes, tmp_path / "tiny.glb")
    result = run(capsys, "render", write_job(tmp_path))
    assert result.code == 0
    assert result.err.count("met a second surface") == 1


def test_options_stand_instead_of_the_job(tmp_path, capsys, monkeypatch):
    job = write_job(tmp_path)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert run(capsys, "render", "-q", job, "--output", "there", "--threads", "1").code == 0
    assert names(tmp_path) == {"job.toml", "tiny.glb", "here"}
    assert names(tmp_path / "here" / "there") == FILES
    manifest = tomllib.loads((tmp_path / "here" / "there" / "manifest.toml").read_text())
    assert manifest["job"]["render"]["threads"] == 1
    assert run(capsys, "render", "-q", job).code == 0
    assert contents(tmp_path / "out") == contents(tmp_path / "here" / "there")


def test_the_same_job_may_be_rendered_again(tmp_path, capsys):
    job = write_job(tmp_path)
    assert run(capsys, "render", "-q", job).code == 0
    before = contents(tmp_path / "out")
    (tmp_path / "out" / "tiny.c0000.l001.png").unlink()
    (tmp_path / "out" / "tiny.c0000.l002.png").write_bytes(b"damaged")
    result = run(capsys, "render", job)
    assert result.code == 0
    assert contents(tmp_path / "out") == before
    assert "damaged: tiny.c0000.l001.png: missing\n" in result.err
    assert re.search(r"damaged: tiny\.c0000\.l002\.png: expected [\d,]+ bytes, found 7", result.err)
    times = {file: file.stat().st_mtime_ns for file in (tmp_path / "out").glob("*.png")}
    again = run(capsys, "render", job)
    assert again.code == 0
    assert "3 images are there and whole; nothing is left to do" in again.err
    assert {file: file.stat().st_mtime_ns for file in (tmp_path / "out").glob("*.png")} == times


def test_the_place_of_the_scene_plays_no_part(tmp_path, capsys):
    assert run(capsys, "render", "-q", write_job(tmp_path)).code == 0
    (tmp_path / "tiny.glb").rename(tmp_path / "moved.glb")
    assert run(capsys, "render", "-q", write_job(tmp_path, scene={"file": "moved.glb"})).code == 0


@pytest.mark.parametrize("change", [{"seed": 6}, {"name": "other"}, {"output": {"format": "exr"}}])
def test_another_array_is_in_the_way(change, tmp_path, capsys):
    assert run(capsys, "render", "-q", write_job(tmp_path)).code == 0
    before = {file.name: file.read_bytes() for file in (tmp_path / "out").rglob("*.*")}
    other = write_job(tmp_path, "other.toml", **change)
    result = run(capsys, "render", "-q", other)
    assert (result.code, result.out) == (4, "")
    size = "1 camera position x 3 light positions"
    assert result.err.startswith(f"{tmp_path / 'out'}: holds another frame array, 'tiny' with {size}")
    assert "--output" in result.err
    assert "--restart" in result.err
    assert {"seed": "seed: 5 there, 6 now", "name": 'name: "tiny" there, "other" now'}.get(
        next(iter(change)), 'output.format: "png" there, "exr" now'
    ) in result.err
    assert {file.name: file.read_bytes() for file in (tmp_path / "out").rglob("*.*")} == before
    warned = run(capsys, "check", other)
    assert warned.code == 0
    assert "warning: " in warned.err and "warning: " not in warned.out
    assert "holds another frame array" in warned.err
    assert names(tmp_path / "out") == FILES


def test_a_changed_scene_is_another_array(tmp_path, capsys):
    job = write_job(tmp_path)
    assert run(capsys, "render", "-q", job).code == 0
    tiny.save_glb(tiny.room_meshes(mirrors=False), tmp_path / "tiny.glb")
    result = run(capsys, "render", "-q", job)
    assert result.code == 4
    assert "(scene: another model, texture or material)" in result.err


def test_restart_removes_what_the_manifest_lists_and_nothing_else(tmp_path, capsys):
    assert run(capsys, "render", "-q", write_job(tmp_path)).code == 0
    out = tmp_path / "out"
    (out / "mine.txt").write_text("keep")
    (out / "tiny.c0007.l000.png").write_text("not in the array")
    other = write_job(tmp_path, "other.toml", name="other", light={"frames": 4})
    result = run(capsys, "render", other, "--restart")
    assert result.code == 0
    assert f"removed {len(FILES)} files of the frame array in {out}" in result.err
    theirs = {"mine.txt", "tiny.c0007.l000.png"}
    ours = {f"other.c0000.l{l:03d}.png" for l in range(4)} | {"other.layers.c0000.exr", "manifest.toml", "records"}
    assert names(out) == theirs | ours
    assert (out / "mine.txt").read_text() == "keep"


def test_restart_removes_nothing_that_a_link_leads_to(tmp_path, capsys):
    job = write_job(tmp_path)
    assert run(capsys, "render", "-q", job).code == 0
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "c0000.exr").write_text("mine")
    (out / "link").symlink_to(elsewhere)
    manifest = out / "manifest.toml"
    text = manifest.read_text()
    assert 'layers = "tiny.layers.' in text
    manifest.write_text(text.replace('layers = "tiny.layers.', 'layers = "link/'))
    before = names(out)
    result = run(capsys, "render", "-q", job, "--restart")
    assert (result.code, result.out) == (4, "")
    assert result.err == f"{out / 'link'}: leads out of the folder of the array; remove what lies there yourself\n"
    assert (elsewhere / "c0000.exr").read_text() == "mine"
    assert names(out) == before


def test_restart_of_a_job_with_a_problem_removes_nothing(tmp_path, capsys):
    assert run(capsys, "render", "-q", write_job(tmp_path)).code == 0
    broken = write_job(tmp_path, "broken.toml", seed=7, scene={"file": "nosuch.glb"})
    assert run(capsys, "render", "-q", "--restart", broken).code == 3
    assert names(tmp_path / "out") == FILES


def test_a_broken_manifest_is_not_guessed_at(tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "manifest.toml").write_text("format = \n")
    result = run(capsys, "render", "-q", "--restart", write_job(tmp_path))
    assert (result.code, result.out) == (4, "")
    assert re.match(r".*manifest\.toml: not valid TOML: .*; remove that file, or choose another folder", result.err)
    assert names(tmp_path / "out") == {"manifest.toml"}


def test_an_array_that_leads_out_of_its_folder_is_not_removed(tmp_path, capsys):
    assert run(capsys, "render", "-q", write_job(tmp_path)).code == 0
    manifest = tmp_path / "out" / "manifest.toml"
    manifest.write_text(manifest.read_text().replace('images = "tiny', 'images = "../tiny'))
    result = run(capsys, "render", "-q", "--restart", write_job(tmp_path, seed=3))
    assert result.code == 4
    assert "inside the folder" in result.err
    assert (tmp_path / "tiny.glb").exists()


def test_check_writes_nothing(tmp_path, capsys):
    result = run(capsys, "check", write_job(tmp_path))
    assert result.code == 0
    text = result.out
    assert "array: 1 camera position x 3 light positions = 3 images of 24 x 18" in text
    for line in ("memory: about ", f"disk: about .* in {re.escape(str(tmp_path / 'out'))}", "time: about "):
        assert re.search(f"^{line}", text, re.MULTILINE), text
    assert "warning" not in result.err
    assert names(tmp_path) == {"job.toml", "tiny.glb"}


def test_quiet_is_silent_in_a_process_of_its_own(tmp_path):
    result = finish(start("render", "--quiet", write_job(tmp_path)))
    assert (result.code, result.out, result.err) == (0, "", "")
    assert names(tmp_path / "out") == FILES


@pytest.mark.parametrize(("irradiance", "kinds"), [(3.0, {"half"}), (3e5, {"half", "float"})])
def test_images_are_halves_unless_they_are_too_bright(tmp_path, capsys, irradiance, kinds):
    """Frames are composed in halves; one that is too bright for them is composed again."""
    keys = [{"frame": k, "direction": [-0.6, -1.0, -0.3], "irradiance": [i] * 3} for k, i in ((0, 3), (1, irradiance))]
    light = {"frames": 2, "sources": [{"type": "directional", "keys": keys}]}
    found = {}
    for half in ("auto", "never"):
        output = {"format": "exr", "compression": "none", "half": half, "directory": half, "layers": False}
        assert run(capsys, "render", write_job(tmp_path, light=light, output=output)).code == 0
        found[half] = {f.name: f for f in (tmp_path / half).glob("*.exr")}
    stored = set()
    for name, file in found["auto"].items():
        kind = str(oiio.ImageInput.open(str(file)).spec().format)
        exact = read_image(found["never"][name])
        np.testing.assert_array_equal(read_image(file), exact.astype(np.float16) if kind == "half" else exact)
        stored.add(kind)
    assert stored == kinds


def test_a_range_of_next_to_nothing(tmp_path, capsys):
    obscurance = {"range": 1e-45, "falloff": "cbrt", "outside": "background"}
    job = write_job(tmp_path, obscurance=obscurance, ambient={"paths": 64}, light={"frames": 3})
    result = run(capsys, "render", "-q", job)
    assert (result.code, result.err) == (0, "")
