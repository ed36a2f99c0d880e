"""Wrong input: one clear message on standard error, the exit code of its kind, no traceback, and nothing written."""

import os
import re
from pathlib import Path

import pytest
from support.program import finish, names, run, start, write_job

from framearray_cli.base.errors import CheckError, JobError, OutputError, SceneError
from framearray_cli.cli.main import OUTCOMES


def test_exit_codes_are_those_of_the_documentation():
    assert [error.exit_code for error in (JobError, SceneError, OutputError, CheckError)] == [2, 3, 4, 5]


@pytest.mark.parametrize("command", ["render", "check"])
def test_problems_of_a_job_are_reported_at_once(command, tmp_path, capsys):
    job = write_job(tmp_path, samples={"hits": 2, "obscurence": 5}, camera={"fov": "wide"})
    result = run(capsys, command, job)
    assert result.code == 2
    assert result.out == ""
    assert result.err.splitlines() == [
        f'{job}: camera.fov: expected a number from 0.001 to 179.9, got "wide"',
        f'{job}: samples.obscurence: unknown key; did you mean "obscurance"?',
        f"2 problems; {OUTCOMES[command]}.",
    ]
    assert names(tmp_path) == {"job.toml", "tiny.glb"}


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("missing.toml", None, "missing.toml: no such file"),
        ("binary.toml", b"\x00\x01\xff", "binary.toml: expected UTF-8 text, got a binary file"),
        ("broken.toml", b"name = \n", "broken.toml: not valid TOML: Invalid value (at line 1, column 8)"),
        ("empty.toml", b"", "empty.toml: scene: missing; expected a table"),
        ("noise", b"glTF\x02\x00\x00\x00", "noise: expected UTF-8 text, got a binary file"),
        (
            "scene.glb",
            b"glTF\x02\x00\x00\x00",
            "scene.glb: expected a job file, got a scene; `framearray init scene.glb` writes a job for it",
        ),
        ("a b.png", b"", "a b.png: expected a job file, got an image"),
        (
            "walk.toml",
            b"[[segments]]\n",
            "walk.toml: expected a job file, got a movie path; `framearray assemble ARRAY walk.toml` follows it",
        ),
        (
            "manifest.toml",
            b"fingerprint = ''\ncameras = []\n",
            "manifest.toml: expected a job file, got the manifest of a frame array; "
            "`framearray verify --repair .` renders what the array lacks",
        ),
        ("folder", "folder", "folder: expected a TOML file, got a folder"),
    ],
)
def test_what_is_no_job_file(name, content, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if isinstance(content, bytes):
        Path(name).write_bytes(content)
    elif content is not None:
        Path(name).mkdir()
    result = run(capsys, "render", name)
    assert (result.code, result.out) == (2, "")
    assert message in result.err.splitlines()
    assert re.fullmatch(r"\d problems?; nothing was rendered\.", result.err.splitlines()[-1])


def test_a_name_of_a_job_is_no_markup(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(capsys, "render", "[red]a[/red]:smile:.toml").err.startswith("[red]a[/red]:smile:.toml: no such file")


@pytest.mark.skipif(os.name == "nt", reason="file names are text there")
def test_a_name_that_cannot_be_shown(tmp_path):
    result = finish(start("render", os.fsdecode(b"n\xffx.toml"), cwd=tmp_path))
    assert result.code == 2
    assert result.err.startswith("n\\udcffx.toml: no such file")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rendr"], "no such command rendr; did you mean render?"),
        (["render"], "Error: missing argument JOB\n"),
        (["render", "--xyzzy", "job.toml"], "Error: no such option --xyzzy\n"),
        (["render", "--thread", "2", "job.toml"], "Error: no such option --thread; did you mean --threads?\n"),
        (["render", "job.toml", "--threads"], "Error: --threads: expected a value, got none\n"),
        (["render", "--restart=1", "job.toml"], "Error: --restart: expected no value\n"),
        (["render", "job.toml", "other.toml"], "one argument too many, or more: other.toml"),
        (["render", "--threads", "0", "job.toml"], "--threads: expected a whole number from 1 to 1024, got 0\n"),
        (["render", "--threads", "1025", "job.toml"], "--threads: expected a whole number from 1 to 1024, got 1025\n"),
        (["render", "--threads", "two", "job.toml"], '--threads: expected a whole number from 1 to 1024, got "two"\n'),
        (["render", "job.toml", "-o", ""], "expected a name, got none"),
        (["assemble", "out", "path.toml"], "Error: missing option --output / -o\n"),
        (
            ["export", "out"],
            "Error: missing option --format / -f; expected nerfstudio, colmap, cinema, rti, blender, olat, "
            "webdataset or huggingface\n",
        ),
        (["assemble", "out", "path.toml", "-o", " "], "expected a name, got none"),
        (
            ["assemble", "out", "path.toml", "-o", "a.mp4", "--exposure", "1e9"],
            "--exposure: expected a number from -64 to 64, got 1000000000",
        ),
    ],
)
def test_wrong_command_lines(arguments, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_job(tmp_path)
    result = run(capsys, *arguments)
    assert (result.code, result.out) == (2, "")
    assert message in result.err
    assert "Usage: framearray" in result.err
    assert names(tmp_path) == {"job.toml", "tiny.glb"}


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        ("nosuch.glb", "nosuch.glb: no such scene file; paths are relative to the job file"),
        ("job.toml", "job.toml: expected a scene, got a job file; `framearray render "),
        ("scene.xcf", "scene.xcf: expected a scene of a known format, got '.xcf'; known are "),
        ("noname", "noname: expected a scene of a known format, got a name without a suffix; known are "),
        (
            "a.blend",
            "a.blend: .blend files cannot be read; Blender writes a GLB and a job of it: blender --background ",
        ),
        ("a.FBX", "a.FBX: .fbx files cannot be read; export the scene as GLB: open Blender, File > Import > FBX, then"),
        ("a.pbrt", "a.pbrt: .pbrt files cannot be read; export the scene as GLB: in the program that wrote it; pbrt "),
        ("a.xml", "a.xml: .xml files cannot be read; export the scene as GLB: Blender opens scenes of Mitsuba with "),
        ("a.las", "a.las: expected a scene, got a .las file; it holds points; a scene needs surfaces: triangles"),
        ("a.vrm", "a.vrm: expected a scene, got a .vrm file; it is a GLB by another name: rename it to .glb"),
        ("a.dae", "a.dae: reading .dae files needs pycollada; export the scene as GLB, or install it with: "),
        ("a.png", "a.png: expected a scene, got an image"),
        (
            "a\nb.glb",
            "a\\nb.glb: no such scene file; paths are relative to the job file; in double quotes TOML reads a ",
        ),
        ("points.obj", "points.obj: expected triangles, got none (points without faces are left out)"),
        ("broken.glb", "broken.glb: broken, or not GLB ("),
    ],
)
def test_wrong_scenes(scene, message, tmp_path, capsys):
    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\n")
    for name in ("scene.xcf", "noname", "a.blend", "a.FBX", "a.pbrt", "a.xml", "a.las", "a.vrm", "a.dae", "a.png"):
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "broken.glb").write_bytes(b"glTF" + bytes(200))
    result = run(capsys, "render", write_job(tmp_path, scene={"file": scene}))
    assert (result.code, result.out) == (3, "")
    assert result.err.startswith(f"{tmp_path}{os.sep}{message}")
    assert len(result.err.splitlines()) == 1
    assert "out" not in names(tmp_path)


