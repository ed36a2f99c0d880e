"""Hundreds of broken files of light positions: a message each, and exit code 2, before the scene is read."""

import io
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from support import tiny
from support.phrases import library_phrase
from support.program import names, run

ROWS = [[0.0, 0.0, 2.0], [1.0, 0.5, 2.0], [-1.0, 0.25, 1.5]]
WRONG = {"text": "up", "nan": "nan", "infinite": "inf", "less": "-inf", "far": "1e13", "empty": "", "comma": "1;5"}


def csv(rows: Any, header: str = "x,y,z") -> str:
    return "\n".join([header, *(",".join(map(str, row)) for row in rows), ""])


def lp(rows: Any, count: object = None) -> str:
    head = len(rows) if count is None else count
    return "\n".join([str(head), *(" ".join(map(str, [f"shot {k}.jpg", *row])) for k, row in enumerate(rows)), ""])


def dome(rows: Any, **others: Any) -> str:
    return json.dumps({"lightConfiguration": "lights3d", "positions": rows, **others})


def npy(array: Any) -> bytes:
    file = io.BytesIO()
    np.save(file, array, allow_pickle=True)
    return file.getvalue()


def with_cell(i: int, k: int, value: object) -> list[list[Any]]:
    rows: list[list[Any]] = [list(row) for row in ROWS]
    rows[i][k] = value
    return rows


def with_row(i: int, row: Any) -> list[Any]:
    return [*ROWS[:i], row, *ROWS[i + 1 :]]


def anything() -> Iterator[tuple[str, bytes, str]]:
    """Contents that no format has: a name, the bytes, and what the message must have."""
    yield "empty", b"", ""
    yield "blank", b"\n \n\n", ""
    yield "binary", bytes(range(256)) * 4, ""
    yield "zeros", bytes(500), ""
    yield "utf-16", csv(ROWS).encode("utf-16"), ""
    yield "page", b"<!doctype html>\n<title>404</title>\n", ""
    yield "prose", b"The lamps are on a ring of two metres.\n", ""
    yield "null", b"null", ""
    yield "number", b"12", ""
    yield "picture", b"\x89PNG\r\n\x1a\n" + bytes(60), ""
    yield "long line", b"9" * 100_000, ""


def broken_csv() -> Iterator[tuple[str, Any, str]]:
    for i in range(3):
        yield f"row {i} short", csv(with_row(i, ROWS[i][:2])), f"row {i + 2}: expected 3 cells, got 2"
        yield f"row {i} long", csv(with_row(i, [*ROWS[i], 1])), f"row {i + 2}: expected 3 cells, got 4"
        for k in range(3):
            for what, text in WRONG.items():
                yield f"{what} at {i}, {k}", csv(with_cell(i, k, text)), f"row {i + 2}: "
    for header in ("a,b,c", "x,y", "x,y,y", "x;y;z", "x\ty\tz", "0,0,2", "x,y,z,power", "eye_x,eye_y,eye_z"):
        yield f"columns {header}", csv(ROWS, header), "row 1: expected the column names "
    yield "no rows", "x,y,z\n", "expected 1 to 100000 light positions, got 0"
    yield "too many rows", "x,y,z\n" + "0,0,1\n" * 100_001, "got 100001"
    yield "open quote", 'x,y,z\n0,0,"2\n', "not valid CSV"
    yield "cut", csv(ROWS)[:-6], "expected 3 cells"


def broken_json() -> Iterator[tuple[str, Any, str]]:
    whole = json.dumps(ROWS)
    for n in range(1, len(whole), 3):
        yield f"cut at {n}", whole[:n], "not valid JSON"
    for i in range(3):
        for row in ([], [1, 2], [1, 2, 3, 4], {}, {"x": 1, "y": 2, "z": 3}, {"position": [1, 2]}):
            yield f"row {i} is {row}", json.dumps(with_row(i, row)), f"entry {i + 1}: "
        for k in range(3):
            for value in ("up", None, True, [1], {}, float("nan"), float("inf"), 1e300):
                yield f"{value} at {i}, {k}", json.dumps(with_cell(i, k, value)), f"entry {i + 1}: "
    for table in ({}, {"rows": ROWS}, "rows", 3, [[]], [1, 2, 3], [None]):
        yield f"is {table}", json.dumps(table), "expected "


def broken_lp() -> Iterator[tuple[str, Any, str]]:
    for count in (0, 1, 2, 4, 300, -3, "3.0", "three", "", "0x3", "3 lamps", "nan"):
        yield f"count {count}", lp(ROWS, count), "row "
    for i in range(3):
        yield f"row {i} short", lp(with_row(i, [1])), f"row {i + 2}: expected the name of an image and 3 numbers"
        yield f"row {i} without a name", lp(ROWS).replace(f"shot {i}.jpg ", ""), f"row {i + 2}: "
        for k in range(3):
            for what, text in WRONG.items():
                yield f"{what} at {i}, {k}", lp(with_cell(i, k, text)), f"row {i + 2}: "
    yield "cut", lp(ROWS).rsplit("\n", 2)[0], "row 1: expected 2, the number of rows below, got "
    yield "no count", lp(ROWS).split("\n", 1)[1], "row 1: expected the number of light positions"


