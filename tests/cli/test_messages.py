"""Wrong input beyond the wording in golden/: exit codes, names, memory, our own mistakes."""

import os
import re

import pytest
from support.program import finish, names, run, start, write_job

from framearray_cli.base.errors import CheckError, JobError, OutputError, SceneError


def test_exit_codes_are_those_of_the_documentation():
    assert [error.exit_code for error in (JobError, SceneError, OutputError, CheckError)] == [2, 3, 4, 5]


@pytest.mark.skipif(os.name == "nt", reason="file names are text there")
def test_a_name_that_cannot_be_shown(tmp_path):
    result = finish(start("render", os.fsdecode(b"n\xffx.toml"), cwd=tmp_path))
    assert result.code == 2
    assert result.err.startswith("n\\udcffx.toml: no such file")


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


def test_our_own_mistakes_keep_their_traceback(tmp_path, monkeypatch):
    def fail(*arguments: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("framearray_cli.render.session.prepare", fail)
    from framearray_cli.cli.main import main

    with pytest.raises(ZeroDivisionError):
        main(["render", str(write_job(tmp_path))])


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