def test_an_output_folder_that_is_a_file(tmp_path, capsys):
    result = run(capsys, "render", "-q", write_job(tmp_path, output={"directory": "tiny.glb"}))
    assert (result.code, result.out) == (4, "")
    assert result.err == f"{tmp_path / 'tiny.glb'}: a file of that name is in the way of the folder\n"


@pytest.mark.parametrize("change", [{"camera": {"resolution": [16384, 16384]}}, {"light": {"frames": 100_000}}])
def test_a_job_beyond_memory(change, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("framearray_cli.render.memory.free_memory", lambda: 2**30)
    result = run(capsys, "render", "-q", write_job(tmp_path, **change))
    assert (result.code, result.out) == (2, "")
    assert re.search(r"job\.toml: rendering needs at least [\d.]+ GiB of memory, 1\.0 GiB", result.err)
    assert "out" not in names(tmp_path)


def test_memory_that_runs_out_all_the_same(tmp_path, capsys, monkeypatch):
    def fail(*arguments: object, **more: object) -> None:
        raise MemoryError

    monkeypatch.setattr("framearray_cli.render.render.plan_work", fail)
    result = run(capsys, "render", "-q", write_job(tmp_path))
    assert result.code == 2
    assert result.err.startswith("not enough memory; ")


def test_a_movie_path_with_a_problem(tmp_path, capsys):
    run(capsys, "render", "-q", write_job(tmp_path))
    path = tmp_path / "path.toml"
    path.write_text("segments = 3\n")
    result = run(capsys, "assemble", tmp_path / "out", path, "-o", tmp_path / "walk.mp4")
    assert (result.code, result.out) == (2, "")
    assert result.err.endswith("1 problem; nothing was written.\n")
    assert not (tmp_path / "walk.mp4").exists()


def test_a_movie_of_no_array(tmp_path, capsys):
    result = run(capsys, "assemble", tmp_path / "nosuch", tmp_path / "path.toml", "-o", tmp_path / "walk.mp4")
    assert (result.code, result.out) == (4, "")
    assert "no such file; expected the output folder of `framearray render`" in result.err


def test_our_own_mistakes_keep_their_traceback(tmp_path, monkeypatch):
    def fail(*arguments: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("framearray_cli.render.session.prepare", fail)
    from framearray_cli.cli.main import main

    with pytest.raises(ZeroDivisionError):
        main(["render", str(write_job(tmp_path))])


@pytest.mark.parametrize("command", ["render", "check"])
@pytest.mark.parametrize(
    ("value", "message"),
    [
        (0, "expected a number above 0, got 0: nothing is within it"),
        (-0.0, "expected a number above 0, got -0.0: nothing is within it"),
        (float("inf"), "expected a finite number above 0, got inf: distances are measured against it"),
        (float("nan"), "expected a finite number above 0, got nan: distances are measured against it"),
        (-1.5, "expected a number above 0, got -1.5"),
    ],
)
def test_a_range_in_which_obscurances_mean_nothing(command, value, message, tmp_path, capsys):
    """W of a range of 0 would be empty, and of an infinite one undefined: d / d_max."""
    job = write_job(tmp_path, obscurance={"range": value})
    result = run(capsys, command, job)
    assert (result.code, result.out) == (2, "")
    assert result.err.splitlines() == [f"{job}: obscurance.range: {message}", f"1 problem; {OUTCOMES[command]}."]
    assert names(tmp_path) == {"job.toml", "tiny.glb"}


def test_all_problems_are_counted_at_the_end(tmp_path, capsys):
    result = run(capsys, "check", write_job(tmp_path, camera={f"k{i}": 1 for i in range(1200)}))
    assert result.code == 2
    assert result.err.splitlines()[-2].endswith("job.toml: and 1,150 more problems")
    assert result.err.splitlines()[-1] == "1,200 problems; the job cannot be rendered."


@pytest.mark.skipif(os.name == "nt", reason="such names are none there")
def test_names_cannot_control_the_terminal(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(capsys, "check", "a\x1b[31m\u202eb\n.toml")
    assert result.err == "a\\x1b[31m\\u202eb\\n.toml: no such file\n1 problem; the job cannot be rendered.\n"
    job = write_job(tmp_path, scene={"materials": {"x\x1b[2J": {"specular": 0.5}}})
    assert "\x1b" not in run(capsys, "check", job).err


def test_a_long_name_of_a_material_is_shortened(tmp_path, capsys):
    result = run(capsys, "check", write_job(tmp_path, scene={"materials": {"x" * 5000: {"specular": 0.5}}}))
    assert result.code == 3
    assert '"' + "x" * 100 + '...": no such material' in result.err
    assert len(result.err) < 1000
