"""Values that a file should not hold, and values that it may hold and hardly ever does."""

import datetime
from random import Random
from typing import Any

from framearray_cli.base.forms.schema import Schema, follow_reference, variants

NUMBERS: tuple[Any, ...] = (
    0, 1, -1, 2, 7, 255, 65535, 65536, 2**31 - 1, 2**31, -(2**31), 2**32, 2**53 + 1, 2**63 - 1, 2**63, -(2**63), 2**64,
    10**30, -(10**400), 10**4000, 0.0, -0.0, 0.5, 1.5, -1.5, 5e-324, 1e-300, 1e-12, 1e-7, 1.0000000000000002, 1e6, 1e12,
    1.0000001e12, 1e20, 1e30, 3.4028234e38, 1e39, 1.7976931348623157e308, -1e308,
    float("nan"), float("-nan"), float("inf"), float("-inf"),
)  # fmt: skip
TEXTS = (
    "", " ", "0", "1", "nan", "inf", "true", "auto", "AUTO", "none", "null", "a\0b", "\0", "\x1b[31mred",
    "line\nline", "\t", "\r\n", "\u202etxt", "e\u0301", "\ufeff", "\U0001f4a5", "漢字", "Ω" * 300, "x" * 300,
    "x" * 100_000, "{camera}", "{}", "%s%n", "$HOME", "~", "~root", ".", "..", "/", "//", "../../../../../../../..",
    "/etc/passwd", "/dev/zero", "/dev/full", "/proc/self/mem", "a/b", "a\\b", "C:\\a", "CON", "nul.exr", "-",
    "--help", "*", "a" * 255, "a/" * 2000, "file://x", "data:,", "data:;base64,!",
    "http://localhost:1/x.glb", "tiny.glb", "./tiny.glb",
    "job.toml", "2026-02-30", "2026-06-21", "0000-00-00", "24:00", "9:5", "09:30", "23:59:60", "Europe/Berlin",
    "europe", "../Europe/Berlin", "UTC", "8 GiB", "0 B", "-1 GB", "1e3 MB", "9" * 20 + "TiB", "1.2.3 GB", "point",
    "directional", "sun",
)  # fmt: skip
TIMES = (
    datetime.date(2026, 6, 21), datetime.date(1, 1, 1), datetime.date(9999, 12, 31), datetime.time(9, 30),
    datetime.time(23, 59, 59, 999999), datetime.datetime(2026, 6, 21, 9, 30),
    datetime.datetime(2026, 6, 21, 9, 30, tzinfo=datetime.UTC),
    datetime.datetime(9999, 12, 31, 23, 59, tzinfo=datetime.timezone(datetime.timedelta(hours=-23))),
)  # fmt: skip


def wrong(rng: Random) -> tuple[str, Any]:
    """Any value that TOML has: what it is called, and the value."""
    kind = rng.choice(("number", "text", "time", "true or false", "list", "table", "list of tables"))
    match kind:
        case "number":
            return kind, rng.choice(NUMBERS)
        case "text":
            return kind, rng.choice(TEXTS)
        case "time":
            return kind, rng.choice(TIMES)
        case "true or false":
            return kind, rng.random() < 0.5
        case "list":
            return kind, rng.choice(([], [[]], nested_list(rng.choice((3, 50))), [wrong(rng)[1] for _ in range(3)]))
        case "table":
            return kind, rng.choice(({}, {"": 1}, {"x": {}}, nested_table(rng.choice((3, 50))), {"frame": 0}))
    return kind, [{}] * rng.choice((1, 2, 1000))


def nested_list(depth: int) -> list[Any]:
    value: list[Any] = []
    for _ in range(depth):
        value = [value]
    return value


def nested_table(depth: int) -> dict[str, Any]:
    value: dict[str, Any] = {}
    for _ in range(depth):
        value = {"a": value}
    return value


def number(rng: Random, node: Schema) -> Any:
    """A number at, beside or far from the bounds of a schema; most are allowed."""
    whole = node.get("type") == "integer"
    ends = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
    bounds = [node[key] for key in ends if key in node]
    near = [bound + step for bound in bounds for step in ((-1, 0, 1) if whole else (-1e-9, 0.0, 1e-9, 1.0))]
    far = [value for value in NUMBERS if isinstance(value, int) == whole]
    value = rng.choice(near) if near and rng.random() < 0.6 else rng.choice(far)
    return value if whole or isinstance(value, float) else float(value)


def allowed(rng: Random, root: Schema, node: Schema) -> Any:
    """A value of the kind that a schema wants, often at the end of what it allows."""
    node = follow_reference(root, node)
    if kinds := variants(root, node):
        name, chosen = rng.choice(list(kinds.items()))
        return {**allowed(rng, root, chosen), "type": name}
    if "anyOf" in node:
        return allowed(rng, root, rng.choice(node["anyOf"]))
    if "const" in node:
        return node["const"]
    if "enum" in node:
        return rng.choice(node["enum"])
    match node.get("type"):
        case "integer" | "number":
            return number(rng, node)
        case "boolean":
            return rng.random() < 0.5
        case "string":
            return rng.choice(TEXTS)
        case "array":
            least = node.get("minItems", 0)
            n = least if node.get("maxItems") == least else rng.choice((least, least + 1, least + 3))
            return [allowed(rng, root, node["items"]) for _ in range(n)]
        case "object":
            return _table(rng, root, node)
    return wrong(rng)[1]


def _table(rng: Random, root: Schema, node: Schema) -> dict[str, Any]:
    """All keys that a table must have, and some that it may have."""
    properties, must = node.get("properties", {}), node.get("required", ())
    if not properties and isinstance(node.get("additionalProperties"), dict):
        return {rng.choice(TEXTS): allowed(rng, root, node["additionalProperties"])}
    chosen = [key for key in properties if key in must or rng.random() < 0.3]
    return {key: allowed(rng, root, properties[key]) for key in chosen}
