"""Completions when a user presses Tab: files of the right kind, places, axes, cameras, keys.

Shells call the program for each Tab, so nothing heavy is imported, and nothing is reported: what cannot be read offers
nothing.
"""

import json
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import typer

from framearray_cli.base.errors import FrameArrayError

WORDS = "framearray.words"  # where the context of a command keeps its words
SCENES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".off", ".3mf", ".dae")
PLACES = ("all", "first", "last", "50%")
LARGEST_FILE = 64 * 2**20  # bytes of a scene to look for cameras in
MOST_FILES = 1000  # of a folder


def complete_job(incomplete: str) -> list[str]:
    """Offer TOML files, and those right below folders."""
    return _files(incomplete, (".toml",))


def complete_scene(incomplete: str) -> list[str]:
    """Offer scene files."""
    return _files(incomplete, SCENES)


def complete_array(incomplete: str) -> list[str]:
    """Offer folders with a manifest, and those right below other folders."""
    found = []
    for folder in _matches(incomplete):
        if (folder / "manifest.toml").is_file():
            found.append(str(folder))
        elif folder.is_dir():
            found += [str(below.parent) for below in sorted(folder.glob("*/manifest.toml"))[:MOST_FILES]]
    return found


def complete_places(ctx: typer.Context, incomplete: str) -> list[str]:
    """Offer words for camera or light positions, and the range of all if the job or array is known."""
    n = _number_of_cameras(ctx)
    return _starting(incomplete, (*PLACES, *([f"0-{n - 1}"] if n and n > 1 else [])))


def complete_light_places(incomplete: str) -> list[str]:
    """Offer words for light positions."""
    return _starting(incomplete, PLACES)


def complete_axis_places(ctx: typer.Context, incomplete: str) -> list[str]:
    """Offer the light axes of the array or job as "AXIS=", then words for positions."""
    axis, equals, place = incomplete.partition("=")
    if equals:
        return [f"{axis}={word}" for word in _starting(place, PLACES[1:])]
    return _starting(incomplete, (f"{name}=" for name in _axes(ctx)))


def complete_axis(ctx: typer.Context, incomplete: str) -> list[str]:
    """Offer the light axes of the array."""
    return _starting(incomplete, _axes(ctx))


def complete_group(ctx: typer.Context, incomplete: str) -> list[str]:
    """Offer the groups of sources of the array."""
    groups = _table(ctx).get("groups")
    tables = [one for one in groups if isinstance(one, dict)] if isinstance(groups, list) else []
    return _starting(incomplete, [str(one["name"]) for one in tables if "name" in one])


def complete_camera(ctx: typer.Context, incomplete: str) -> list[str]:
    """Offer the cameras of a glTF file."""
    return _starting(incomplete, (name for word in _words(ctx) for name in _cameras_of(Path(word))))


def complete_key(incomplete: str) -> list[str]:
    """Offer the keys of a job as "KEY="."""
    from framearray_cli.base.forms.schema import sections
    from framearray_cli.job.job import job_schema

    tables = ((section.place, section.schema["properties"]) for section in sections(job_schema()))
    keys = (f"{place}.{key}".lstrip(".") for place, table in tables for key in table)
    return _starting(incomplete, dict.fromkeys(f"{key}=" for key in keys if "[" not in key))


def _starting(incomplete: str, words: Iterable[str]) -> list[str]:
    return [word for word in words if word.startswith(incomplete)]


def _matches(incomplete: str) -> list[Path]:
    """List the visible files and folders whose names begin with what was typed."""
    path = Path(incomplete)
    folder, name = (path, "") if incomplete.endswith("/") else (path.parent, path.name)
    with suppress(OSError):
        return sorted(one for one in folder.iterdir() if one.name.startswith(name) and not one.name.startswith("."))
    return []


def _files(incomplete: str, suffixes: tuple[str, ...]) -> list[str]:
    found: list[str] = []
    for path in _matches(incomplete):
        with suppress(OSError):
            below = sorted(path.iterdir())[:MOST_FILES] if path.is_dir() else [path]
            found += [str(one) for one in below if one.suffix.lower() in suffixes and one.is_file()]
    return found


def _table(ctx: typer.Context) -> dict[str, Any]:
    """Read the job or the manifest that the command line names; empty if there is none."""
    from framearray_cli.base.forms.toml import load_toml

    for word in _words(ctx):
        path = Path(word, "manifest.toml") if Path(word).is_dir() else Path(word)
        if path.suffix == ".toml":
            with suppress(FrameArrayError, OSError, ValueError, RecursionError):
                return load_toml(path)
    return {}


def _words(ctx: typer.Context) -> list[str]:
    """Return the words before the one to complete, without options."""
    return [word for word in ctx.meta.get(WORDS, ()) if not word.startswith("-")]


def _number_of_cameras(ctx: typer.Context) -> int:
    table = _table(ctx)
    camera = table.get("camera")
    n = camera.get("frames") if isinstance(camera, dict) else table.get("n_cameras")
    return n if isinstance(n, int) else 0


def _axes(ctx: typer.Context) -> list[str]:
    table = _table(ctx)
    if isinstance(axes := table.get("axes"), dict):
        return list(axes)
    light = table.get("light")
    sources = light.get("sources", []) if isinstance(light, dict) else []
    named = [one.get("axis", "light") for one in sources if isinstance(one, dict)] if isinstance(sources, list) else []
    return list(dict.fromkeys(named)) or (["light"] if table else [])


def _cameras_of(scene: Path) -> list[str]:
    """Name the cameras of a glTF file, without reading its meshes."""
    with suppress(OSError, ValueError, RecursionError, AttributeError, TypeError):
        if scene.suffix.lower() not in (".glb", ".gltf") or scene.stat().st_size > LARGEST_FILE:
            return []
        data = scene.read_bytes()
        text = data[20 : 20 + int.from_bytes(data[12:16], "little")] if data[:4] == b"glTF" else data
        tree = json.loads(text)
        nodes = [node for node in tree.get("nodes", []) if "camera" in node]
        return [str(node.get("name") or tree["cameras"][node["camera"]].get("name") or "") for node in nodes]
    return []
