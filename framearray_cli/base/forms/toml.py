"""TOML file -> plain tables, or one JobError; the kind of a file; values -> TOML text.

A command that gets a file of another kind says so: "expected a job, got a scene".
"""

import json
import os
import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias

from ..errors import JobError, SceneError
from ..files import read_at_most, reason

LARGEST_FILE = 4 * 1024 * 1024  # bytes; a job is a thousand times smaller; anything larger is the wrong file

LONGEST_PATH = 300  # characters of a text in a message

# Python's TOML reader takes time and memory in proportion to the square of this number.
MOST_PARTS = 6  # keys with dots between them; no file of ours has more than 4

_KEY = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""

_LONG_KEY = re.compile(rf"(?:^|[\[{{,])[ \t]*+{_KEY}(?:[ \t]*+\.[ \t]*+{_KEY}){{{MOST_PARTS}}}", re.MULTILINE)

Kind: TypeAlias = Literal["job", "movie path", "manifest", "array", "image", "movie", "scene"]

_BY_SUFFIX: dict[Kind, str] = {
    "image": ".exr .png .jpg .jpeg .tif .tiff .hdr .webp .bmp",
    "movie": ".mp4 .mkv .webm .mov .gif .avi",
    "scene": ".glb .gltf .ifc .obj .ply .stl .off .3mf .dae .fbx .blend .usd .usda .usdc .usdz",
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


def long_key_problem(text: str) -> str | None:
    """Describe the first key of a TOML text that has too many parts, if there is one."""
    found = _LONG_KEY.search(text)
    if not found:
        return None
    line = text.count("\n", 0, found.start()) + 1
    return f"line {line}: expected at most {MOST_PARTS} keys with dots between them, got more"


# Suffixes of scenes that a reader knows, of this package or of trimesh.
SCENE_FORMATS = (
    "3dxml", "3mf", "ctm", "dae", "glb", "gltf", "ifc", "ifczip", "obj", "off", "ply", "step", "stl", "stp",
    "usd", "usda", "usdc", "usdz", "xaml", "xyz", "zae",
)  # fmt: skip

STDIN = Path("-")  # instead of a file name: standard input


def shown_file(path: Path) -> Path:
    """Return the name of a file for messages."""
    return Path("standard input") if path == STDIN else path


def load_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file, or standard input for "-", into plain tables.

    Raises:
        JobError: the file is missing, not a file, too big, not UTF-8, not TOML or nested too deeply.
    """
    import tomllib  # of no use to most commands

    data, path = _read_bytes(path), shown_file(path)
    text = _decode(path, data)
    if problem := long_key_problem(text):
        raise JobError(path, [problem])
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        words = str(error).replace("Cannot overwrite a value", "a key is given a second time")
        raise JobError(path, [_backslash_problem(text, str(error)) or f"not valid TOML: {words}"]) from error
    except RecursionError as error:
        raise JobError(path, ["tables or lists are nested too deeply"]) from error
    except ValueError as error:  # a number with more digits than Python reads
        raise JobError(path, ["a number has too many digits"]) from error


def _backslash_problem(text: str, message: str) -> str | None:
    """Describe a backslash in double quotes that begins no escape: most often it is one of a Windows path.

    Args:
        message: of Python's reader.
    """
    if not any(word in message for word in ("hex", "Unescaped", "Escaped", "Illegal character", "Unterminated")):
        return None
    lines = text.splitlines()
    place = re.search(r"\(at line (\d+),", message)
    number = int(place[1]) if place else len(lines)
    some = r"[^\"\n]*" if "scape" in message or "hex" in message else "[A-Za-z]:"  # the others have many causes
    found = re.search(rf'"({some}\\[^"\n]*)"', lines[number - 1])
    if not found:
        return None
    name = re.sub(r"(?<!^)/+", "/", found[1][:LONGEST_PATH].replace("\\", "/"))  # a share keeps its two
    return f'line {number}: TOML reads a backslash in double quotes as an escape; write "{name}", or use single quotes'


def parse_value(text: str) -> Any:
    """Read one value in TOML's notation: "3", "[1, 2]", '"text"'.

    Raises:
        ValueError: the text is no such value.
    """
    import tomllib  # as above

    if long_key_problem(text):
        raise ValueError("too many keys with dots between them")
    try:
        table = tomllib.loads(f"value = {text}")
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    if table.keys() != {"value"}:
        raise ValueError("several lines")
    return table["value"]


def _read_bytes(path: Path) -> bytes:
    """Read a whole file, or all of standard input, up to the largest that is accepted."""
    name = shown_file(path)
    try:
        if path != STDIN and path.is_dir():
            raise JobError(name, ["expected a TOML file, got a folder"])
        if path == STDIN and (sys.stdin is None or sys.stdin.isatty()):  # typing a file would end in silence
            raise JobError(name, ["expected a TOML file from a pipe, got a terminal; name a file, or pipe one in"])
        data = read_at_most(path if path != STDIN else sys.stdin.buffer, LARGEST_FILE)
    except FileNotFoundError as error:
        raise JobError(name, ["no such file"]) from error
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise JobError(name, [f"cannot be read: {reason(error)}"]) from error
    if data is None:
        raise JobError(name, [f"expected a TOML file of at most {LARGEST_FILE >> 20} MB, got a bigger one"])
    return data


def _decode(path: Path, data: bytes) -> str:
    """Decode UTF-8, with or without the byte order mark of Windows editors."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise JobError(path, ["expected UTF-8 text, got UTF-16; save the file as UTF-8"])
    if b"\0" in data:
        raise JobError(path, ["expected UTF-8 text, got a binary file"])
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        found = f"byte 0x{data[error.start]:02x} in line {line}"
        raise JobError(path, [f"expected UTF-8 text, got {found}; save the file as UTF-8"]) from error


def kind_of(path: Path) -> Kind | None:
    """Return the kind of a file or folder, by its name, or by the keys of a TOML file."""
    suffix = path.suffix.lower()
    if os.path.isdir(path):
        return "array" if os.path.exists(path / "manifest.toml") else None
    for kind, suffixes in _BY_SUFFIX.items():
        if suffix in suffixes.split():
            return kind
    if suffix != ".toml" or not os.path.isfile(path):  # a pipe may wait forever
        return None
    try:
        return kind_of_table(load_toml(path))
    except JobError:
        return None


def kind_of_table(table: Mapping[str, Any]) -> Kind | None:
    """Return the kind of a TOML file, by its keys."""
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


def unknown_format(file: Path) -> str:
    """Describe a format of scenes that cannot be read, and what to do."""
    extension = file.suffix[1:].lower()
    if extension == "blend":
        scene, job = (shlex.quote(str(path)) for path in (file, file.with_suffix(".toml")))
        command = f"blender --background {scene} --python framearray_export.py -- {job}"
        return (
            f".blend files cannot be read; Blender writes a GLB and a job of it: {command} (the script is in "
            "contrib/blender of the sources)"
        )
    got = f"'.{extension}'" if extension else "a name without a suffix"
    return (
        f"expected a scene of a known format, got {got}; known are {', '.join(SCENE_FORMATS)}; GLB is best: most "
        "programs export it, and Blender turns FBX and others into it"
    )


def require_scene(path: Path, hint: str = "") -> None:
    """Check that a scene of a known format is there, and no file of another kind; the hint follows on a missing one.

    Raises:
        SceneError: it is not.
    """
    if problem := mistaken(path, "scene"):
        raise SceneError(f"{path}: {problem}")
    if not os.path.exists(path):
        raise SceneError(f"{path}: no such scene file{hint}")
    if os.path.isfile(path) and path.suffix[1:].lower() not in SCENE_FORMATS:
        raise SceneError(f"{path}: {unknown_format(path)}")


def describe_mistake(path: Path, wanted: Kind, found: Kind) -> str:
    """Describe the expected and the found kind of file, and the remedy."""
    remedy = _REMEDIES.get((wanted, found), "")
    shown = remedy.format(file=shlex.quote(str(path)), folder=shlex.quote(str(path.parent)))
    return f"expected {_NOUNS[wanted]}, got {_NOUNS[found]}" + (f"; {shown}" if shown else "")


def load_kind(path: Path, wanted: Literal["job", "movie path"]) -> dict[str, Any]:
    """Read a TOML file into plain tables; refuse one of another kind.

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


def inline(value: Any) -> str:
    """Write a plain value; tables and lists on one line as well."""
    import tomli_w

    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {inline(item)}' for key, item in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(inline(item) for item in value)}]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")


def inline_floats(values: Sequence[float]) -> str:
    """Write a list of floats; `repr` gives the shortest text that reads back as the same float."""
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def quoted(text: str) -> str:
    """Write any text: escape control characters, and replace lone surrogates, which TOML cannot hold."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(whole, ensure_ascii=False).replace("\x7f", "\\u007f")


def brief(value: bool | str | float) -> str:
    """Write a setting; a number with at most six digits."""
    return json.dumps(value) if isinstance(value, bool | str) else f"{value:g}"
