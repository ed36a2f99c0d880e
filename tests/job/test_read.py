"""Reading job files: unusable files, all problems at once, names, `--set KEY=VALUE`, the schema and its page."""

import io
import json
import re
import sys
import tomllib
from pathlib import Path

import pytest
import tomli_w
from pages.jobfile import EXAMPLE, reference_page, schema_text
from support import ROOT, tiny
from support.program import run, write_job

import framearray_cli.base.forms.problems
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.schema import allowed_values, file_schema, find, sections
from framearray_cli.base.forms.toml import load_toml
from framearray_cli.base.forms.words import shown
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_from_table, job_table, read_job

JOB = """
name = "room"
scene.file = "scenes/room.glb"
obscurance.range = 1.5
[camera]
{camera}
[[light.sources]]
type = "point"
keys = [{{ frame = 0, position = [1, 2, 0], intensity = 10 }}]
"""
KEYS = "keys = [{ frame = 0, eye = [0, 0, 5], target = [0, 0, 0] }]"


def write(folder, camera=KEYS, name="job.toml"):
    """Write a small job around some camera lines."""
    path = folder / name
    path.write_text(JOB.format(camera=camera), encoding="utf-8")
    return path


def problems(path):
    """Collect the problems of a job file that has some; each message starts with the file."""
    with pytest.raises(JobError) as caught:
        read_job(path)
    assert caught.value.exit_code == 2
    assert str(caught.value) == "\n".join(f"{path}: {problem}" for problem in caught.value.problems)
    return list(caught.value.problems)


BROKEN = [
    (b"name = ", "not valid TOML: Invalid value (at end of document)"),
    (b'a = 1\nb = "x\n', "not valid TOML: Illegal character '\\n' (at line 2, column 7)"),
    (b"a = 1\na = 2\n", "not valid TOML: a key is given a second time (at line 2, column 6)"),
    (
        rb'file = "C:\Users\me\room.glb"',
        'line 1: TOML reads a backslash in double quotes as an escape; write "C:/Users/me/room.glb", or use single '
        "quotes",
    ),
    (
        rb'file = "\\server\data\room.glb"',
        'line 1: TOML reads a backslash in double quotes as an escape; write "//server/data/room.glb", or use single '
        "quotes",
    ),
    (
        b'directory = "C:\\out\\"\nname = "x"\n',
        'line 1: TOML reads a backslash in double quotes as an escape; write "C:/out/", or use single quotes',
    ),
    (b'a = "x\\q"', 'line 1: TOML reads a backslash in double quotes as an escape; write "x/q", or use single quotes'),
    (b'# hello\nname = "caf\xe9"\n', "expected UTF-8 text, got byte 0xe9 in line 2; save the file as UTF-8"),
    ("name = 1".encode("utf-16"), "expected UTF-8 text, got UTF-16; save the file as UTF-8"),
    (b"glTF\x02\0\0\0", "expected UTF-8 text, got a binary file"),
    (b"a = " + b"[" * 20000, "tables or lists are nested too deeply"),
    (b"a = " + b"9" * 5000, "a number has too many digits"),
    (b"\na" + b".a" * 100_000 + b" = 1", "line 2: expected at most 6 keys with dots between them, got more"),
    (b"[a" + b" . 'a'" * 6 + b"]", "line 1: expected at most 6 keys with dots between them, got more"),
    (b"x = [{ a" + b'."a.b"' * 6 + b"= 1 }]", "line 1: expected at most 6 keys with dots between them, got more"),
    (b"#" * (4 * 1024 * 1024 + 1), "expected a TOML file of at most 4 MB, got a bigger one"),
]


@pytest.mark.parametrize(("data", "message"), BROKEN, ids=[message[:40] for _, message in BROKEN])
def test_an_unusable_file_is_reported(tmp_path, data, message):
    path = tmp_path / "job.toml"
    path.write_bytes(data)
    assert problems(path) == [message]


def test_missing_file_and_folder_are_reported(tmp_path):
    assert problems(tmp_path / "none.toml") == ["no such file"]
    assert problems(tmp_path) == ["expected a TOML file, got a folder"]
    assert problems(tmp_path / "job.toml" / "x") == ["no such file"]
    assert problems(Path("a\0b")) == ["cannot be read: embedded null byte"]


