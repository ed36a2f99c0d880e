"""Files of light positions: every format, and broken ones with one clear message each."""

import io
import json
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from support import lightjobs, tiny
from support.phrases import library_phrase

from framearray_cli.base.colour import black_body
from framearray_cli.base.errors import JobError
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_table
from framearray_cli.job.rowfile import RowFileError, read_positions

HERE = [[0.0, 0.0, 2.0], [1.0, 0.5, 2.0], [-1.0, 0.0, 1.5]]


def npy(array: Any, **options: Any) -> bytes:
    file = io.BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


def read(folder: Path, name: str, content: str | bytes, kind: str = "point", **source: Any) -> Job:
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    strength = {"point": {"intensity": 3.0}, "directional": {"irradiance": 3.0}}.get(kind, {})
    light = {"type": kind, "file": name} | strength | source
    return lightjobs.read_lit(folder, {key: value for key, value in light.items() if value is not None})


def problems(*args: Any, **kwargs: Any) -> list[str]:
    with pytest.raises(JobError) as caught:
        read(*args, **kwargs)
    return list(caught.value.problems)


XYZ = "x,y,z\n0,0,2\n1,.5,2\n-1,0,1.5\n"
LAMPS: dict[str, dict[str, Any]] = {
    "spot": {"target": [0, 0, 0], "intensity": 5, "inner": 10, "outer": 20, "radius": 0.1, "color": "3200 K"},
    "rect": {"direction": [0, 0, -1], "power": 5, "width": 0.3, "height": 0.2, "up": [0, 1, 0], "color": [1, 2, 3]},
    "disc": {"target": [0, 0, 0], "radiance": [1, 2, 3], "radius": 0.2},
}
GOOD = [
    ("a.csv", XYZ),
    ("a.CSV", " Position_z ,position_x,position_y\n2,0,0\n2,1,0.5\n1.5,-1,0\n"),
    ("a.json", json.dumps(HERE)),
    ("b.json", json.dumps([{"position": point} for point in HERE])),
    ("a.npy", npy(np.array(HERE))),
    ("b.npy", npy(np.array(HERE, np.float32))),
    ("c.npy", npy(np.asfortranarray(HERE))),
]


@pytest.mark.parametrize(("name", "content"), GOOD, ids=[name for name, _ in GOOD])
def test_points_of_a_file(tmp_path: Path, name: str, content: str | bytes) -> None:
    job = read(tmp_path, name, content)
    keys = job.light.sources[0].keys
    assert job.light.frames == 3
    assert [(key.frame, list(key.position), key.intensity) for key in keys] == [
        (frame, point, (3.0, 3.0, 3.0)) for frame, point in enumerate(HERE)
    ]
    again = Job.model_validate(job_table(job))
    assert again.light == job.light


def test_directions_run_from_the_light_to_the_object(tmp_path: Path) -> None:
    for name, content in (("a.csv", XYZ), ("a.json", json.dumps(HERE))):
        keys = read(tmp_path, name, content, "directional").light.sources[0].keys
        assert [list(key.direction) for key in keys] == [[0.0 - value for value in point] for point in HERE]
    keys = read(tmp_path, "a.csv", "direction_x,direction_y,direction_z\n0,0,-1\n", "directional").light.sources[0].keys
    assert keys[0].direction == (0.0, 0.0, -1.0)
    assert read(tmp_path, "a.json", "[[0, 0, 1], [0, 0, -1]]", "directional").light.frames == 2, "opposite neighbours"


def test_strength_and_colour_of_each_row(tmp_path: Path) -> None:
    text = "x,y,z,intensity,color_r,color_g,color_b\n0,0,2,5,1,0.5,0.25\n0,1,2,6,1,1,1\n"
    first, second = read(tmp_path, "a.csv", text, intensity=None).light.sources[0].keys
    assert (first.intensity, first.color, second.intensity) == ((5.0,) * 3, (1.0, 0.5, 0.25), (6.0,) * 3)
    (key,) = read(tmp_path, "b.csv", "x,y,z,intensity_r,intensity_g,intensity_b\n0,0,2,5,6,7\n").light.sources[0].keys
    assert key.intensity == (5.0, 6.0, 7.0)


