"""JSON Schema of a file format, and the same schema in words for messages and the reference page."""

import inspect
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias

from pydantic import BaseModel

from ..units import FARTHEST
from .table import Place
from .words import bound_text, range_text, shown

Schema: TypeAlias = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"
LONGEST_KEY = 100  # characters of a key in a message


@cache  # a file of eyes may have a problem in every row
def file_schema(model: type[BaseModel]) -> Schema:
    """Make the schema of a file. TOML has no null, so no key may be null.

    The keyword `x-default` describes a default that depends on other keys. Callers share the result: do not change it.
    """
    schema: Schema = _rebuilt(model.model_json_schema(schema_generator=with_docstrings()), _without_null)
    return schema


def published_schema(model: type[BaseModel], title: str) -> Schema:
    """Make the JSON Schema (2020-12) of a file as editors read it."""
    return {"$schema": DIALECT, **_rebuilt(file_schema(model), _published), "title": title}


def _rebuilt(node: Any, change: Callable[[Schema], Schema]) -> Any:
    """Copy a schema, and change each table of the copy after those that it holds."""
    if isinstance(node, list):
        return [_rebuilt(item, change) for item in node]
    return change({key: _rebuilt(value, change) for key, value in node.items()}) if isinstance(node, dict) else node


def _published(node: Schema) -> Schema:
    """Turn keywords of our own into descriptions, which every editor shows."""
    node.pop("x-words", None)
    if (text := node.pop("x-default", None)) is not None:
        node["description"] = f"{node['description']} Default: {text}."
    return node


@cache
def with_docstrings() -> Any:
    """Make a generator of schemas that describes classes and their attributes by docstrings, also of base classes."""
    from pydantic.json_schema import GenerateJsonSchema  # takes long to import

    class Described(GenerateJsonSchema):
        def model_schema(self, schema: Any) -> Schema:
            return _described(schema["cls"], super().model_schema(schema))

        def dataclass_schema(self, schema: Any) -> Schema:
            found = _described(schema["cls"], super().dataclass_schema(schema))
            for value in found["properties"].values():
                value.pop("title", None)
            return found

    return Described


def _described(cls: type, schema: Schema) -> Schema:
    """Describe a class, and each attribute whose declaration has no description."""
    words: dict[str, str] = {}
    for kind in reversed(cls.__mro__):
        text, _, attributes = inspect.cleandoc(kind.__doc__ or "").partition("\n\nAttributes:\n")
        found = re.findall(r"^    ([\w, ]+): (.*(?:\n {8}.*)*)", attributes, re.MULTILINE)
        words |= {name: " ".join(lines.split()) for names, lines in found for name in names.split(", ")}
    for name in schema["properties"].keys() & words.keys():
        schema["properties"][name].setdefault("description", words[name])
    return schema | {"description": text}


def _without_null(node: Schema) -> Schema:
    """Remove null options, and defaults that are null or described in words."""
    options = [option for option in node.get("anyOf", ()) if option != {"type": "null"}]
    if len(options) == 1:
        node = {**options[0], **{key: value for key, value in node.items() if key != "anyOf"}}
    elif options:
        node["anyOf"] = options
    if "x-default" in node or ("default" in node and node["default"] is None):
        node.pop("default", None)
    return node


def follow_reference(root: Schema, node: Schema) -> Schema:
    """Follow a reference; keywords next to it win."""
    while "$ref" in node:
        target = root["$defs"][node["$ref"].rsplit("/", 1)[1]]
        node = {**target, **{key: value for key, value in node.items() if key != "$ref"}}
    return node


def variants(root: Schema, node: Schema) -> dict[str, Schema]:
    """List the kinds of a table that has a `type` key; empty for every other table."""
    kinds = {ref: kind for kind, ref in node.get("discriminator", {}).get("mapping", {}).items()}
    return {kinds[option["$ref"]]: follow_reference(root, option) for option in node.get("oneOf", ()) if kinds}