def test_the_byte_order_mark_of_windows_editors_is_skipped(tmp_path):
    path = tmp_path / "job.toml"
    path.write_bytes(b"\xef\xbb\xbfa = 1\r\n")
    assert load_toml(path) == {"a": 1}


def test_all_problems_are_reported_at_once_in_the_order_of_the_keys(tmp_path):
    path = write(
        tmp_path,
        'fov = "wide"\nframes = 5\nkeys = [{ frame = 7, eye = [0, 0, 5], target = [0, 0, 0], resolution = 3 }]',
    )
    path.write_text(path.read_text().replace("range = 1.5", "rnage = 1.5") + "[samples]\nhits = 0\n")
    assert problems(path) == [
        'camera.fov: expected a number from 0.001 to 179.9, got "wide"',
        'camera.keys[0].resolution: unknown key here; "resolution" belongs in [camera]',
        'samples.hits: expected a whole number from 1 to 65000, 1/2, 1/3, ... 1/8 or "auto", got 0',
        'obscurance.rnage: unknown key; did you mean "range"?',
    ]


def test_rules_between_keys_are_reported_beside_other_problems(tmp_path):
    path = write(tmp_path, f"fov = 0\nframes = 5\n{KEYS.replace('frame = 0', 'frame = 7')}")
    assert problems(path) == [
        "camera.fov: expected a number from 0.001 to 179.9, got 0",
        "camera.keys[0].frame: expected at most 4 (frames = 5), got 7",
    ]


def test_a_long_list_of_problems_is_shortened(tmp_path):
    path = write(tmp_path, KEYS + "\n" + "\n".join(f"zz{i} = 1" for i in range(80)))
    found = problems(path)
    assert len(found) == 51
    assert found[-1] == "and 30 more problems"


def test_dots_within_a_text_are_no_keys(tmp_path):
    path = tmp_path / "x.toml"
    path.write_text(
        'a = "1.2.3.4.5.6.7.8.9"\nb.c."d.e.f.g.h.i.j.k" = [0.1, 0.2, 0.3]  # 1.2.3.4.5.6.7.8.9\n', encoding="utf-8"
    )
    assert load_toml(path) == {"a": "1.2.3.4.5.6.7.8.9", "b": {"c": {"d.e.f.g.h.i.j.k": [0.1, 0.2, 0.3]}}}


@pytest.mark.parametrize(
    "more", ["k{} = 1\n", "[k{}]\n", "[scene.materials.k{}]\nx = 1\n", "[[light.sources]]\nx{} = 1\n"]
)
def test_a_hundred_thousand_problems_are_only_counted(tmp_path, more, monkeypatch):
    written = []
    whole = framearray_cli.base.forms.problems._problem
    monkeypatch.setattr(
        framearray_cli.base.forms.problems, "_problem", lambda *given: written.append(given) or whole(*given)
    )
    path = write(tmp_path)
    path.write_text(path.read_text() + "".join(more.format(k) for k in range(5000)))
    assert re.fullmatch(r"and \d{1,2},\d{3} more problems", problems(path)[-1])
    assert len(written) == 50


def test_a_long_key_is_shortened(tmp_path):
    [found] = problems(write(tmp_path, KEYS + "\n" + "x" * 100_000 + " = 1"))
    assert found.startswith('camera."' + "x" * 100 + '...": unknown key;')


@pytest.mark.parametrize(
    ("hits", "shown"),
    [
        ("inf", "inf"),
        ("-inf", "-inf"),
        ("nan", "nan"),
        ("1e308", "1e+308"),
        ("1" + "0" * 400, "a number beyond 64 bits"),
        ("-1" + "0" * 400, "a number beyond 64 bits"),
    ],
)
def test_no_number_of_hits_is_too_large_to_be_reported(tmp_path, hits, shown):
    path = write(tmp_path)
    path.write_text(f"{path.read_text()}[samples]\nhits = {hits}\n")
    [found] = problems(path)
    assert found == f'samples.hits: expected a whole number from 1 to 65000, 1/2, 1/3, ... 1/8 or "auto", got {shown}'


def test_file_names_are_relative_to_the_job_file(tmp_path, monkeypatch):
    (tmp_path / "jobs").mkdir()
    write(tmp_path / "jobs")
    monkeypatch.chdir(tmp_path)
    job = read_job(Path("jobs/job.toml"))
    assert job.scene.file == tmp_path / "jobs/scenes/room.glb"
    assert job.output.directory == tmp_path / "out/room"
    assert job.file == tmp_path / "jobs/job.toml"