def test_sizes_of_each_row_or_of_all(tmp_path: Path) -> None:
    first, second = read(tmp_path, "a.csv", "x,y,z,radius\n0,0,2,0.1\n0,1,2,0.2\n").light.sources[0].keys
    assert (first.radius, second.radius) == (0.1, 0.2)
    assert {key.radius for key in read(tmp_path, "a.csv", XYZ, radius=0.25).light.sources[0].keys} == {0.25}
    key = read(tmp_path, "b.csv", XYZ, "directional", angle=0.53).light.sources[0].keys[0]
    assert key.angle == 0.53
    (problem,) = problems(tmp_path, "c.csv", "x,y,z,radius\n0,0,2,-1\n")
    assert problem.endswith("radius: expected a number of at least 0, got -1.0")


def test_a_temperature_for_all_positions(tmp_path: Path) -> None:
    key = read(tmp_path, "a.csv", XYZ, color="3200 K").light.sources[0].keys[0]
    assert key.color[0] > 1 > key.color[2] > 0


BROKEN = [
    ("a.csv", "", "row 1: expected the column names x, y, z or position_x, position_y, position_z, and optionally "
     "up_x, ..., intensity_r, ..., color_r, ..., intensity, color, radius, got none"),
    ("b.csv", "x,y\n1,2\n", "intensity, color, radius, got x, y"),
    ("c.csv", "x,y,z,x\n1,2,3,4\n", "got x, y, z, x"),
    ("d.csv", "x,y,z,position_x,position_y,position_z\n1,2,3,4,5,6\n",
     "got x, y, z, position_x, position_y, position_z"),
    ("e.csv", "x,y,z,power\n1,2,3,4\n", "got x, y, z, power"),
    ("f.csv", "x,y,z\n", "expected 1 to 100000 light positions, got 0"),
    ("g.csv", "x,y,z\n1,2,3\n1,2\n", "row 3: expected 3 cells, got 2"),
    ("h.csv", "x,y,z\n1,2,up\n", 'row 2: position[2]: expected a number, got "up"'),
    ("i.csv", "x,y,z\n1,2,nan\n", "row 2: position[2]: expected a number, got nan"),
    ("j.csv", "x,y,z\n1,2,1e13\n", "row 2: position[2]: expected a number from -1e+12 to 1e+12, got 10000000000000.0"),
    ("k.csv", "x,y,z,intensity\n1,2,3,-4\n", "row 2: intensity: expected a number of at least 0, got -4.0"),
    ("l.csv", 'x,y,z\n1,2,"3\n', "not valid CSV: unexpected end of data"),
    ("m.csv", b"x,y,z\n\xff,2,3\n", "expected UTF-8 text, got another encoding; save the file as UTF-8"),
    ("a.json", "[", "not valid JSON: Expecting value: line 1 column 2 (char 1)"),
    ("b.json", "{}", 'expected a list of [x, y, z] or of {"position": [...]}, got something else'),
    ("c.json", "[[1, 2]]", "entry 1: position: expected 3 numbers, got 2"),
    ("d.json", '[[1, 2, "a"]]', 'entry 1: position[2]: expected a number, got "a"'),
    ("e.json", '[{"position": [1, 2, 3], "directon": 1}]', 'entry 1: directon: unknown key'),
    ("f.json", '[{"frame": 0, "position": [1, 2, 3]}]',
     'entry 1: unknown key "frame"; the first entry is frame 0, the next 1, and so on'),
    ("g.json", '[{"position": [1, 2, 3], "color": 1}, {"position": [1, 2, 3]}]',
     "entry 2: color: expected in every row or in none"),
    ("h.json", "[[1, 2, true]]", "entry 1: position[2]: expected a number, got true"),
    ("i.json", "[" * 100000, "not valid JSON"),
    ("j.json", "[]", "expected 1 to 100000 light positions, got 0"),
    ("a.npy", b"", "not a valid .npy file"),
    ("b.npy", b"\x93NUMPY", "not a valid .npy file"),
    ("c.npy", npy(np.array(HERE))[:-8], "not a valid .npy file"),
    ("d.npy", npy(np.zeros((4, 2))), "expected an array of n x 3 numbers, got 4 x 2 of type float64"),
    ("e.npy", npy(np.zeros(())), "expected an array of n x 3 numbers, got one value of type float64"),
    ("f.npy", npy(np.array([["a", "b", "c"]])), "expected an array of n x 3 numbers, got 1 x 3 of type <U1"),
    ("g.npy", npy(np.array([[1, 2, None]], object), allow_pickle=True), "not a valid .npy file"),
    ("h.npy", npy(np.zeros((0, 3))), "expected 1 to 100000 light positions, got 0"),
    ("i.npy", npy(np.array([[0, 0, np.inf]])), "row 1: position[2]: expected a number from -1e+12 to 1e+12, got inf"),
    ("j.npy", npy(np.zeros((1, 3))).replace(b"(1, 3)", b"(9999999999, 3)"[:6]), "not a valid .npy file"),
    ("l.npy", npy(np.zeros((1, 3))).replace(b"NUMPY\1", b"NUMPY\11"), "not a valid .npy file"),
    ("m.npy", npy(np.zeros((3, 3), "M8[s]")), "expected an array of n x 3 numbers, got 3 x 3 of type "),
    ("n.csv", "x,y,z\n" + "0,0,1\n" * 100_001, "expected 1 to 100000 light positions, got 100001"),
    ("a.txt", "0 0 1\n", 'expected a file name that ends in one of .csv, .json, .npy, got ".txt"'),
    ("a", "0 0 1\n", 'expected a file name that ends in one of .csv, .json, .npy, got ""'),
]  # fmt: skip


