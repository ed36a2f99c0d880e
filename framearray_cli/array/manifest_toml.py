"""`manifest.toml` and its JSON Schema: short keys first, then the job, then one block per camera and per light."""

import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, cast

import numpy as np

from framearray_cli.base.arrays import is_number
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason, require_file, write_bytes
from framearray_cli.base.forms.toml import inline, inline_floats, long_key_problem, mistaken
from framearray_cli.base.forms.words import shown
from framearray_cli.base.lens import PERSPECTIVE

from .manifest import FILE_NAME, Manifest, ManifestCamera, ManifestGroup, ManifestLight, expect

FORMAT = 1

# Keys of every manifest, and of manifests with groups, in the order of the file.
HEAD, TABLES = ("version", "name", "fingerprint", "layers", "resolution", "fps"), ("summary", "scene", "job")
GROUPED = ("ambient_images", "background_images", "background_ambient")
COUNT = {"type": "integer", "minimum": 1}
MOST_NAMES = 5  # of arrays in a message

_VECTORS = ("position", "direction", "across", "up", "intensity", "irradiance", "radiance")  # of a source


def write_manifest(directory: Path, manifest: Manifest) -> Path:
    """Write `manifest.toml` into a folder, whole or not at all.

    Returns:
        The file.

    Raises:
        OutputError: the file cannot be written.
    """
    target = directory / FILE_NAME
    write_bytes(target, to_toml(manifest).encode())
    return target


def read_manifest(place: Path) -> Manifest:
    """Read the manifest of an output folder, given the folder or the file.

    Raises:
        OutputError: it is missing, broken, made by a newer program, or names files outside its folder.
    """
    path = place / FILE_NAME if os.path.isdir(place) else place
    if place.name != FILE_NAME and (problem := mistaken(place, "array")):
        raise OutputError(f"{place}: {problem}")
    require_file(path)
    try:
        text = path.read_bytes().decode()
        if problem := long_key_problem(text):
            raise OutputError(f"{path}: {problem}")
        table = tomllib.loads(text)
    except FileNotFoundError as error:
        raise OutputError(
            f"{path}: no such file; expected the output folder of `framearray render`{_below(place)}"
        ) from error
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {reason(error)}") from error
    except UnicodeDecodeError as error:
        raise OutputError(
            f"{path}: expected UTF-8 text, got a binary file; render again, or restore the file"
        ) from error
    except (ValueError, RecursionError) as error:  # ValueError: not UTF-8, not TOML, or a number with too many digits
        raise OutputError(f"{path}: not valid TOML: {error}; render again, or restore the file") from error
    found = table.get("format")
    if found != FORMAT:
        advice = "; use a newer framearray" if isinstance(found, int) and found > FORMAT else ""
        got = "none" if found is None else shown(found)
        raise OutputError(f"{path}: format: expected {FORMAT}, got {got}{advice}")
    try:
        return _from_table(table, path.parent)
    except (ValueError, TypeError) as error:
        raise OutputError(f"{path}: {error}") from error


def _below(folder: Path) -> str:
    """Name the arrays one or two levels below a folder that is none itself, or next to a missing folder."""
    folder = folder if os.path.exists(folder) else folder.parent
    try:
        near = sorted(path.parent for path in folder.glob(f"[!.]*/{FILE_NAME}"))
        found = near or sorted(path.parent for path in folder.glob(f"[!.]*/[!.]*/{FILE_NAME}"))
    except OSError:
        return ""
    names = ", ".join(str(path) for path in found[:MOST_NAMES])
    more = f" and {len(found) - MOST_NAMES} more" if len(found) > MOST_NAMES else ""
    return f", such as {names}{more}" if found else ""


def to_toml(manifest: Manifest) -> str:
    """Return a manifest as TOML text."""
    import tomli_w

    own = (*GROUPED, "axes") if manifest.groups else ("images",)
    head = {"format": FORMAT}
    head |= {key: getattr(manifest, key) for key in (*HEAD, "n_cameras", "n_lights", *own, *TABLES)}
    text = ["# A frame array; docs/reference/manifest.md explains the keys.\n", tomli_w.dumps(plain(head))]
    # Formatted here, because a matrix on one line is easier to read than on the 22 lines of tomli_w.
    for c, camera in enumerate(manifest.cameras):
        rows = ", ".join(inline_floats(row) for row in camera.world_from_camera)
        text.append(f"\n[[cameras]]  # {c}\nworld_from_camera = [{rows}]\n{_lens_lines(camera)}")
    text.extend(_light_lines("lights", manifest.lights))
    for group in manifest.groups:
        names = {"name": group.name, "axis": group.axis, "images": group.images}
        text.append(f"\n[[groups]]\n{tomli_w.dumps(names)}")
        text.extend(_light_lines("groups.lights", group.lights))
    return "".join(text)


