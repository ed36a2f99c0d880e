"""Problems of a file in plain words, each with its place: `camera.fov: expected ..., got ...`."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from ..units import FARTHEST, counted
from .schema import Schema, allowed_values, file_schema, find, join_options, sections, toml_key, variants
from .words import shown

MOST_PROBLEMS = 50  # reported per file; more would scroll the first ones away

# Names from other programs that are spelled too differently from ours to count as typing errors.
SYNONYMS = {
    "intensity": ("irradiance",),
    "irradiance": ("intensity",),
    "position": ("direction", "eye"),
    "direction": ("position",),
    "dir": ("direction",),
    "power": ("intensity", "irradiance"),
    "strength": ("intensity", "irradiance", "power"),
    "look_at": ("target",),
    "lookat": ("target",),
    "to": ("target",),
    "origin": ("eye",),
    "from": ("eye",),
    "spp": ("hits",),
    "samples": ("hits",),
    "albedo": ("reflectivity",),
    "base_color": ("reflectivity",),
    "mirror": ("specular",),
    "d_max": ("range",),
    "distance": ("range",),
    "folder": ("directory",),
    "size": ("resolution",),
    "bounces": ("depth",),
}


def problems_of(error: ValidationError, model: type[BaseModel], most: int = MOST_PROBLEMS) -> list[str]:
    """Translate the problems that pydantic found in a table of type `model`, in the order of the file's keys.

    Args:
        most: number of problems to report; the others, of which a wrong file may have 100,000, are only counted.
    """
    root = file_schema(model)
    found = [details for details in error.errors(include_url=False) if not _is_echo(details)]
    return append_count([_problem(root, details) for details in found[:most]], len(found))


def append_count(reported: Sequence[str], n: int) -> list[str]:
    """Append the number of problems, of n, that are not reported."""
    return [*reported, f"and {counted(n - len(reported), 'more problem')}"] if n > len(reported) else list(reported)


def _is_echo(details: ErrorDetails) -> bool:
    """Return True if pydantic calls a list too short because of wrong items in it, which it reports as well."""
    return details["type"] == "too_short" and len(details["input"]) >= details["ctx"]["min_length"]


def _problem(root: Schema, details: ErrorDetails) -> str:
    """Write one problem: its place, the expected and the found value."""
    place, kind, found = details["loc"], details["type"], details["input"]
    context: dict[str, Any] = details.get("ctx", {})
    path, node = find(root, place)
    match kind:
        case "job":  # a rule of our own, with its own text
            text = context["text"]
        case "missing":
            text = f"missing; expected {allowed_values(root, node)}"
        case "extra_forbidden":
            text = _unknown_key(root, place)
        case "union_tag_not_found" if isinstance(found, dict):
            path, text = f"{path}.type", f"missing; expected {_kinds(root, node)}"
        case "union_tag_invalid":
            path, text = f"{path}.type", f"expected {_kinds(root, node)}, got {shown(found.get('type'))}"
        case "too_short":
            least, n = context["min_length"], context["actual_length"]
            text = f"expected {allowed_values(root, node)}, at least {least}, got {n}"
        case "less_than_equal" if context["le"] >= FARTHEST:
            text = f"expected at most {context['le']:g}, got {shown(found)}"
        case "invalid_key":
            text = f"expected a key that is a text, got {shown(found)}"
        case _:
            text = f"expected {allowed_values(root, node)}, got {shown(found)}"
    return f"{path}: {text}" if path else text


def _kinds(root: Schema, node: Schema) -> str:
    """List the values of the `type` key of a table."""
    return join_options([f'"{kind}"' for kind in variants(root, node)])


def _unknown_key(root: Schema, place: tuple[int | str, ...]) -> str:
    """Suggest a key of the same table, or else the table where such a key belongs."""
    key = str(place[-1])
    known = find(root, place[:-1])[1].get("properties", {})
    if meant := _guess_key(key, known):
        return f'unknown key; did you mean "{meant}"?'
    homes: dict[str, dict[str, list[str]]] = {}  # of each key the tables that have it, and the types of these
    for section in sections(root):
        home = f"in [{section.place}]" if section.place else "at the top of the file"
        for name in section.keys:
            homes.setdefault(name, {}).setdefault(home, []).extend([section.kind] if section.kind else [])
    if meant := _guess_key(key, homes):
        places = " or ".join(_of_type(home, kinds) for home, kinds in homes[meant].items()).replace(" or in ", " or ")
        return f'unknown key here; "{meant}" belongs {places}'
    return f"unknown key; known here: {', '.join(toml_key(name) for name in known)}"


def _of_type(home: str, kinds: list[str]) -> str:
    types = [f'"{kind}"' for kind in dict.fromkeys(kinds)]
    return f"{home} of type {join_options(types)}" if types else home


def _guess_key(key: str, known: Iterable[str]) -> str | None:
    """Find the known key that the author probably meant."""
    names = {name.lower(): name for name in known}
    lower = key.lower().replace("-", "_")[:50]
    for other in (lower, *SYNONYMS.get(lower, ())):
        if other in names:
            return names[other]
    close = get_close_matches(lower, names, n=1, cutoff=0.7)
    return names[close[0]] if close else None
