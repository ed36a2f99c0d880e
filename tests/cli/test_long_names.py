"""Names that the system refuses to look up: a message for every kind of name."""

import pytest
from support.program import names, run, write_job

LONG = "x" * 300  # characters; file systems allow 255
OUT, OTHER = "out", "other.png"


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """Return a folder with a job, and its frame array in `out`."""
    from framearray_cli.job.read import read_job
    from framearray_cli.render.render import render

    folder = tmp_path_factory.mktemp("array")
    render(read_job(write_job(folder)))
    return folder


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["render", LONG], 2),
        (["check", LONG], 2),
        (["render", "job.toml", "-o", LONG], 4),
        (["render", "job.toml", "-o", f"{LONG}/a"], 4),
        (["check", "job.toml", "-o", LONG], 4),
        (["verify", LONG], 4),
        (["init", LONG], 3),
        (["init", "tiny.glb", "-o", LONG], 4),
        (["assemble", LONG, "walk", "-o", "a.png"], 4),
        (["assemble", OUT, LONG, "-o", "a.gif"], 2),
        (["assemble", OUT, "walk", "-o", LONG], 4),
        (["assemble", OUT, "walk", "-o", f"{LONG}.gif"], 4),
        (["assemble", OUT, "walk", "-o", f"{LONG}/a.gif"], 4),
        (["assemble", OUT, "walk", "-o", f"{LONG}.####.png"], 4),
        (["assemble", OUT, "walk", "-o", f"{LONG}/a.####.png"], 4),
        (["sheet", OUT, "-o", f"{LONG}.png"], 4),
        (["sheet", LONG, "-o", OTHER], 4),
        (["export", OUT, "-f", "nerfstudio", "-o", LONG], 4),
        (["export", OUT, "-f", "cinema", "-o", LONG], 4),
        (["view", OUT, "--export", LONG], 4),
        (["view", OUT, "--cache", LONG, "--export", "page"], 4),
        (["view", LONG, "--export", "page"], 4),
    ],
    ids=lambda value: " ".join(value).replace(LONG, "LONG") if isinstance(value, list) else None,
)
def test_a_long_name_is_reported(arguments, code, rendered, capsys, monkeypatch):
    monkeypatch.chdir(rendered)
    before = names(rendered)
    result = run(capsys, *arguments)
    assert result.code == code
    assert LONG in result.err
    assert "File name too long" in result.err or "no such" in result.err
    assert names(rendered) == before


def test_a_long_name_in_a_job_is_reported(tmp_path, capsys):
    result = run(capsys, "check", write_job(tmp_path, scene={"file": f"{LONG}.glb"}))
    assert (result.code, len(result.out.splitlines())) == (3, 1)  # the size of the array needs no scene
    assert f"{LONG}.glb: cannot be read: File name too long\n" in result.err or "no such scene file" in result.err


@pytest.mark.parametrize("key", ["scene.file", "output.directory"])
def test_no_file_has_a_name_of_thousands_of_letters(key, tmp_path, capsys):
    table, name = key.split(".")
    result = run(capsys, "check", write_job(tmp_path, **{table: {name: "a/" * 5000}}))
    assert (result.code, result.out) == (2, "")
    assert f"{key}: " in result.err
    assert len(result.err) < 1000