def broken_dome() -> Iterator[tuple[str, Any, str]]:
    whole = dome(ROWS)
    for n in range(1, len(whole), 5):
        yield f"cut at {n}", whole[:n], "not valid JSON"
    for value in ("cube", "", 3, None, [], {}):
        yield f"configuration {value}", dome(ROWS, lightConfiguration=value), "lightConfiguration: expected one of "
    for value in ("rows", 3, {"0": ROWS}, True):
        yield f"positions {value}", dome(value), "positions: expected a list"
    for value in ([], None, 0, ""):
        yield f"positions {value}", dome(value), "the file has no "
    for i in range(3):
        for row in ([], [1, 2], [1, 2, 3, 4], {}, {"x": 1, "y": 2}, {"x": 1, "y": 2, "z": "up"}, "1 2 3", None):
            yield f"row {i} is {row}", dome(with_row(i, row)), f"positions[{i}]: "


def broken_npy() -> Iterator[tuple[str, Any, str]]:
    whole = npy(np.array(ROWS))
    for n in (1, 5, 6, 7, 9, 10, 50, 100, 127):
        yield f"cut at {n}", whole[:n], "not a valid .npy file; expected one that numpy.save writes"
    for n in (128, 129, 160, len(whole) - 8, len(whole) - 1):
        yield f"cut at {n}", whole[:n], "expected 9 numbers of 8 bytes, got "
    yield "longer", whole + b"\0", "expected 9 numbers of 8 bytes, got 73 bytes"
    for shape in ((9,), (3, 2), (3, 4), (1, 3, 3), (), (3, 0)):
        yield f"shape {shape}", npy(np.zeros(shape)), "expected an array of n x 3 numbers, got "
    for dtype in ("U4", "S4", "O", "bool", "complex128", "M8[s]"):
        yield f"type {dtype}", npy(np.zeros((3, 3), dtype)), "expected an array of n x 3 numbers, got 3 x 3 of type "
    for i in range(3):
        for value in (np.nan, np.inf, -np.inf, 1e13):
            yield f"{value} in row {i}", npy(np.array(with_cell(i, 1, value))), f"row {i + 1}: position[1]: expected "
    yield "no rows", npy(np.zeros((0, 3))), "expected 1 to 100000 light positions, got 0"
    yield "version 9", whole.replace(b"NUMPY\1", b"NUMPY\11"), "not a valid .npy file"


BROKEN = {".csv": broken_csv, ".json": broken_json, ".lp": broken_lp, ".dome": broken_dome, ".npy": broken_npy}


def check(capsys: Any, folder: Path, name: str, kind: str = "point") -> list[str]:
    """Run `check` on a job with the file; return its problems, each as it must be."""
    strength = "intensity" if kind == "point" else "irradiance"
    light = {"sources": [{"type": kind, "file": name, strength: 3.0}]}
    table = tiny.table() | {"light": light, "scene": {"file": "there-is-none.glb"}}
    (folder / "job.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    result = run(capsys, "check", folder / "job.toml")
    assert (result.code, result.out) == (2, "")
    *problems, end = result.err.splitlines()
    assert re.fullmatch(r"(1 problem|\d+ problems); the job cannot be rendered\.", end)
    head = f'{folder / "job.toml"}: light.sources[0].file: "{name}": '
    texts = [problem.removeprefix(head) for problem in problems]
    assert all(problem.startswith(head) for problem in problems[:1])
    assert 1 <= len(problems) <= 11 and max(map(len, texts)) < 400
    assert not any("Traceback" in text or library_phrase(text) for text in texts)
    return texts


def test_what_no_format_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for suffix in BROKEN:
        for what, data, _ in anything():
            (tmp_path / f"a{suffix}").write_bytes(data)
            (text, *_) = check(capsys, tmp_path, f"a{suffix}")
            assert "expected" in text.lower() or "not valid" in text, (suffix, what, text)


@pytest.mark.parametrize("suffix", BROKEN)
def test_broken_files(suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cases = list(BROKEN[suffix]())
    assert len(cases) > 40
    for what, content, message in cases:
        (tmp_path / f"a{suffix}").write_bytes(content if isinstance(content, bytes) else content.encode())
        texts = check(capsys, tmp_path, f"a{suffix}")
        assert message in texts[0], what
        assert names(tmp_path) == {"job.toml", f"a{suffix}"}


@pytest.mark.parametrize("suffix", BROKEN)
def test_files_too_large_and_none(suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = f"a{suffix}"
    assert check(capsys, tmp_path, name) == ["no such file"]
    with (tmp_path / name).open("wb") as file:
        file.truncate(65 << 20)
    assert check(capsys, tmp_path, name) == ["expected at most 64 MB, got a bigger file"]
    (tmp_path / name).unlink()
    (tmp_path / name).mkdir()
    assert check(capsys, tmp_path, name) == ["cannot be read: Is a directory"]


@pytest.mark.parametrize("suffix", BROKEN)
def test_directions_without_length(suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    makers: dict[str, Any] = {".csv": csv, ".json": json.dumps, ".lp": lp, ".dome": dome, ".npy": npy}
    content = makers[suffix](np.array(with_row(1, [0.0, 0.0, 0.0])) if suffix == ".npy" else with_row(1, [0, 0, 0]))
    (tmp_path / f"a{suffix}").write_bytes(content if isinstance(content, bytes) else content.encode())
    (text,) = check(capsys, tmp_path, f"a{suffix}", "directional")
    assert "direction: expected a direction, got the zero vector" in text
