"""JSON Schema of the job file, for editors."""

from typing import Any

from framearray_cli.base.forms.schema import Schema, file_schema

from .job import Job

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def job_schema() -> Schema:
    """Make the JSON Schema (2020-12) of the job file, for editors."""
    schema = _published(file_schema(Job))
    return {"$schema": DIALECT, **schema, "title": "framearray job"}


def _published(node: Any) -> Any:
    """Turn keywords of our own into descriptions, which every editor shows."""
    if isinstance(node, list):
        return [_published(item) for item in node]
    if not isinstance(node, dict):
        return node
    node = {key: _published(value) for key, value in node.items()}
    node.pop("x-words", None)
    if (text := node.pop("x-default", None)) is not None:
        node["description"] = f"{node['description']} Default: {text}."
    return node
