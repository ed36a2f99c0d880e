"""Properties of all readers of files: any content gives a valid result, or one error of the right kind."""

import json
import tomllib
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import pytest
import tomli_w
from fuzz import jobseeds, tables, texts
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from support.movies import array_of
from support.phrases import library_phrase

from framearray_cli.array.manifest import check_pattern
from framearray_cli.array.manifest_toml import read_manifest, to_toml
from framearray_cli.array.places import frames_text, parse_places, read_indices
from framearray_cli.array.record import seal, unseal
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.forms.problems import problems_of
from framearray_cli.base.forms.schema import file_schema
from framearray_cli.job.job import Job, job_schema
from framearray_cli.job.read import job_table, read_job
from framearray_cli.tools.movie.pathfile import MoviePath, load_movie_path
from framearray_cli.tools.movie.timeline import MOST_FRAMES, array_problems, make_timeline

SEEDS = jobseeds.tables("a.glb")
SCHEMA = job_schema()
SEGMENTS: tuple[dict[str, Any], ...] = (
    {"segments": [{"frames": 5, "camera": ["first", "last"]}]},
    {"segments": [{"frames": 3, "camera": 1, "light": [0, -1]},
    {"seconds": 0.2, "light": ["50%", "first"], "reverse": True}]},
    {
        "fps": 12,
        "positions": "blend",
        "segments": [
            {"seconds": 0.5, "light": [0, 0.5, 1], "ease": "in-out", "loops": 2, "back_and_forth": True},
            {"frames": 4, "camera": [0, 2], "hold": 0.25, "positions": "nearest", "ease": "out"},
        ],
    },
    {
        "segments": [{"frames": 6, "camera": [0, 1], "axes": {"lamp": [0, 1]}}],
        "groups": {
            "sun": {"intensity": [{"time": 0, "value": 1.0}, {"time": "50%", "value": 0.2}], "color": [1, 0.5, 0.2]},
            "lamp": {"intensity": 2.0},
            "background": {"color": [{"time": 0.1, "value": [1, 1, 0.5]}]},
        },
        "ambient": {"intensity": 0.5},
    },
)  # fmt: skip
ODD = st.recursive(
    st.none() | st.booleans() | st.integers() | st.just(10**400) | st.floats() | st.text(max_size=9)
    | st.dates() | st.times() | st.datetimes(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)  # fmt: skip


def quick(examples: int):
    """Settings for that many examples in one folder."""
    return settings(max_examples=examples, suppress_health_check=[HealthCheck.function_scoped_fixture])


def changed(rng: Random, text: str, schema: Any) -> bytes:
    """A TOML file with other values, or with other words or bytes."""
    if rng.random() < 0.6:
        return tomli_w.dumps(tables.mutated(rng, tomllib.loads(text), schema)[1]).encode("utf-8", "replace")
    return rng.choice(list(texts.TEXT.values()))(rng, text.encode())


@pytest.mark.parametrize("seed", sorted(SEEDS))
def test_the_seeds_are_jobs(seed):
    job = Job.model_validate(SEEDS[seed])
    assert Job.model_validate(job_table(job)) == job


def test_the_seeds_have_every_table_of_the_schema():
    keys = {key for table in SEEDS.values() for key in table}
    assert keys == set(SCHEMA["properties"])
    assert {source["type"] for table in SEEDS.values() for source in table["light"]["sources"]} == {
        "point", "directional", "spot", "rect", "disc", "mesh", "sun", "dome", "environment",
    }  # fmt: skip


def toml_key(place):
    """Write a place as messages do."""
    whole = ""
    for step in place:
        whole += f"[{step}]" if isinstance(step, int) else f".{step}" if whole else str(step)
    return whole


@quick(600)
@given(data=st.data())
def test_a_wrong_value_is_reported_with_its_place(data):
    """Any value at any place of any job gives a job, or problems, one of them at that place, above or below it."""
    table = tomllib.loads(tomli_w.dumps(SEEDS[data.draw(st.sampled_from(sorted(SEEDS)))]))
    place = data.draw(st.sampled_from(list(tables.places(table))))
    value = data.draw(ODD)
    before = tables.at(table, place)
    tables.put(table, place, value)
    try:
        job = Job.model_validate(table)
    except ValidationError as error:
        found = problems_of(error, Job)
        key = toml_key(place)
        # problems that follow from the value, such as keys beyond `frames`, are reported in the same table or its list
        top = toml_key(place[:1])
        assert found, (place, before, value)
        assert any(problem.startswith((key, top)) or key.startswith(problem.split(":")[0]) for problem in found), found
        for problem in found:
            assert ": " in problem
            assert len(problem) < 700
            assert not any(word in problem.lower() for word in ("pydantic", "validat", "traceback", "http"))
            assert library_phrase(problem) is None
    else:
        assert Job.model_validate(job_table(job)) == job


@quick(250)
@given(seed=st.integers(0, 2**32))
def test_any_job_file_is_a_job_or_refused(tmp_path, seed):
    """Mutations of tables and of bytes."""
    rng = Random(seed)
    file = tmp_path / "job.toml"
    file.write_bytes(changed(rng, tomli_w.dumps(rng.choice(list(SEEDS.values()))), SCHEMA))
    try:
        job = read_job(file)
    except JobError as error:
        assert error.problems
        assert str(error).startswith(f"{file}: ")
        assert len(str(error)) < 20_000
        assert library_phrase(str(error)) is None
    else:
        assert job.file == file


@quick(200)
@given(seed=st.integers(0, 2**32))
def test_any_path_file_is_a_movie_or_refused(tmp_path, seed):
    rng = Random(seed)
    file = tmp_path / "path.toml"
    file.write_bytes(changed(rng, tomli_w.dumps(rng.choice(SEGMENTS)), file_schema(MoviePath)))
    array = array_of(rng.choice((1, 3)), rng.choice((1, 4)))
    try:
        movie = load_movie_path(file, partial(array_problems, manifest=array))
        if sum(segment.n_passes for segment in movie.segments) * 1000 < MOST_FRAMES:
            line = make_timeline(file, movie, array)
        else:
            return
    except JobError as error:
        assert str(error).startswith(f"{file}: ")
        assert library_phrase(str(error)) is None
    else:
        assert all(0 <= shot.c < array.n_cameras for shot in line.shots)
        assert all(0 <= position <= array.n_lights - 1 for shot in line.shots for position in shot.positions)


@quick(200)
@given(seed=st.integers(0, 2**32))
def test_any_manifest_is_read_or_refused(tmp_path, seed):
    rng = Random(seed)
    whole = to_toml(array_of(rng.choice((1, 3)), rng.choice((1, 2))))
    file = tmp_path / "manifest.toml"
    file.write_bytes(changed(rng, whole, {}))
    try:
        manifest = read_manifest(tmp_path)
    except OutputError as error:
        assert str(error).startswith(f"{file}: ")
        assert len(str(error)) < 3000
    else:
        (tmp_path / "again").mkdir(exist_ok=True)
        (tmp_path / "again" / "manifest.toml").write_text(to_toml(manifest), encoding="utf-8")
        assert to_toml(read_manifest(tmp_path / "again")) == to_toml(manifest)


PATTERN = st.lists(
    st.sampled_from(
        ["{camera}", "{light:03d}", "{camera:04d}", "{camera!r}", "{", "}", "{{", "..", "/", "\\", ":", "a.png", "\0"]
    ),
    max_size=7,
).map("".join)  # fmt: skip


@quick(300)
@given(pattern=PATTERN)
def test_a_file_pattern_stays_in_its_folder(tmp_path, pattern):
    try:
        check_pattern("images", pattern, {"camera": True, "light": True})
    except ValueError as error:
        assert str(error).startswith("images: ")
        return
    names = {tmp_path / pattern.format(camera=c, light=l) for c in range(2) for l in range(12)}
    assert len(names) == 24
    assert all(Path(*name.parts).resolve().is_relative_to(tmp_path.resolve()) for name in names)


RANGE = st.text(st.sampled_from("0123456789-x:y, %."), max_size=14) | st.text(max_size=5)


@quick(300)
@given(text=RANGE, n=st.integers(1, 3000))
def test_a_range_gives_frames_that_exist(text, n):
    try:
        frames = sorted(int(index) for index in set(parse_places(text, n)))
    except ValueError as error:
        assert "expected" in str(error)
        return
    assert frames[0] >= 0
    assert frames[-1] < n
    assert parse_places(frames_text(frames), n) == frames


PLACE = st.text(st.sampled_from("0123456789-+.%e,firstla "), max_size=9) | st.text(max_size=5)


@quick(300)
@given(text=PLACE, n=st.integers(1, 100))
def test_a_place_is_an_index_that_exists(text, n):
    try:
        found = read_indices("--cameras", text, n)
    except JobError as error:
        assert str(error).startswith("--cameras: expected")
    else:
        assert found
        assert all(0 <= index < n for index in found)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)


@quick(200)
@given(
    table=st.dictionaries(st.text(max_size=6).filter(lambda key: key != "check"), JSON, min_size=1, max_size=4),
    at=st.integers(0, 10**6),
    bit=st.integers(0, 7),
)
def test_a_sealed_line_reads_back_or_is_refused(table, at, bit):
    line = seal(table)
    found = unseal(line)
    assert found == json.loads(json.dumps(table))
    broken = bytearray(line)
    broken[at % len(line)] ^= 1 << bit
    assert unseal(bytes(broken)) is None
    assert unseal(line[: at % len(line)]) is None
