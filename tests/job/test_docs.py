"""The published reference page and schema are those of the job."""

import re
import tomllib

from pages.jobfile import EXAMPLE, reference_page, schema_text
from support import ROOT

from framearray_cli.base.forms.schema import allowed_values, file_schema, find, sections
from framearray_cli.job.job import Job

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
