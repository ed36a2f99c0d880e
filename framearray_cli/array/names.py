"""File names of a frame array: patterns for `str.format` with {camera} and {light}."""

import re
import string
from collections.abc import Mapping
from pathlib import PurePosixPath

from framearray_cli.base.forms.words import shown

_FIELD = re.compile(r"\{[^{}]*\}")  # one field with its format, whose colon is not part of a name


def file_patterns(name: str, n_cameras: int, n_lights: int, extension: str) -> tuple[str, str]:
    """Return the patterns of images and of layers, chosen so that names sort; both go into one folder.

    A `glob` of "name.c0007.*" finds only the images of camera 7, "name.layers.*" all layers.
    """
    l_digits = max(3, len(str(n_lights - 1)))
    images = f"{_safe(name)}.{_camera(n_cameras)}.l{{light:0{l_digits}d}}.{extension}"
    return images, camera_pattern(name, "layers", n_cameras, "exr")


def camera_pattern(name: str, what: str, n_cameras: int, extension: str) -> str:
    """Return the pattern of files of which there is one per camera."""
    return f"{_safe(name)}.{what}.{_camera(n_cameras)}.{extension}"


def file_name(pattern: str, c: int, l: int = 0) -> str:
    """Return the file name for camera c and light position l; a pattern without {light} ignores l."""
    return pattern.format(camera=c, light=l)


def _safe(name: str) -> str:
    return name.replace("{", "{{").replace("}", "}}")


def _camera(n_cameras: int) -> str:
    return f"c{{camera:0{max(4, len(str(n_cameras - 1)))}d}}"


def check_pattern(key: str, pattern: str, fields: Mapping[str, bool]) -> None:
    """Refuse a file pattern that leads out of its folder, or does more than number files.

    Args:
        key: name of the pattern in messages.
        pattern: for `str.format`.
        fields: name -> whether the pattern must have it.

    Raises:
        ValueError: the pattern is refused.
    """
    path = PurePosixPath(pattern)
    # Backslash and colon lead out of a folder on Windows; a reader there must not follow them.
    if (
        path.is_absolute()
        or ".." in path.parts
        or not path.name
        or re.search(r"[\\:\x00-\x1f]", _FIELD.sub("", pattern))
    ):
        raise ValueError(f"{key}: expected file names inside the folder, got {shown(pattern)}")
    try:
        parts = [(name, spec, conversion) for _, name, spec, conversion in string.Formatter().parse(pattern)]
    except ValueError as error:
        raise ValueError(f"{key}: broken pattern {shown(pattern)}: {error}") from error
    names = [name for name, _, _ in parts if name is not None]
    for name, spec, conversion in parts:
        # Anything else, such as {camera.__class__}, would let a manifest inspect this program.
        if name is not None and (name not in fields or conversion or not re.fullmatch(r"(0?[1-9]d)?", spec or "")):
            allowed = " and ".join(f"{{{known}:04d}}" for known in fields)
            raise ValueError(f"{key}: expected no other fields than {allowed}, got {shown(pattern)}")
    for name, must in fields.items():
        if must and name not in names:
            raise ValueError(f"{key}: expected {{{name}}} in {shown(pattern)}")