def _lens_lines(camera: ManifestCamera) -> str:
    """Return the keys of a camera's lens that differ from a perspective's."""
    text = f'type = "{camera.type}"\n' if camera.type != PERSPECTIVE else ""
    for key, value in (("fov", camera.fov), ("height", camera.height)):
        text += f"{key} = {float(value)!r}\n" if value is not None else ""
    text += f"shift = {inline_floats(camera.shift)}\n" if camera.shift != (0.0, 0.0) else ""
    return text + (f"pixel_aspect = {float(camera.pixel_aspect)!r}\n" if camera.pixel_aspect != 1.0 else "")


def _light_lines(key: str, lights: Sequence[ManifestLight]) -> list[str]:
    """Return one block per light position."""
    text = []
    for l, light in enumerate(lights):
        text.append(f"\n[[{key}]]  # {l}\nambient = {inline_floats(light.ambient)}\n")
        text.append(f"ambient_error = {inline_floats(light.ambient_error)}\nsources = [\n")
        text.extend(f"    {inline(plain(source))},\n" for source in light.sources)
        text.append("]\n")
    return text


def _from_table(table: Mapping[str, Any], directory: Path) -> Manifest:
    """Build a manifest from the table of its file; ignore unknown keys."""
    tables = enumerate(_tables(table, "cameras"))
    cameras = tuple(_build(f"cameras[{c}]", ManifestCamera, camera) for c, camera in tables)
    groups = tuple(_group(k, group) for k, group in enumerate(_tables(table, "groups")))
    keys = (*HEAD, *TABLES, *(GROUPED if groups else ("images",)))
    missing = [key for key in keys if key not in table]
    expect(not missing, f"expected the keys {', '.join(missing)}, found none")
    rest = {key: _freeze(table[key]) for key in keys}
    manifest = Manifest(cameras=cameras, lights=_lights("lights", table), groups=groups, directory=directory, **rest)
    for key, count in (("n_cameras", manifest.n_cameras), ("n_lights", manifest.n_lights)):
        expect(table.get(key) == count, f"{key}: says {table.get(key)!r}, but {count} are listed")
    return manifest


def _lights(place: str, table: Mapping[str, Any]) -> tuple[ManifestLight, ...]:
    tables = _tables(table, "lights")
    lights = tuple(_build(f"{place}[{l}]", ManifestLight, light) for l, light in enumerate(tables))
    for l, light in enumerate(lights):
        for k, key, value in ((k, key, s[key]) for k, s in enumerate(light.sources) for key in _VECTORS if key in s):
            good = isinstance(value, list) and len(value) == 3 and all(map(is_number, value))
            expect(good, f"{place}[{l}]: sources[{k}].{key}: expected 3 finite numbers, got {shown(value)}")
    return lights


def _group(k: int, table: Mapping[str, Any]) -> ManifestGroup:
    lights = list(_lights(f"groups[{k}].lights", table))
    return cast(ManifestGroup, _build(f"groups[{k}]", ManifestGroup, {**table, "lights": lights}))


def _build(place: str, kind: type[Any], table: Mapping[str, Any]) -> Any:
    """Build one camera, light or group from the keys that are its fields; a ValueError starts with its place."""
    known = fields(kind)
    try:
        missing = [key.name for key in known if key.name not in table and key.default is MISSING]
        expect(not missing, f"expected the keys {', '.join(missing)}, found none")
        return kind(**{key.name: _freeze(table[key.name]) for key in known if key.name in table})
    except (ValueError, TypeError) as error:
        raise ValueError(f"{place}: {error}") from error


def _tables(table: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    found = table.get(key, [])
    expect(isinstance(found, list) and all(isinstance(item, dict) for item in found), f"{key}: expected tables")
    return list(found)


def _freeze(value: Any) -> Any:
    """Convert lists to tuples, recursively; leave tables as they are."""
    return tuple(_freeze(item) for item in value) if isinstance(value, list) else value


def plain(value: Any) -> Any:
    """Convert a value to what TOML can hold: numpy values, tuples and paths become plain, None is left out."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value if item is not None]
    return str(value) if isinstance(value, Path) else value


def manifest_schema() -> dict[str, Any]:
    """Make the JSON Schema (2020-12) of manifests; readers ignore keys that it does not list."""
    from pydantic import TypeAdapter  # slow to import

    from framearray_cli.base.forms.schema import DIALECT, with_docstrings

    schema = TypeAdapter(Manifest).json_schema(ref_template="#/$defs/{model}", schema_generator=with_docstrings())
    keys = {key: value for key, value in schema["properties"].items() if key != "directory"}
    keys |= {
        "format": {"const": FORMAT, "description": "Version of the format."},
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
        "required": [key for key in keys if key not in ("images", "lights", "groups", "axes", *GROUPED)],
        "if": {"required": ["groups"]},
        "then": {"required": ["axes", *GROUPED]},
        "else": {"required": ["images", "lights"]},
        "$defs": schema["$defs"],
    }
