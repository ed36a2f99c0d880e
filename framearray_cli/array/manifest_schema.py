"""JSON Schema of `manifest.toml`, for programs that read it."""

from typing import Any

from framearray_cli.base.forms.schema import DIALECT, with_descriptions, with_docstrings

from .manifest import Manifest
from .manifest_toml import FORMAT, FORMAT_OF_GROUPS

OPTIONAL = ("images", "lights", "groups", "ambient_images", "background_images", "background_ambient")
COUNT = {"type": "integer", "minimum": 1}


def manifest_schema() -> dict[str, Any]:
    """Make the JSON Schema (2020-12) of manifests; readers ignore keys that it does not list."""
    from pydantic import TypeAdapter  # takes long to import

    found = TypeAdapter(Manifest).json_schema(ref_template="#/$defs/{model}", schema_generator=with_docstrings())
    schema = with_descriptions(found)
    keys = {key: value for key, value in schema["properties"].items() if key != "directory"}
    keys |= {
        "format": {"enum": [FORMAT, FORMAT_OF_GROUPS], "description": "2 in an array with groups of sources."},
        "n_cameras": COUNT | {"description": "The number of camera positions."},
        "n_lights": COUNT | {"description": "The number of light positions, along the first axis."},
        "axes": {
            "type": "object",
            "additionalProperties": COUNT,
            "description": "With groups: the number of positions along each light axis.",
        },
    }
    for value in keys.values():
        value.pop("default", None)
    return {
        "$schema": DIALECT,
        "title": "framearray manifest",
        "description": schema["description"],
        "type": "object",
        "properties": keys,
        "required": [key for key in keys if key not in (*OPTIONAL, "axes")],
        "if": {"properties": {"format": {"const": FORMAT}}},
        "then": {"required": ["images", "lights"]},
        "else": {"required": ["groups", "axes", "ambient_images", "background_images"]},
        "$defs": {name: with_descriptions(one) for name, one in schema["$defs"].items()},
    }
