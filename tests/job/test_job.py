"""A whole job, its defaults, and rules between keys."""

import copy
import re
import tomllib
from pathlib import Path

import jsonschema
import pytest
from pydantic import ValidationError

from framearray_cli.base.forms.problems import problems_of
from framearray_cli.base.forms.table import changed
from framearray_cli.job.job import Job, job_schema
from framearray_cli.job.read import job_table

EXAMPLE = """
name = "cabin"                    # starts every file name
seed = 0

[scene]
file = "scenes/cabin.glb"         # anything trimesh reads, relative to the job file
up = "y"                          # "y" or "z"; default by format (glTF: y)
background = [0.0, 0.0, 0.0]      # radiance of what lies outside
[scene.materials."Chrome"]        # overrides by material name
reflectivity = [0.1, 0.1, 0.1]
specular = [0.8, 0.8, 0.8]

[camera]
resolution = [400, 300]
fov = 60.0                        # vertical, degrees
frames = 192                      # N_c
keys = [                          # interpolated smoothly; one key: a fixed camera
  { frame = 0,   eye = [0.0, 1.6, 3.0], target = [0.0, 1.2, 0.0] },
  { frame = 191, eye = [2.0, 1.6, 0.5], target = [0.0, 1.2, 0.0] },
]

[light]
frames = 48                       # N_l
[[light.sources]]                 # one or more; all of them shine together at light index l
type = "point"                    # "point": intensity, W/sr; "directional": irradiance, W/m2, and direction
keys = [
  { frame = 0,  position = [1.0, 2.2, 0.0], intensity = [10.0, 10.0, 9.0] },
  { frame = 47, position = [-1.0, 2.2, 0.0], intensity = [10.0, 10.0, 9.0] },
]

[samples]
hits = 2                          # native hits per pixel and frame
obscurance = 5                    # obscurance rays per hit

[reuse]
n_r = 3
weights = "balance"               # or "average"

[obscurance]
range = 1.5                       # d_max, in scene units
falloff = "sqrt"
outside = "average"               # or "background"

[ambient]
paths = 1024                      # walks

[specular]
depth = 4

[output]
directory = "../out/cabin"        # relative to the job file
format = "exr"                    # exr | png | tif | jpg
fps = 24
"""


@pytest.fixture
def table():
    return tomllib.loads(EXAMPLE)


def read(table, job_file=Path("/jobs/cabin.toml")):
    return Job.model_validate(table, context={"job_file": job_file})


def problems(table):
    """Collect the problems of a table that has some."""
    with pytest.raises(ValidationError) as caught:
        read(table)
    return problems_of(caught.value, Job)


def replaced(table, place, value):
    """Copy a table with one key set: replaced(table, "light.sources.0.type", "point")."""
    whole = copy.deepcopy(table)
    *steps, last = [int(step) if step.isdigit() else step for step in place.split(".")]
    node = whole
    for step in steps:
        node = node.setdefault(step, {}) if isinstance(node, dict) else node[step]
    node[last] = value
    return whole


def test_every_key_of_the_example_arrives(table):
    job = read(table)
    assert (job.name, job.seed, job.file) == ("cabin", 0, Path("/jobs/cabin.toml"))
    assert job.scene.file == Path("/jobs/scenes/cabin.glb")
    assert job.scene.background == (0.0, 0.0, 0.0)
    assert job.scene.materials["Chrome"].reflectivity == (0.1, 0.1, 0.1)
    assert job.scene.materials["Chrome"].specular == (0.8, 0.8, 0.8)
    assert (job.camera.resolution, job.camera.fov, job.camera.frames) == ((400, 300), 60.0, 192)
    assert [(key.frame, key.eye, key.target) for key in job.camera.keys] == [
        (0, (0.0, 1.6, 3.0), (0.0, 1.2, 0.0)),
        (191, (2.0, 1.6, 0.5), (0.0, 1.2, 0.0)),
    ]
    assert (job.light.frames, job.light.sources[0].type) == (48, "point")
    assert job.light.sources[0].keys[1].position == (-1.0, 2.2, 0.0)
    assert job.light.sources[0].keys[1].intensity == (10.0, 10.0, 9.0)
    assert (job.samples.hits, job.samples.obscurance, job.reuse.n_r, job.reuse.weights) == (2, 5, 3, "balance")
    assert (job.obscurance.range, job.obscurance.falloff, job.obscurance.outside) == (1.5, "sqrt", "average")
    assert (job.ambient.paths, job.ambient.intensity) == (1024, None)
    assert job.specular.depth == 4
    assert (job.output.directory, job.output.format, job.output.fps) == (Path("/out/cabin"), "exr", 24.0)