def test_tables_give_the_job_of_their_file_with_names_relative_to_the_current_folder(tmp_path, monkeypatch):
    path = write(tmp_path)
    monkeypatch.chdir(tmp_path)
    sets = ["camera.resolution=[64, 48]"]
    assert job_from_table(load_toml(path), sets).model_dump() == read_job(path, sets).model_dump()
    with pytest.raises(JobError, match=r"^job: camera\.fov: expected a number"):
        job_from_table({**load_toml(path), "camera": {"fov": "wide"}})


def test_a_linked_scene_keeps_its_name(tmp_path):
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "room.glb").symlink_to(tmp_path / "store")
    assert read_job(write(tmp_path)).scene.file == tmp_path / "scenes/room.glb"


def eyes_of(tmp_path, name, text, more=""):
    """Read a job whose eyes are in a file."""
    (tmp_path / name).write_text(text, encoding="utf-8")
    return write(tmp_path, f'file = "{name}"\n{more}')


CSV = "target_x, target_y,target_z,eye_x,eye_y,eye_z\n0,0,0,1,2,3\n\n0,0,0,1.5,2,3e0\n"


def test_eyes_of_a_csv_file(tmp_path):
    job = read_job(eyes_of(tmp_path, "eyes.csv", CSV))
    assert job.camera.frames == 2
    assert [(key.frame, key.eye, key.target) for key in job.camera.keys] == [
        (0, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0)),
        (1, (1.5, 2.0, 3.0), (0.0, 0.0, 0.0)),
    ]
    assert job.camera.file is None


def test_eyes_of_a_json_file(tmp_path):
    rows = [{"eye": [i, 0, 0], "target": [9, 0, 0], "up": [0, 0, 1]} for i in range(3)]
    job = read_job(eyes_of(tmp_path, "eyes.json", json.dumps(rows), "frames = 3"))
    assert job.camera.frames == 3
    assert job.camera.keys[2].up == (0.0, 0.0, 1.0)


HEADER = "eye_x,eye_y,eye_z,target_x,target_y,target_z\n"
BAD_EYES = [
    ("e.csv", HEADER + "0,0,0,0,0,1\n\n0,abc,0,0,0,1\n", 'row 4: eye[1]: expected a number, got "abc"'),
    ("e.csv", HEADER + "0,0,0,0,0,nan\n", "row 2: target[2]: expected a number, got nan"),
    ("e.csv", HEADER + "0,0,0,0,0\n", "row 2: expected 6 cells, got 5"),
    ("e.csv", HEADER + "1,1,1,1,1,1\n",
     "row 2: target: expected a point other than `eye`, got [1.0, 1.0, 1.0], the same"),
    ("e.csv", HEADER, "expected 1 to 100000 camera positions, got 0"),
    ("e.csv", "", "row 1: expected the column names eye_x, eye_y, eye_z, target_x, target_y, target_z, and optionally "
     "up_x, ..., shift_x, ..., fov, height, pixel_aspect, got none"),
    ("e.txt", HEADER, 'expected a file name that ends in .csv or .json, got ".txt"'),
    ("e.json", "[", "not valid JSON: Expecting value: line 1 column 2 (char 1)"),
    ("e.json", "3", 'expected a list of {"eye": [...], "target": [...]}, got something else'),
    ("e.json", '[{"eye": [0, 0, 0]}]', "entry 1: target: missing; expected 3 numbers"),
    ("e.json", '[{"frame": 0}]',
     'entry 1: unknown key "frame"; the first entry is frame 0, the next 1, and so on'),
    ("e.json", '[{"eye": [0,0,0], "target": [0,0,1]}, {"eye": [0,0,0], "target": [0,0,1], "up": [0,1,0]}]',
     "entry 2: up: expected in every row or in none"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "message"), BAD_EYES)
def test_an_unusable_file_of_eyes_is_reported_with_its_row(tmp_path, name, text, message):
    path = eyes_of(tmp_path, name, text)
    assert problems(path) == [f'camera.file: "{name}": {message}']


def test_a_missing_file_of_eyes_is_reported_beside_other_problems(tmp_path):
    path = write(tmp_path, 'file = "gone.csv"\nfov = 0')
    assert problems(path) == [
        "camera.fov: expected a number from 0.001 to 179.9, got 0",
        'camera.file: "gone.csv": no such file',
    ]


