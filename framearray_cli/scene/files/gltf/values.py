"""Checks of values in a glTF tree: numbers, texts, lists and objects. Each yields problems with their places."""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from framearray_cli.base.forms.words import shown

Tree = dict[str, Any]
Check = Callable[[Any, str, Tree], Iterator[str]]  # value, its place, the whole tree -> problems

LARGEST_FLOAT = 1.7e308
LIGHTS = "lights"  # the list of KHR_lights_punctual, which is not at the top level


def _got(value: Any) -> str:
    return "an object" if isinstance(value, dict) else shown(value)


def number(low: float = -math.inf, high: float = math.inf, *, whole: bool = False) -> Check:
    """A number between two bounds, both included; JSON has neither infinities nor NaN."""
    kind = "a whole number" if whole else "a number"
    bounds = f" from {low:g} to {high:g}" if math.isfinite(low + high) else f" of at least {low:g}"
    expected = kind + bounds if math.isfinite(low) else kind

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        good = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
        good = good and abs(value) <= LARGEST_FLOAT
        if not good or value < low or value > high:
            yield f"{place}: expected {expected}, got {_got(value)}"

    return check


def numbers(count: int) -> Check:
    """A list of `count` numbers; only the first wrong one is reported."""
    one = number()

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, list) or len(value) != count:
            yield f"{place}: expected {count} numbers, got {_got(value)}"
        else:
            wrong = (problem for item in value for problem in one(item, place, tree))
            yield from itertools.islice(wrong, 1)

    return check


def text(value: Any, place: str, tree: Tree) -> Iterator[str]:
    """Text."""
    if not isinstance(value, str):
        yield f"{place}: expected text, got {_got(value)}"


def one_of(*values: Any) -> Check:
    """One of some texts or whole numbers."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, int | str) or isinstance(value, bool) or value not in values:
            yield f"{place}: expected {', '.join(map(str, values[:-1]))} or {values[-1]}, got {_got(value)}"

    return check


def number_of(key: str) -> Check:
    """The index of an entry of a top-level list."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        entries = _lights(tree) if key == LIGHTS else tree.get(key)
        count = len(entries) if isinstance(entries, list) else 0
        if key == "scenes" and not count:
            return  # reported in clearer words later
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < count:
            wanted = f"the number of one of {count} {key}, from 0" if count > 1 else f"0, the only one of {key}"
            yield f"{place}: expected {wanted if count else f'none, as there are no {key}'}, got {_got(value)}"

    return check


def _lights(tree: Tree) -> Any:
    """The list of lights of a tree; an empty object if the tree has none."""
    for key in ("extensions", "KHR_lights_punctual", LIGHTS):
        tree = tree.get(key) or {} if isinstance(tree, dict) else {}
    return tree


def list_of(one: Check) -> Check:
    """A list of such values."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, list):
            yield f"{place}: expected a list, got {_got(value)}"
        else:
            for index, item in enumerate(value):
                yield from one(item, f"{place}[{index}]", tree)

    return check


def table(keys: Mapping[str, Check], needed: tuple[str, ...] = ()) -> Check:
    """An object whose known keys have such values and whose needed keys exist; other keys may hold anything."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, dict):
            yield f"{place or 'the file'}: expected an object, got {_got(value)}"
            return
        before = f"{place}." if place else ""
        for key in needed:
            if value.get(key) is None:
                yield f"{before}{key}: is missing"
        for key, one in keys.items():
            if value.get(key) is not None:
                yield from one(value[key], before + key, tree)

    return check


def map_of(one: Check) -> Check:
    """An object with any keys, and such values."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, dict):
            yield f"{place}: expected an object, got {_got(value)}"
        else:
            for key, item in value.items():
                yield from one(item, f"{place}.{key}", tree)

    return check


def extensions(**keys: Check) -> dict[str, Check]:
    """The key "extensions" of an object, with the extensions that are read."""
    return {"extensions": table(keys)}
