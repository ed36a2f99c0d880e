"""What a file is, where a command expected another one: "expected a job, got a scene"."""

import os
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeAlias

from ..errors import JobError
from .toml import load_toml

Kind: TypeAlias = Literal["job", "movie path", "manifest", "array", "image", "movie", "scene"]

_BY_SUFFIX: dict[Kind, tuple[str, ...]] = {
    "image": (".exr", ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".hdr", ".webp", ".bmp"),
    "movie": (".mp4", ".mkv", ".webm", ".mov", ".gif", ".avi"),
    "scene": (
        ".glb",
        ".gltf",
        ".obj",
        ".ply",
        ".stl",
        ".off",
        ".3mf",
        ".dae",
        ".fbx",
        ".blend",
        ".usd",
        ".usda",
        ".usdc",
        ".usdz",
    ),
}
_NOUNS: dict[Kind, str] = {
    "job": "a job file",
    "movie path": "a movie path",
    "manifest": "the manifest of a frame array",
    "array": "the folder of a frame array",
    "image": "an image",
    "movie": "a movie",
    "scene": "a scene",
}
# What to do with a file of the second kind where one of the first is wanted.
_REMEDIES: dict[tuple[Kind, Kind], str] = {
    ("job", "scene"): "`framearray init {file}` writes a job for it",
    ("job", "array"): "`framearray verify --repair {file}` renders what it lacks",
    ("job", "manifest"): "`framearray verify --repair {folder}` renders what the array lacks",
    ("job", "movie path"): "`framearray assemble ARRAY {file}` follows it",
    ("array", "job"): "give the folder that it renders into (output.directory)",
    ("array", "scene"): "`framearray init {file}` writes a job for it, which `framearray render` turns into an array",
    ("array", "image"): "give the folder of the array: {folder}",
    ("array", "movie path"): "the array comes first, then the path",
    ("movie path", "job"): "`framearray render {file}` renders it; a movie path has [[segments]]",
    ("scene", "job"): "`framearray render {file}` renders it; `framearray check {file}` prints what that costs",
    ("scene", "array"): "`framearray view {file}` shows it",
    ("scene", "manifest"): "`framearray view {folder}` shows the array",
}


def kind_of(path: Path) -> Kind | None:
    """Say what a file or folder is, by its name, or by the keys of a TOML file."""
    suffix = path.suffix.lower()
    if os.path.isdir(path):
        return "array" if os.path.exists(path / "manifest.toml") else None
    for kind, suffixes in _BY_SUFFIX.items():
        if suffix in suffixes:
            return kind
    if suffix != ".toml" or not os.path.isfile(path):  # a pipe may wait forever
        return None
    try:
        return kind_of_table(load_toml(path))
    except JobError:
        return None


def kind_of_table(table: Mapping[str, Any]) -> Kind | None:
    """Say what a TOML file is, by its keys."""
    if {"scene", "camera"} <= table.keys():
        return "job"
    if {"fingerprint", "cameras"} <= table.keys():
        return "manifest"
    return "movie path" if "segments" in table else None


def mistaken(path: Path, wanted: Kind) -> str | None:
    """Write the problem of a file of another kind than is wanted: "expected a job, got a scene; ...".

    Returns:
        None if the file is missing, of the kind that is wanted, or of none that is known.
    """
    found = kind_of(path) if os.path.exists(path) else None
    return describe_mistake(path, wanted, found) if found and found != wanted else None


def describe_mistake(path: Path, wanted: Kind, found: Kind) -> str:
    """Write what was wanted, what was found, and what to do with it."""
    remedy = _REMEDIES.get((wanted, found), "")
    shown = remedy.format(file=shlex.quote(str(path)), folder=shlex.quote(str(path.parent)))
    return f"expected {_NOUNS[wanted]}, got {_NOUNS[found]}" + (f"; {shown}" if shown else "")


def load_kind(path: Path, wanted: Literal["job", "movie path"]) -> dict[str, Any]:
    """Read a TOML file into plain tables; if it is of another kind, say of which.

    Raises:
        JobError: the file cannot be read, or is of another kind that is known.
    """
    try:
        table = load_toml(path)
    except JobError as error:
        if problem := mistaken(path, wanted):
            raise JobError(path, [problem]) from error
        raise
    found = kind_of_table(table) or kind_of(path)
    if found and found != wanted:
        raise JobError(path, [describe_mistake(path, wanted, found)])
    return table