@pytest.mark.parametrize(("name", "content", "message"), BROKEN, ids=[name for name, *_ in BROKEN])
def test_a_broken_file_is_one_message(tmp_path: Path, name: str, content: str | bytes, message: str) -> None:
    (problem,) = problems(tmp_path, name, content)
    assert problem.startswith(f'light.sources[0].file: "{name}": ')
    assert message in problem


def test_a_header_of_npy_allocates_nothing(tmp_path: Path) -> None:
    data = npy(np.zeros((1, 3))).replace(b"(1, 3), }" + b" " * 12, b"(1000000000000, 3), }")
    assert "not a valid .npy file" in problems(tmp_path, "a.npy", data)[0]


ZERO = [[0, 0, 1], [0, 0, 0]]


@pytest.mark.parametrize(
    ("name", "content", "place"),
    [
        ("a.csv", "x,y,z\n0,0,1\n0,0,0\n", "row 3"),
        ("a.json", json.dumps(ZERO), "entry 2"),
        ("a.npy", npy(np.array(ZERO)), "row 2"),
    ],
)
def test_a_direction_of_no_length(tmp_path: Path, name: str, content: str | bytes, place: str) -> None:
    found = problems(tmp_path, name, content, "directional")
    text = "direction: expected a direction, got the zero vector [0.0, 0.0, 0.0]"
    assert found == [f'light.sources[0].file: "{name}": {place}: {text}']


def test_a_file_needs_a_strength(tmp_path: Path) -> None:
    found = problems(tmp_path, "a.csv", XYZ, intensity=None)
    assert found == [
        'light.sources[0].file: "a.csv": the file has no intensity; give it next to `file`, as in intensity = 10'
    ]


@pytest.mark.parametrize("suffix", [".csv", ".json", ".npy"])
def test_files_that_are_missing_a_folder_or_too_large(tmp_path: Path, suffix: str) -> None:
    (tmp_path / f"b{suffix}").mkdir()
    with (tmp_path / f"c{suffix}").open("wb") as file:
        file.truncate(65 << 20)
    texts = ("no such file", "cannot be read: Is a directory", "expected at most 64 MB, got a bigger file")
    for name, text in zip((f"gone{suffix}", f"b{suffix}", f"c{suffix}"), texts, strict=True):
        assert problems(tmp_path, "a.csv", XYZ, file=name) == [f'light.sources[0].file: "{name}": {text}']


def test_a_wrong_column_is_reported_only_a_few_times(tmp_path: Path) -> None:
    found = problems(tmp_path, "a.csv", "x,y,z\n" + "a,0,0\n" * 100)
    assert len(found) == 11
    assert found[-1].endswith("and 90 more problems")


def test_a_dome_with_more_positions_than_its_axis(tmp_path: Path) -> None:
    found = lightjobs.problems(tmp_path, {"type": "dome", "positions": 5, "irradiance": 1}, frames=4)
    assert found == ["light.sources[0]: expected at most 4 positions, as its axis has, got 5"]