def find(root: Schema, place: Place) -> tuple[str, Schema]:
    """Find the schema of one place in a file, and write the place as a dotted key: `camera.keys[3].eye`.

    The schema is empty for a place that no file has.
    """
    path, node = "", root
    for step in place:
        node = follow_reference(root, node)
        if step in (kinds := variants(root, node)):  # the kind of a table, not a key of the file
            node = kinds[str(step)]
        elif isinstance(step, int):
            path += f"[{step}]"
            node = next((option["items"] for option in (node, *node.get("anyOf", ())) if "items" in option), {})
        else:
            path += ("." if path else "") + toml_key(step)
            extra = node.get("additionalProperties") or {}
            node = node.get("properties", {}).get(step, extra)
    return path, follow_reference(root, node)


def toml_key(key: str) -> str:
    """Write a key as TOML does, bare if possible, else quoted; shorten a long one."""
    if len(key) > LONGEST_KEY:
        key = f"{key[:LONGEST_KEY]}..."
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key, ensure_ascii=False)


def allowed_values(root: Schema, node: Schema) -> str:
    """Describe the values that a schema allows: "a whole number from 1 to 65535", "3 numbers", "a table"."""
    node = follow_reference(root, node)
    if "x-words" in node:
        return str(node["x-words"])
    if choices := node.get("enum", [node["const"]] if "const" in node else list(variants(root, node))):
        return "a table" if "oneOf" in node else join_options([shown(choice) for choice in choices])
    if "anyOf" in node:
        first, *others = node["anyOf"]
        if others and others[0].get("items") == first:  # grey or RGB: give the bounds once
            return f"a number or {others[0]['minItems']} numbers {_range(first)}".rstrip()
        return join_options([allowed_values(root, option) for option in node["anyOf"]])
    match node.get("type"):
        case "integer":
            return f"a whole number {_range(node)}".rstrip()
        case "number":
            return f"a number {_range(node)}".rstrip()
        case "boolean":
            return "true or false"
        case "string":
            return "a text"
        case "object":
            return "a table"
        case "array" if "maxItems" in node:
            kinds = {"integer": "whole numbers", "number": "numbers"}
            kind = kinds.get(node["items"].get("type"), "values")
            return f"{node['maxItems']} {kind} {_range(node['items'])}".rstrip()
        case "array":
            return "a list of tables"
    return "another value"


def _range(node: Schema) -> str:
    """Write the bounds of a number."""
    low = node.get("minimum", float("-inf"))
    high = node.get("maximum", node["exclusiveMaximum"] - 1 if "exclusiveMaximum" in node else float("inf"))
    if "exclusiveMinimum" in node:
        above = f"above {bound_text(node['exclusiveMinimum'])}"
        return above if high >= FARTHEST else f"{above} and at most {bound_text(high)}"
    return range_text(low, high)


def join_options(options: list[str]) -> str:
    """Join options: "a, b or c"."""
    return options[0] if len(options) == 1 else f"{', '.join(options[:-1])} or {options[-1]}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """One table of a file: its place, such as `light.sources[].keys[]`, its kind (the value of `type`), its schema."""

    place: str
    kind: str | None
    schema: Schema

    @property
    def keys(self) -> dict[str, Schema]:
        """Schema of each key."""
        return dict(self.schema.get("properties", {}))


def sections(root: Schema, node: Schema | None = None, place: str = "", kind: str | None = None) -> Iterator[Section]:
    """List all tables of a file, each before the tables it holds."""
    node = follow_reference(root, node if node is not None else root)
    for name, variant in variants(root, node).items():
        yield from sections(root, variant, place, name)
    if "properties" in node:
        yield Section(place=place, kind=kind, schema=node)
        for key, value in node["properties"].items():
            yield from sections(root, value, f"{place}.{key}".lstrip("."), kind)
    elif node.get("type") == "array":
        yield from sections(root, node["items"], f"{place}[]", kind)
    elif isinstance(node.get("additionalProperties"), dict):
        yield from sections(root, node["additionalProperties"], f'{place}."NAME"', kind)