def test_defaults_follow_the_other_keys(table):
    for section, key in [("camera", "frames"), ("light", "frames"), ("scene", "up"), ("output", "directory")]:
        del table[section][key]
    for section in ["samples", "reuse", "ambient", "specular", "output"]:
        del table[section]
    table["obscurance"] = {"range": 2}
    job = read(table)
    assert (job.camera.frames, job.light.frames) == (192, 48)
    assert (job.specular.hits, job.specular.depth) == (14, 4)
    assert job.output.directory == Path("/out/cabin")
    assert job.ambient.paths is None
    assert job.render.threads is None
    assert job.obscurance.range == 2.0
    table["camera"] = {"type": "panorama", "keys": table["camera"]["keys"]}
    assert read(table).camera.resolution == (400, 200)


@pytest.mark.parametrize(
    ("n_r", "hits", "mirror"),
    [
        (0, 1, 1), (5, 3, 33), (64, 503, 503 * 129), (3, 0.5, 4), (0, 0.125, 1),
        ("auto", "auto", 14), ("auto", 2, 14), ("auto", 0.5, 4), (9, "auto", 14),
    ],
)  # fmt: skip
def test_mirror_pixels_get_the_total_of_their_neighbours(table, n_r, hits, mirror):
    table["reuse"]["n_r"], table["samples"]["hits"] = n_r, hits
    job = read(table)
    assert job.specular.hits == mirror
    assert read(job_table(job)) == job


@pytest.mark.parametrize(("file", "up"), [("a.glb", "y"), ("a.OBJ", "y"), ("a.stl", "z"), ("a.PLY", "z"), ("a", "y")])
def test_up_follows_the_format(table, file, up):
    table["scene"] = {"file": file}
    assert read(table).scene.up == up


def test_two_jobs_do_not_share_their_defaults(table):
    del table["specular"], table["output"]
    first = read(table)
    read({**table, "name": "other", "samples": {"hits": 7}})
    assert first.specular.hits == 14
    assert first.output.directory == Path("/out/cabin")


def test_a_job_is_frozen(table):
    with pytest.raises(ValidationError):
        read(table).seed = 3


def test_one_number_is_grey(table):
    table["scene"]["background"] = 2
    table["ambient"] = {"intensity": 0.5}
    job = read(table)
    assert job.scene.background == (2.0, 2.0, 2.0)
    assert job.ambient.intensity == (0.5, 0.5, 0.5)


