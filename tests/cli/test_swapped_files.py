"""Files of the wrong kind: a job where an array is wanted, an image where a scene is; messages name both."""

import pytest
from support.program import run, write_job

KINDS = {
    "job.toml": "a job file",
    "walk.toml": "a movie path",
    "out": "the folder of a frame array",
    "out/manifest.toml": "the manifest of a frame array",
    "out/image.png": "an image",
    "tiny.glb": "a scene",
    "movie.mp4": "a movie",
}


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_job(tmp_path)
    (tmp_path / "walk.toml").write_text("[[segments]]\nframes = 2\n")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "manifest.toml").write_text('fingerprint = ""\ncameras = []\nscene = {}\n')
    for name in ("out/image.png", "movie.mp4"):
        (tmp_path / name).write_bytes(b"x")
    return tmp_path


WANTED = [
    (["check", "{}"], "a job file", 2, ["job.toml"]),
    (["render", "{}"], "a job file", 2, ["job.toml"]),
    (["openjd", "{}"], "a job file", 2, ["job.toml"]),
    (["report", "{}"], "a job file", 2, ["job.toml"]),
    (["init", "{}", "-o", "new.toml"], "a scene", 3, ["tiny.glb"]),
    (["verify", "{}"], "the folder of a frame array", 4, ["out", "out/manifest.toml"]),
    (["view", "{}", "--no-browser"], "the folder of a frame array", 4, ["out", "out/manifest.toml"]),
    (["sheet", "{}", "-o", "sheet.png"], "the folder of a frame array", 4, ["out", "out/manifest.toml"]),
    (["export", "{}", "-f", "colmap", "-o", "new"], "the folder of a frame array", 4, ["out", "out/manifest.toml"]),
    (["assemble", "{}", "walk.toml", "-o", "new.png"], "the folder of a frame array", 4, ["out", "out/manifest.toml"]),
]


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize(("command", "wanted", "code", "right"), WANTED, ids=[case[0][0] for case in WANTED])
def test_a_file_of_another_kind_is_named(command, wanted, code, right, capsys):
    for name, noun in KINDS.items():
        if name in right:
            continue
        result = run(capsys, *(part.format(name) for part in command))
        assert (result.code, result.out) == (code, "")
        assert result.err.startswith(f"{name}: expected {wanted}, got {noun}"), result.err


@pytest.mark.usefixtures("files")
def test_the_remedy_names_the_command(capsys):
    assert "; `framearray init tiny.glb` writes a job for it" in run(capsys, "render", "tiny.glb").err
    assert "; give the folder of the array: out\n" in run(capsys, "verify", "out/image.png").err
    assert "; give the folder that it renders into (output.directory)\n" in run(capsys, "verify", "job.toml").err
    assert "; `framearray render job.toml` renders it; `framearray check " in run(capsys, "init", "job.toml").err


def test_a_job_with_a_key_of_another_file_stays_a_job(tmp_path, capsys):
    job = write_job(tmp_path)
    job.write_text('segments = 1\nfingerprint = ""\ncameras = 1\n' + job.read_text())
    lines = run(capsys, "render", job).err.splitlines()
    assert [line.removeprefix(f"{job}: ").partition(";")[0] for line in lines[:-1]] == [
        "segments: unknown key",
        "fingerprint: unknown key",
        "cameras: unknown key",
    ]