def test_frames_must_be_the_number_of_eyes(tmp_path):
    path = eyes_of(tmp_path, "eyes.csv", CSV, "frames = 3")
    assert problems(path) == ['camera.frames: expected 2, the number of camera positions in "eyes.csv", got 3']


def test_a_wrong_column_is_reported_only_a_few_times(tmp_path):
    found = problems(eyes_of(tmp_path, "eyes.csv", HEADER + "x,0,0,0,0,1\n" * 100))
    assert len(found) == 11
    assert found[-1] == 'camera.file: "eyes.csv": and 90 more problems'


def test_wrong_rows_are_counted(tmp_path):
    rows = "".join('{"eye": [0, 0, 5], "target": "x", "a": 1, "b": 2},' for _ in range(100))
    found = problems(eyes_of(tmp_path, "eyes.json", f"[{rows[:-1]}]"))
    assert len(found) == 11
    assert found[-1] == 'camera.file: "eyes.json": and 290 more problems'


def again(job, folder):
    """Write a job and read it again."""
    path = folder / "again.toml"
    path.write_text(tomli_w.dumps(job_table(job)), encoding="utf-8")
    return read_job(path)


@pytest.mark.parametrize(
    "more",
    [
        "",
        "[ambient]\nintensity = 0.5\n",
        "[ambient]\npaths = 7\n",
        "[reuse]\nn_r = 'auto'\n[samples]\nhits = 'auto'\n",
        "[samples]\nerror = 0.1\nmost_hits = 5\n",
        "[render]\nthreads = 3\n[output]\ndirectory = '/x/y'\nformat = 'png'\nexposure = 2\n",
        "[scene.materials.'a b.\"c']\nspecular = 1\n",
    ],
)
def test_a_job_survives_the_round_trip(tmp_path, more):
    path = write(tmp_path)
    path.write_text(path.read_text().replace("scene.file", 'scene.file = "s.stl"\n#') + more)
    job = read_job(path)
    (tmp_path / "elsewhere").mkdir()
    read = again(job, tmp_path / "elsewhere")
    assert read == job
    assert repr(job_table(read)) == repr(job_table(job)), "workers read a job from its table: 2 is not 2.0 in a hash"


def test_a_job_with_a_file_of_eyes_survives_without_the_file(tmp_path):
    job = read_job(eyes_of(tmp_path, "eyes.csv", CSV))
    (tmp_path / "eyes.csv").unlink()
    assert again(job, tmp_path) == job


def test_jobs_that_differ_are_not_equal(tmp_path):
    job = read_job(write(tmp_path))
    other = read_job(write(tmp_path, KEYS.replace("[0, 0, 5]", "[0, 0, 5.0000001]")))
    assert job != other
    assert job == read_job(write(tmp_path, name="copy.toml"))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("x" * 100, '"' + "x" * 35 + '..."'),
        ([1, [2]], "a list of 2 values"),
        ([], "a list of 0 values"),
        ([1.5, "a"], '[1.5, "a"]'),
        ({"a": 1}, "a table"),
        (True, "true"),
    ],
)
def test_found_values_are_shown_short(value, text):
    assert shown(value) == text


@pytest.mark.parametrize("name", [r"C:\new\table.glb", r"\\server\rooms\table.glb"])
def test_a_windows_path_of_valid_escapes_is_reported(tmp_path, name):
    path = tmp_path / "job.toml"
    path.write_text(f'[scene]\nfile = "{name}"\n')
    found = next(problem for problem in problems(path) if problem.startswith("scene.file: "))
    remedy = "TOML reads a backslash in double quotes as an escape; write / for it, or use single quotes"
    assert found.startswith("scene.file: expected a file name, got ") and found.endswith(f": {remedy}")
    path.write_text(f"[scene]\nfile = '{name}'\n")
    assert not [problem for problem in problems(path) if problem.startswith("scene.file: ")]


def changed_job(folder: Path, *sets: str) -> Job:
    return read_job(write_job(folder), sets)