# A place, a wrong value, and where the problem is: at the place, below it, or at another key (wording: cli/golden)
WRONG = [
    ("name", "a/b", ""), ("name", 3, ""), ("seed", -1, ""), ("seed", True, ""), ("seed", 10**30, ""),
    ("scene.file", "", ""), ("scene.up", "x", ""), ("scene.background", [1, 2], ""), ("scene.background", "red", ""),
    ("scene.background", -1, ""), ("scene.materials.Chrome", 1, ""),
    ("scene.materials.Chrome.specular", [0.1, 0.95, 0.1], ""),
    ("scene.materials.Chrome.reflectivity", [0, 0, 1.5], "[2]"), ("camera", 3, ""), ("camera", [{}], ""),
    ("camera.resolution", [400, 300.0], "[1]"), ("camera.resolution", [1, 16385], "[1]"), ("camera.fov", 180, ""),
    ("camera.fov", float("nan"), ""), ("camera.fov", False, ""), ("camera.frames", 0, ""),
    ("camera.frames", 100, "camera.keys[1].frame"), ("camera.keys", [], ""),
    ("camera.file", "eyes.csv", "camera.keys"), ("camera.keys.1.frame", 0, ""),
    ("camera.keys.1.eye", [1, 2, "3"], "[2]"), ("camera.keys.1.eye", [1, 2, True], "[2]"),
    ("camera.keys.1.eye", [1, 2, 1e13], "[2]"), ("camera.keys.1.eye", [0.0, 1.2, 0.0], "camera.keys[1].target"),
    ("camera.keys.0.up", [0, 0, 0], ""), ("camera.keys.1.up", [0, 1, 0], "camera.keys[0].up"),
    ("light.frames", 47, "light.sources[0].keys[1].frame"), ("light.sources", [], ""), ("light.sources", {}, ""),
    ("light.sources.0.type", "torch", ""), ("light.sources.0", {"keys": []}, ".type"),
    ("light.sources.0.keys", [], ""), ("light.sources.0.keys.0.color", 1, "light.sources[0].keys[1].color"),
    ("samples.hits", 0, ""), ("reuse.n_r", 65, ""), ("samples.hits", 9286, ""), ("samples.hits", "two", ""),
    ("obscurance.range", 0, ""), ("obscurance.range", float("inf"), ""), ("obscurance.range", 1e13, ""),
    ("obscurance.falloff", "cubic", ""), ("output.fps", "24", ""), ("output.layers", 1, ""),
]  # fmt: skip


def bracketed(place):
    """Write a place as messages do: light.sources[0].type."""
    return re.sub(r"\.(\d+)", r"[\1]", place)


@pytest.mark.parametrize(("place", "value", "where"), WRONG, ids=[f"{place}={value}" for place, value, _ in WRONG])
def test_a_wrong_value_is_reported(table, place, value, where):
    [problem] = problems(replaced(table, place, value))
    at = where if where[:1].isalpha() else bracketed(place) + where
    assert re.match(rf"{re.escape(at)}: (expected|missing)", problem), problem


def test_fixed_ambient_light_excludes_method_and_paths(table):
    table["ambient"]["intensity"] = [1, 1, 1]
    text = "expected no value, because `intensity` fixes the ambient light; remove one of the two"
    assert problems(table) == [f"ambient.paths: {text}"]


def test_opposite_directions_need_a_key_between(table):
    keys = [{"frame": f, "direction": d, "irradiance": 1} for f, d in [(0, [1, 0, 0]), (9, [-3, 0, 0])]]
    table["light"] = {"sources": [{"type": "directional", "keys": keys}]}
    assert problems(table) == [
        "light.sources[0].keys[1].direction: expected less than half a turn from the key before, "
        "got the opposite direction; add a key between"
    ]


UNKNOWN = [
    "samples.obscurence", "reuse.N_R", "camera.hits", "fov", "camera.keys.0.look_at", "specular.qqq",
    "light.sources.0.keys.0.irradiance", "light.sources.0.latitude", "light.sources.0.keys.0.angle",
]  # fmt: skip


@pytest.mark.parametrize("place", UNKNOWN)
def test_an_unknown_key_is_reported(table, place):
    [problem] = problems(replaced(table, place, 1))
    assert problem.startswith(f"{bracketed(place)}: unknown key")


def test_directional_source_with_the_keys_of_a_point(table):
    table["light"]["sources"][0]["type"] = "directional"
    del table["light"]["sources"][0]["keys"][1]
    assert problems(table) == [
        "light.sources[0].keys[0].direction: missing; expected 3 numbers",
        "light.sources[0].keys[0].irradiance: missing; expected a number or 3 numbers of at least 0",
        'light.sources[0].keys[0].position: unknown key; did you mean "direction"?',
        'light.sources[0].keys[0].intensity: unknown key; did you mean "irradiance"?',
    ]


