"""Mutations of a file's tables: any place, any value, with the file's schema for what belongs there."""

import copy
import json
from collections.abc import Callable, Iterator
from itertools import islice
from random import Random
from typing import Any, TypeAlias

from framearray_cli.base.forms.schema import Schema, find, follow_reference, variants
from framearray_cli.base.forms.table import Place

from . import values

MOST_PLACES = 20_000  # of a table to break once more: a list that is repeated again and again fills the memory

Table: TypeAlias = dict[str, Any]
# Changes a copy of a file's tables, and returns the name of the change.
Mutation: TypeAlias = Callable[[Random, Table, Schema], str]


def places(node: Any, here: Place = ()) -> Iterator[Place]:
    """All places below a value."""
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for step, value in items:
        yield (*here, step)
        yield from places(value, (*here, step))


def at(table: Table, place: Place) -> Any:
    """The value at a place."""
    value: Any = table
    for step in place:
        value = value[step]
    return value


def schema_at(root: Schema, table: Table, place: Place) -> Schema:
    """Schema of what belongs at a place; empty where nothing does."""
    full: list[int | str] = []
    for k, step in enumerate(place):
        node = find(root, tuple(full))[1]
        if kinds := variants(root, node):  # a table whose `type` says what it may hold
            here = at(table, place[:k])
            kind = here.get("type") if isinstance(here, dict) else None
            full.append(kind if isinstance(kind, str) and kind in kinds else next(iter(kinds)))
        full.append(step)
    try:
        return find(root, tuple(full))[1]
    except (KeyError, AttributeError):
        return {}


def any_place(rng: Random, table: Table) -> Place:
    """A place; those high up come up as often as those in long lists."""
    found = list(places(table))
    if not found:
        return ()
    depth = rng.choice(sorted({len(place) for place in found}))
    return rng.choice([place for place in found if len(place) == depth])


def put(table: Table, place: Place, value: Any) -> None:
    if place:
        at(table, place[:-1])[place[-1]] = value


def another_value(rng: Random, table: Table, root: Schema) -> str:
    """Any value anywhere."""
    kind, value = values.wrong(rng)
    put(table, any_place(rng, table), value)
    return f"another value: {kind}"


def end_of_range(rng: Random, table: Table, root: Schema) -> str:
    """A value of the right kind, often at the end of its range."""
    place = any_place(rng, table)
    put(table, place, values.allowed(rng, root, schema_at(root, table, place)))
    return "value of the right kind"


def other_number(rng: Random, table: Table, root: Schema) -> str:
    """One number, in a list or not, becomes another."""
    numbers = [p for p in places(table) if isinstance(at(table, p), int | float) and not isinstance(at(table, p), bool)]
    if not numbers:
        return another_value(rng, table, root)
    place = rng.choice(numbers)
    old = at(table, place)
    scaled = [old * factor for factor in (-1, 2, 1000, *((1e6, 1e-6, 1e12) if abs(old) < 1e200 else ()))]
    put(table, place, rng.choice(values.NUMBERS) if rng.random() < 0.5 else rng.choice(scaled))
    return "another number"


def without_key(rng: Random, table: Table, root: Schema) -> str:
    """A key or an item is missing."""
    if place := any_place(rng, table):
        del at(table, place[:-1])[place[-1]]
    return "key or item missing"


def renamed(rng: Random, table: Table, root: Schema) -> str:
    """A key is spelled otherwise."""
    keys = [place for place in places(table) if isinstance(place[-1], str)]
    if not keys:
        return another_value(rng, table, root)
    place = rng.choice(keys)
    key, parent = str(place[-1]), at(table, place[:-1])
    spelled = (
        key.upper(),
        key[:-1],
        key + "s",
        key[::-1],
        key + " ",
        "",
        key.replace("_", "-"),
        "ü" + key,
        "\n",
        "x" * 5000,
    )
    parent[rng.choice(spelled)] = parent.pop(key)
    return "key renamed"


def moved(rng: Random, table: Table, root: Schema) -> str:
    """A key stands in another table."""
    place = any_place(rng, table)
    if not place:
        return "key moved"
    parent = at(table, place[:-1])
    value = parent.pop(place[-1])
    homes = [(), *(p for p in places(table) if isinstance(at(table, p), dict))]
    at(table, rng.choice(homes))[str(place[-1])] = value
    return "key moved"


def copied(rng: Random, table: Table, root: Schema) -> str:
    """A value stands where another one was."""
    value = copy.deepcopy(at(table, any_place(rng, table)))
    put(table, any_place(rng, table), value)
    return "value of another key"


def wrapped(rng: Random, table: Table, root: Schema) -> str:
    """A table becomes a list, a list a table, a value either."""
    place = any_place(rng, table)
    value = at(table, place)
    forms: list[Any] = [[value], {"x": value}, str(value)]
    if isinstance(value, list) and value:
        forms += [value[0], {str(k): item for k, item in enumerate(value)}, value * 2, value[::-1], value * 300]
    if isinstance(value, dict):
        forms += [list(value.values()), list(value), [value, value]]
    put(table, place, rng.choice(forms))
    return "table or list of another form"


def more_keys(rng: Random, table: Table, root: Schema) -> str:
    """A table gets a key that it may have and had not."""
    homes = [(), *(p for p in places(table) if isinstance(at(table, p), dict))]
    place = rng.choice(homes)
    node = follow_reference(root, schema_at(root, table, place))
    if kinds := variants(root, node):
        node = kinds.get(str(at(table, place).get("type")), {})
    properties = node.get("properties", {})
    new = [key for key in properties if key not in at(table, place)]
    key = rng.choice(new) if new else "new"
    at(table, place)[key] = values.allowed(rng, root, properties.get(key, {}))
    return "key added"


SINGLE: tuple[Mutation, ...] = (
    another_value, another_value, end_of_range, end_of_range, other_number, other_number, without_key, renamed, moved,
    copied, wrapped, more_keys, more_keys,
)  # fmt: skip


def _unshared(value: Any) -> Any:
    """A copy in which no table or list stands in two places, so that none can be moved into itself."""
    if isinstance(value, dict):
        return {key: _unshared(item) for key, item in value.items()}
    return [_unshared(item) for item in value] if isinstance(value, list) else value


def mutated(rng: Random, table: Table, root: Schema, often: float = 0.25) -> tuple[str, Table]:
    """A copy with one thing changed, or with several."""
    result = copy.deepcopy(table)
    n = rng.randint(2, 6) if rng.random() < often else 1
    for _ in range(n):
        name = rng.choice(SINGLE)(rng, result, root)
        result = _unshared(result)
        if len(list(islice(places(result), MOST_PLACES))) == MOST_PLACES:
            break
    return (name if n == 1 else "several changes"), result


def mutated_json(rng: Random, tree: Any) -> tuple[str, bytes]:
    """A JSON tree with one thing changed, or with several: how, and its text."""
    if isinstance(tree, dict):
        how, changed = mutated(rng, tree, {})
    else:
        how, box = mutated(rng, {"list": tree}, {})
        changed = next(iter(box.values()), None)
    return how, json.dumps(changed, default=str).encode("utf-8", "surrogatepass")