@pytest.mark.parametrize(("name", "content"), GOOD, ids=[name for name, _ in GOOD])
def test_any_file_is_positions_or_one_error(tmp_path: Path, name: str, content: str | bytes) -> None:
    """Fifty mutations of each: bytes changed, lost, doubled, and files cut off."""
    whole = content if isinstance(content, bytes) else content.encode()
    refused = 0
    for seed in range(50):
        rng = Random(seed)
        data = bytearray(whole)
        for _ in range(rng.randrange(1, 4)):
            at, n = rng.randrange(len(data) + 1), rng.randrange(1, 9)
            match rng.randrange(4):
                case 0:
                    data[at : at + n] = rng.randbytes(n)
                case 1:
                    del data[at : at + n]
                case 2:
                    data[at:at] = data[at : at + n]
                case _:
                    data = data[: max(at, 1)]
        (tmp_path / name).write_bytes(data)
        for kind, strength in (("point", "intensity"), ("directional", "irradiance")):
            try:
                keys = read_positions(tmp_path / name, kind, {strength: 1.0})
            except RowFileError as error:
                refused += 1
                assert all(library_phrase(problem) is None and len(problem) < 500 for problem in error.args)
            else:
                assert [key["frame"] for key in keys] == list(range(len(keys)))
    assert refused > 20, "most of them are broken"


@pytest.mark.parametrize("kind", LAMPS)
def test_rows_are_keys(tmp_path: Path, kind: str) -> None:
    """A file gives the job that its rows give as keys; the job is complete without the file."""
    job = read(tmp_path, "a.csv", XYZ, kind, **LAMPS[kind])
    keys = [{"frame": k, "position": list(at)} | LAMPS[kind] for k, at in enumerate(HERE)]
    written = {"light": {"sources": [{"type": kind, "keys": keys}]}, "scene": {"file": "a.glb"}}
    again = Job.model_validate(tiny.table() | written)
    assert job.light == again.light
    assert Job.model_validate(job_table(job)).light == job.light


def test_columns_of_a_spot(tmp_path: Path) -> None:
    text = "x,y,z,target_x,target_y,target_z,intensity,color,outer\n0,0,2,0,0,0,5,2700 K,30\n1,0,2,0,1,0,6,1,40\n"
    first, second = read(tmp_path, "a.csv", text, "spot", inner=5).light.sources[0].keys
    assert (first.target, first.intensity, first.outer, first.inner) == ((0, 0, 0), (5, 5, 5), 30, 5)
    assert first.color == black_body(2700.0)
    assert (second.target, second.color, second.outer) == ((0, 1, 0), (1, 1, 1), 40)


def test_columns_of_panels(tmp_path: Path) -> None:
    text = "position_x,position_y,position_z,width,height,power_r,power_g,power_b\n0,0,2,1,2,3,4,5\n"
    (key,) = read(tmp_path, "a.csv", text, "rect", direction=[0, 0, -1]).light.sources[0].keys
    assert (key.sides, key.power) == ((1, 2), (3, 4, 5))
    rows = [{"position": [0, 0, 2], "radius": 0.1, "radiance": 4, "target": [0, 0, 0]}]
    (key,) = read(tmp_path, "a.json", json.dumps(rows), "disc").light.sources[0].keys
    assert (key.radius, key.radiance) == (0.1, (4, 4, 4))


WRONG = [
    ("spot", {"target": [0, 0, 0]}, ["the file has no intensity; give it next to `file`, as in intensity = 10"]),
    ("disc", {"target": [0, 0, 0], "radius": 1},
     ["the file has no power or radiance; give it next to `file`, as in power = 10"]),
    ("rect", LAMPS["rect"] | {"radiance": 1},
     [f"row {k}: expected either `power` or `radiance`, got both" for k in (2, 3, 4)]),
    ("spot", LAMPS["spot"] | {"inner": 30},
     [f"row {k}: inner: expected at most 20, the angle `outer`, got 30" for k in (2, 3, 4)]),
    ("spot", {"intensity": 3},
     ["the file has no direction or target; give one next to `file`, as in target = [0, 1, 0]"]),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "source", "texts"), WRONG)
def test_what_a_file_lacks(tmp_path: Path, kind: str, source: dict[str, Any], texts: list[str]) -> None:
    assert problems(tmp_path, "a.csv", XYZ, kind, **source) == [
        f'light.sources[0].file: "a.csv": {text}' for text in texts
    ]


def test_a_target_in_some_rows(tmp_path: Path) -> None:
    rows = [{"position": [0, 0, 2], "target": [0, 0, 0]}, {"position": [0, 0, 2], "direction": [0, 0, -1]}]
    found = problems(tmp_path, "a.json", json.dumps(rows), "spot", intensity=1)
    assert found == [f'light.sources[0].file: "a.json": entry 2: {name}: expected in every row or in none' for name in
                     ("direction", "target")]  # fmt: skip