# What JSON Schema cannot express: rules between keys, numbers that JSON lacks, and 300.0, which is an integer there.
NOT_IN_SCHEMA = [
    "scene.materials.Chrome.specular=[0.1, 0.95, 0.1]",
    "camera.resolution=[400, 300.0]",
    "camera.fov=nan",
    "camera.frames=100",
    "camera.file=eyes.csv",
    "camera.keys.1.frame=0",
    "camera.keys.1.eye=[1, 2, 10000000000000.0]",
    "camera.keys.1.eye=[0.0, 1.2, 0.0]",
    "camera.keys.0.up=[0, 0, 0]",
    "camera.keys.1.up=[0, 1, 0]",
    "light.frames=47",
    "light.sources.0.keys.0.color=1",
    "samples.hits=9286",
]


def test_schema_accepts_what_the_job_accepts_and_refuses_the_rest(table):
    jsonschema.Draft202012Validator.check_schema(job_schema())
    validator = jsonschema.Draft202012Validator(job_schema())
    validator.validate(table)
    validator.validate(job_table(read(table)))
    missed = [f"{place}={value}" for place, value, _ in WRONG if validator.is_valid(replaced(table, place, value))]
    assert missed == NOT_IN_SCHEMA
    for place in UNKNOWN:
        assert not validator.is_valid(replaced(table, place, 1)), place


def test_auto_has_no_number_before_it_is_resolved(table):
    table["reuse"]["n_r"] = table["samples"]["hits"] = "auto"
    job = read(table)
    for name, key in (("n_r", "reuse.n_r"), ("hits", "samples.hits")):
        with pytest.raises(ValueError, match=f'^{key} is "auto": call resolve_auto'):
            getattr(job, name)
    numbers = read({**table, "reuse": {}, "samples": {"hits": 0.333}})
    assert (numbers.n_r, numbers.hits) == (3, 1 / 3)


def test_a_changed_table_keeps_the_rest():
    job = Job.model_validate(tomllib.loads(EXAMPLE))
    fewer = changed(job, render=changed(job.render, threads=3), samples=changed(job.samples, hits=2.0))
    assert (fewer.render.threads, fewer.samples.hits) == (3, 2.0)
    assert fewer.specular == job.specular and fewer.output == job.output and fewer.file == job.file
    assert fewer.samples.model_fields_set == job.samples.model_fields_set | {"hits"}


@pytest.mark.parametrize(
    ("name", "values", "error"),
    [
        ("render", {"threads": 0}, ValidationError),
        ("render", {"threads": 1025}, ValidationError),
        ("render", {"threads": "3"}, ValidationError),
        ("render", {"memory": 0}, ValidationError),
        ("reuse", {"n_r": -1}, ValidationError),
        ("samples", {"hits": 0.4}, ValidationError),
        ("ambient", {"intensity": (1.0, -1.0, 1.0)}, ValidationError),
        ("render", {"thread": 3}, KeyError),
    ],
)
def test_values_that_no_file_may_have_are_refused(name, values, error):
    with pytest.raises(error):
        changed(getattr(Job.model_validate(tomllib.loads(EXAMPLE)), name), **values)


def test_a_table_of_another_kind_is_refused():
    job = Job.model_validate(tomllib.loads(EXAMPLE))
    with pytest.raises(TypeError):
        changed(job, render=job.samples)


def test_a_changed_table_may_hold_what_no_file_may():
    """Where a pilot allots the hits, a job has hits beside the wanted error."""
    job = Job.model_validate(tomllib.loads(EXAMPLE) | {"samples": {"error": 0.1}})
    assert changed(job, samples=changed(job.samples, hits=3.0)).samples.hits == 3.0