def test_values_of_all_kinds(tmp_path: Path) -> None:
    job = changed_job(
        tmp_path,
        "camera.resolution=[64,48]",
        "camera.fov = 33.5",
        "output.format=jpg",  # a bare text
        "name=2026",  # a text that looks like a number
        "light.sources[0].keys[0].intensity=[1, 2, 3]",
        "light.sources[-1].group=sun",
        'scene.materials."the wall".reflectivity=0.25',
        "render.memory=8 GiB",
        "output.format = exr",  # the last one counts
    )
    assert (job.camera.resolution, job.camera.fov, job.output.format, job.name) == ((64, 48), 33.5, "exr", "2026")
    assert job.light.sources[0].keys[0].intensity == (1, 2, 3)
    assert job.light.sources[-1].group == "sun"
    assert job.scene.materials["the wall"].reflectivity == (0.25, 0.25, 0.25)
    assert job.render.memory == 8 * 2**30


def test_a_job_with_a_set_key_is_that_with_the_key_in_its_file(tmp_path: Path) -> None:
    assert changed_job(tmp_path, "samples.hits=3") == read_job(write_job(tmp_path, samples={"hits": 3}))
    assert changed_job(tmp_path) != changed_job(tmp_path, "samples.hits=3")


def test_file_names_are_relative_to_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    job = changed_job(tmp_path, "output.directory=pictures", 'scene.folders=["textures"]')
    assert job.output.directory == tmp_path / "here" / "pictures"
    assert job.scene.folders == (tmp_path / "here" / "textures",)
    assert job.scene.file.parent == tmp_path, "of the file itself"


def test_all_problems_at_once(tmp_path: Path) -> None:
    file = write_job(tmp_path, camera=tiny.WALK | {"fov": 0})
    with pytest.raises(JobError) as caught:
        read_job(file, ["samples.hits=0", "specular.depth=-1"])
    assert [("--set" in problem) for problem in caught.value.problems] == [False, True, True]
    with pytest.raises(JobError) as caught:
        read_job(file, ["fov", "hits"])
    assert len(caught.value.problems) == 2


def test_a_job_on_standard_input(tmp_path: Path, capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    table = tiny.table(output={"directory": "out", "format": "png"})
    write_job(tmp_path)
    monkeypatch.chdir(tmp_path)
    stdin_of(monkeypatch, tomli_w.dumps(table))
    assert run(capsys, "render", "-", "--set", "camera.resolution=[20,10]", "-q").code == 0
    manifest = (tmp_path / "out" / "manifest.toml").read_text()
    assert "20,\n    10,\n" in manifest.split("[job.camera]")[1], "the manifest holds the job as resolved"
    stdin_of(monkeypatch, tomli_w.dumps(table | {"nmae": 3}))
    result = run(capsys, "check", "-")
    assert (result.code, result.out) == (2, "")
    assert result.err.startswith('standard input: nmae: unknown key; did you mean "name"?\n')


def test_a_terminal_is_no_job(capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    stdin_of(monkeypatch, "")
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    result = run(capsys, "check", "-")
    assert (result.code, "standard input: expected a TOML file from a pipe, got a terminal" in result.err) == (2, True)


def stdin_of(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))


GUIDE = ROOT / "docs" / "reference"
REMEDY = "out of date: run `make docs`"


def test_published_files_are_up_to_date():
    assert (GUIDE / "job-file.md").read_text(encoding="utf-8") == reference_page(), REMEDY
    assert (GUIDE / "job.schema.json").read_text(encoding="utf-8") == schema_text(), REMEDY


def test_the_example_is_a_job():
    job = Job.model_validate(tomllib.loads(EXAMPLE))
    assert (job.camera.frames, job.light.frames) == (96, 48)
    assert EXAMPLE in reference_page()


def test_schemas_that_only_other_files_use():
    place = {"anyOf": [{"type": "integer"}, {"type": "string"}]}
    span = {"anyOf": [*place["anyOf"], {"type": "array", "items": place, "minItems": 2, "maxItems": 2}]}
    assert allowed_values({}, span) == "a whole number, a text or 2 values"
    assert allowed_values({}, {}) == "another value"
    assert find(span, (1,)) == ("[1]", place)
    assert find({}, ("a b", "c", 3)) == ('"a b".c[3]', {})


def test_every_key_is_described():
    for section in sections(file_schema(Job)):
        assert section.schema["description"].endswith(".")
        for key, node in section.keys.items():
            if "$ref" not in node:
                assert node["description"].endswith("."), f"{section.place}.{key}"


def test_every_key_has_its_row():
    page = reference_page()
    for section in sections(file_schema(Job)):
        for key, node in section.keys.items():
            if "$ref" not in node and key != "materials":
                assert re.search(rf"^\| `{key}` \| \S.* \| \S.* \| \S.* \|$", page, re.MULTILINE), key
