"""`framearray schema`: each schema is valid, takes what the program takes, and refuses what it refuses."""

import json
import tomllib
from typing import Any

import jsonschema
import pytest
from support import handmade
from support.program import run

from framearray_cli.cli.commands.schemas import KINDS


def schema(capsys: pytest.CaptureFixture[str], *kind: str) -> dict[str, Any]:
    result = run(capsys, "schema", *kind)
    assert (result.code, result.err) == (0, "")
    found: dict[str, Any] = json.loads(result.out)
    jsonschema.Draft202012Validator.check_schema(found)
    return found


def fits(schema: dict[str, Any], document: object) -> bool:
    return jsonschema.Draft202012Validator(schema).is_valid(document)


@pytest.mark.parametrize("kind", KINDS)
def test_each_has_a_title(kind, capsys):
    assert schema(capsys, kind)["title"].startswith("framearray ")


def test_that_of_jobs_comes_without_a_word(capsys):
    assert schema(capsys) == schema(capsys, "job")


def test_paths(capsys):
    found = schema(capsys, "path")
    right = {"fps": 24.0, "segments": [{"frames": 2, "camera": [0, 1], "light": 0}]}
    assert fits(found, right)
    assert not fits(found, right | {"segments": 3})
    assert not fits(found, right | {"fp": 24.0})
    assert not fits(found, {"fps": 24.0})


@pytest.mark.parametrize("kind", ["manifest", "results"])
def test_keys_are_described(kind, capsys):
    found = schema(capsys, kind)
    place = found if kind == "manifest" else found["$defs"]["RenderResult"]
    key = "fps" if kind == "manifest" else "finished"
    assert place["properties"][key]["description"]
    assert "Attributes" not in json.dumps(found)


@pytest.mark.parametrize("make", ["plain", "grouped"])
def test_manifests(make, tmp_path, capsys):
    getattr(handmade, make)(tmp_path)
    table = tomllib.loads((tmp_path / "manifest.toml").read_text())
    found = schema(capsys, "manifest")
    jsonschema.Draft202012Validator(found).validate(table)
    assert fits(found, table | {"later": 1}), "readers ignore unknown keys"
    assert not fits(found, table | {"format": 3})
    assert not fits(found, table | {"resolution": [3]})
    for key in ("fps", "cameras", "groups" if make == "grouped" else "lights"):
        assert not fits(found, {name: value for name, value in table.items() if name != key})


def test_another_word_is_refused(capsys):
    result = run(capsys, "schema", "scene")
    assert result.code == 2 and 'expected job, path, manifest or results, got "scene"' in result.err
