"""`verify` finds and repairs all files that are missing or changed."""

import random
from pathlib import Path

import pytest
from support import tiny
from support.handed import contents
from support.program import run, write_job

from framearray_cli.array.integrity import verify
from framearray_cli.cli.commands.verify import MOST_DAMAGED

WALK = tiny.walk(4)
N_FILES = 4 * 3 + 4


@pytest.fixture
def array(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert run(capsys, "render", "-q", write_job(tmp_path, camera=WALK)).code == 0
    return tmp_path / "out"


def test_a_whole_array(array, capsys):
    result = run(capsys, "verify", array)
    assert result.code == 0
    assert result.out.endswith(f"{N_FILES} files of tiny are whole\n")
    assert run(capsys, "verify", "-q", array / "manifest.toml").out == ""


def test_every_flipped_byte_is_found_and_repaired(array, capsys):
    before, rng = contents(array), random.Random(5)
    names = rng.sample(sorted(before), 6)
    for name in names[:5]:
        data = bytearray(before[name])
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        (array / name).write_bytes(data)
    (array / names[5]).unlink()
    result = run(capsys, "verify", "-q", array)
    assert result.code == 5
    assert result.out.splitlines()[-1].startswith(f"6 of {N_FILES} files are missing or damaged; ")
    assert {line.split(": ")[0] for line in result.out.splitlines()[:-1]} == {str(array / name) for name in names}
    mended = run(capsys, "verify", "--repair", array)
    assert mended.code == 0
    assert f"6 of {N_FILES} files are missing or damaged\n" in mended.out, "no advice to type the same again"
    assert all((mended.out + mended.err).count(name) == 1 for name in names), "each is named once"
    assert contents(array) == before
    assert run(capsys, "verify", "-q", array).code == 0


def test_an_unfinished_array_is_finished(array, capsys, tmp_path):
    job = write_job(tmp_path, "part.toml", camera=WALK, output={"directory": "part"})
    assert run(capsys, "render", "-q", job, "--cameras", "1-2").code == 0
    result = run(capsys, "verify", tmp_path / "part")
    assert result.code == 5
    assert result.out.splitlines() == [
        "cameras 0,3: never begun, 8 of 8 files are left",
        f"8 of {N_FILES} files were never finished; `framearray render JOB` or "
        f"`framearray verify --repair {tmp_path / 'part'}` goes on",
    ]
    assert run(capsys, "verify", "-q", "--repair", tmp_path / "part").code == 0
    assert contents(tmp_path / "part") == contents(array)


def test_damage_comes_first_and_few_files_are_named(array, capsys):
    for c in (0, 2):
        (array / f"tiny.c000{c}.l001.png").write_bytes(b"")
    records = array / "records" / "0-3.jsonl"
    lines = records.read_bytes().splitlines(keepends=True)
    records.write_bytes(b"".join(line for line in lines if b'"c":3,' not in line and b'"c":1,' not in line))
    for name in ("tiny.c0001.l000.png", "tiny.layers.c0003.exr", *(f"tiny.c0003.l00{l}.png" for l in range(3))):
        (array / name).unlink()
    result = run(capsys, "verify", "-q", array)
    first, second, begun, finished, last, note = (result.out + result.err).splitlines()
    assert first.startswith(f"{array / 'tiny.c0000.l001.png'}: expected ") and "c0002" in second
    assert begun == "camera 3: never begun, 4 of 4 files are left"
    assert finished == "camera 1: never finished, 1 of 4 files is left"
    assert note.startswith("note: 3 files are whole, but have no checksum")
    assert last.startswith(f"2 of {N_FILES} files are missing or damaged, 5 were never finished; `framearray verify")


def test_of_many_damaged_files_some_are_named(array, capsys, monkeypatch):
    monkeypatch.setattr("framearray_cli.cli.commands.verify.MOST_DAMAGED", 3)
    for file in array.glob("tiny.c*"):
        file.write_bytes(b"")
    lines = run(capsys, "verify", "-q", array).out.splitlines()
    assert len(lines) == 5 and lines[3] == "9 more files are missing or damaged"


def test_without_records_images_are_read(array, capsys):
    for file in (array / "records").iterdir():
        file.unlink()
    result = run(capsys, "verify", array)
    assert result.code == 0
    assert f"{N_FILES} files are whole, but have no checksum" in result.err
    (array / "tiny.c0001.l001.png").write_bytes((array / "tiny.c0001.l001.png").read_bytes()[:-100])
    (array / "tiny.layers.c0002.exr").write_bytes(b"no image")
    assert run(capsys, "verify", array).out.splitlines()[-1].startswith(f"2 of {N_FILES} files are missing or damaged")


@pytest.mark.slow
def test_one_flipped_byte_in_each_of_a_hundred_images(tmp_path, capsys):
    for k, image_format in enumerate(("exr", "png")):
        out, rng = tmp_path / image_format, random.Random(k)
        job = write_job(tmp_path, camera=tiny.walk(40), output={"format": image_format, "directory": image_format})
        assert run(capsys, "render", "-q", job).code == 0
        before = contents(out)
        names = rng.sample(sorted(before), 100)
        for name in names:
            data = bytearray(before[name])
            place = rng.randrange(len(data))
            data[place] = (data[place] + rng.randrange(1, 256)) % 256
            (out / name).write_bytes(data)
        assert {name for name, _ in verify(out, 1, lambda done, total: None).damaged} == set(names)
        result = run(capsys, "verify", "-q", out)
        assert (result.code, len(result.out.splitlines())) == (5, MOST_DAMAGED + 2)
        assert run(capsys, "verify", "-q", "--repair", out).code == 0
        assert contents(out) == before
