"""A first job as TOML text with a comment per key, for users who read and edit it before any documentation.

The text is formatted here rather than by a TOML library, since half of it are comments; a test reads it back.
"""

import os
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from framearray_cli.base.forms.text import inline, inline_floats, quoted
from framearray_cli.base.units import counted

from .model import (
    INDIRECT,
    POWERS,
    SUN_ANGLE,
    WEIGHTS,
    Camera,
    EnvironmentLight,
    LightSource,
    MaterialNote,
    MeshLight,
    Start,
    SunDay,
    source_keys,
)

PANELS = '"rect", "disc": flat lamps; "point": a bulb; "directional": the sun'
UNITS = {"irradiance": "W/m2 of a surface that faces the light", "radiance": "W/(m2 sr) of the panel"}
LENS = {
    "type": '"perspective", "orthographic" without perspective, or "panorama"',
    "fov": "how much is seen from bottom to top, degrees",
    "height": "how much is seen from bottom to top, scene units",
    "shift": "lens shift to the right and up, shares of the longer side",
}
MOST_STEPS_UP = 2  # largest number of leading ".." of a relative scene name; beyond, it is absolute
COLUMN = 42  # of comments behind keys
MOST_MATERIALS = 12  # that stand between the scene and the camera; more stand at the end


def to_text(start: Start, job_file: Path) -> str:
    """Write a job.

    Args:
        job_file: its file; the scene is named relative to it.
    """
    n = len(start.materials)
    few = n <= MOST_MATERIALS
    return "\n".join(
        [
            f"# A first job for {_one_line(start.file.name)}, made by `framearray init`. Change it, then:",
            f"#   framearray render {_one_line(shlex.quote(job_file.name))}",
            *_comments(start.about),
            _line("name", quoted(start.name), "starts every file name"),
            _line("seed", "0", "of all random numbers"),
            "",
            "[scene]",
            _line("file", quoted(scene_name(start.file, job_file)), "relative to this file"),
            _line("up", quoted(start.up), "the axis that points up"),
            _line("background", inline_floats(start.background), "radiance of what lies outside: the sky"),
            *_surfaces(start),
            *(
                _materials(start.materials)
                if few
                else [f"# Its {counted(n, 'material')} stand at the end of this file."]
            ),
            "",
            *_camera(start.camera),
            "",
            *_lights(start, job_file),
            "",
            "[samples]",
            _line("hits", "2", "samples per pixel and frame; more: less noise, more time"),
            _line("obscurance", "5", "rays per sample for its indirect light"),
            "",
            "[reuse]",
            _line("n_r", "3", "frames before and after that share their samples"),
            _line("weights", quoted(WEIGHTS), "a sample weighs as much as the part of the pixel that it stands for"),
            "",
            "[obscurance]",
            _line("range", f"{start.range:g}", "how far surfaces darken and colour each other, scene units"),
            _line("outside", quoted(start.outside), _outside(start)),
            "",
            "[indirect]",
            _line("method", quoted(INDIRECT), 'all bounces of light; "obscurance": an approximation, in half the time'),
            "",
            "[output]",
            _line("directory", quoted(f"out/{start.name}"), "relative to this file"),
            _line(
                "format",
                quoted(start.format),
                '"png" is small; "exr" keeps the linear light, for work after the render',
            ),
            _line("fps", f"{start.fps:g}", "frames per second of movies"),
            *_sun_hours(start),
            *([] if few else _materials(start.materials)),
            "",
        ]
    )


def scene_name(file: Path, job_file: Path) -> str:
    """The name of the scene in the job: relative where both files are close together."""
    file, folder = Path(os.path.abspath(file)), Path(os.path.abspath(job_file)).parent
    try:
        name = Path(os.path.relpath(file, folder))
    except ValueError:  # another drive
        return file.as_posix()
    return name.as_posix() if name.parts[: MOST_STEPS_UP + 1].count("..") <= MOST_STEPS_UP else file.as_posix()


def _outside(start: Start) -> str:
    if start.inside:
        return 'what rays bring that meet nothing so near; "background" where the sky matters'
    return "rays that leave the scene bring the sky's light"


def _surfaces(start: Start) -> list[str]:
    if not start.as_file:
        return []
    return [_line("surfaces", '"file"', 'gloss, glass and bumps as in the file; "diffuse": without them, in less time')]


def _camera(camera: Camera) -> list[str]:
    width, height = camera.resolution
    return [
        "[camera]",
        *_comments(camera.about),
        _line("resolution", f"[{width}, {height}]", "width and height, pixels"),
        *(_line(key, inline(value), LENS[key]) for key, value in camera.lens.items()),
        _line("frames", str(camera.frames), "eyes along the path"),
        "keys = [                                  # where the eye is at some frames; between them it moves smoothly",
        *(f"  {_inline(key.table)}," for key in camera.keys),
        "]",
    ]


def _lights(start: Start, job_file: Path) -> list[str]:
    positions = _line("frames", str(start.light_frames), "positions of the light; each gives one picture per eye")
    lines = ["[light]", positions]
    for source in start.sources:
        lines += ["", "[[light.sources]]", *_comments(source.about), *_source(source, job_file)]
    return lines


def _source(source: LightSource, job_file: Path) -> list[str]:
    group = [_line("group", quoted(source.group), "stored separately, to change it afterwards")] if source.group else []
    if isinstance(source, SunDay):
        return [_line("type", '"sun"', "by place and time"), *group, *_sun(source)]
    if isinstance(source, EnvironmentLight):
        turned = f"[{{ frame = 0, rotation = 0, intensity = {source.intensity!r} }}]"
        return [
            _line("type", '"environment"', "light from all around"),
            *group,
            _line("file", quoted(scene_name(source.file, job_file)), "its panorama"),
            _line("keys", turned, "rotation in degrees, clockwise; a second key makes it turn"),
        ]
    if isinstance(source, MeshLight):
        return [
            _line("type", '"mesh"', "surfaces of the scene that shine"),
            *group,
            _line("material", quoted(source.material), "its name in the scene file"),
            _line("two_sided", str(source.two_sided).lower(), "whether the back shines, too"),
            _line("keys", f"[{{ frame = 0, intensity = {source.intensity!r} }}]", "times the emission of the file"),
        ]
    power = POWERS[source.kind][1]
    unit = UNITS.get(power, "W/sr")
    lines = [
        _line(
            "type",
            quoted(source.kind),
            PANELS
            if power == "radiance"
            else '"point": a lamp; "spot": in a cone; "directional": the sun; "sun": by place and time',
        ),
        *group,
        *([_line("ies", quoted(scene_name(source.ies, job_file)), "how it shines by direction")] if source.ies else []),
        f"keys = [                                  # {power}: red, green, blue, {unit}",
        *(f"  {_inline(key)}," for key in source_keys(source)),
        "]",
    ]
    if len(source.frames) == 1:
        lines.append(
            "# It stands still. A second key, such as { frame = 11, ... }, and more `frames` above make it move."
        )
    return lines


def _sun(source: SunDay) -> list[str]:
    return [
        _line("latitude", repr(source.latitude), "degrees, north is positive"),
        _line("longitude", repr(source.longitude), "degrees, east is positive"),
        _line("date", quoted(source.date), "year-month-day"),
        _line("timezone", f"{source.timezone:g}", 'hours ahead of UTC, or a name: "Europe/Berlin"'),
        _line("start", quoted(source.start), "local time of the first position"),
        _line("stop", quoted(source.stop), "local time of the last"),
        _line("# step", "15", "minutes between positions, in place of `frames` of [light]"),
        _line("irradiance", inline_floats(source.power), "of a surface that faces the sun: red, green, blue, W/m2"),
        _line("angle", repr(SUN_ANGLE), "under which the sun is seen, degrees: shadows get soft edges"),
    ]


def _sun_hours(start: Start) -> list[str]:
    """The key for hours of sun, commented out: a dozen positions without both ends of the day count too few hours."""
    if not any(isinstance(source, SunDay) for source in start.sources):
        return []
    return [
        "# For hours of direct sun as a layer, let the sun go from its rise to its set in steps of minutes: remove",
        "# `frames` of [light], change `start` and `stop`, and remove the # before `step` and here.",
        _line("# sun_hours", "true", "each position counts for the time to the next"),
    ]


def _materials(materials: Sequence[MaterialNote]) -> list[str]:
    """Every material, commented out."""
    lines = [
        "",
        "# The materials as they were read. To change one, remove the # before its lines and edit the numbers:",
    ]
    lines.append(
        "# reflectivity: diffuse, 0 is black and 1 white; specular: above 0 it is a mirror; their sum is at most 1."
    )
    if any(material.gloss for material in materials):
        lines.append(
            "# roughness: 0.1 is polished and 1 matt; metallic: 1 of metals, which have the reflectivity as colour."
        )
    for material in materials:
        lines.append(f"# [scene.materials.{quoted(material.name)}]")
        more = f"  # {material.more}, which these numbers replace" if material.more else ""
        lines.append(f"# reflectivity = {inline_floats(material.reflectivity)}{more}")
        if max(material.specular) > 0:
            lines.append(f"# specular = {inline_floats(material.specular)}")
        if material.gloss:
            lines += [f"# roughness = {material.gloss[0]}", f"# metallic = {material.gloss[1]}"]
    return lines


def _comments(lines: Iterable[str]) -> list[str]:
    return [f"# {_one_line(line)}" for line in lines]


def _one_line(text: str) -> str:
    """Replace control characters, which a comment must not contain."""
    return "".join(c if c.isprintable() else "?" for c in text)


def _line(key: str, value: str, comment: str) -> str:
    return f"{f'{key} = {value}':<{COLUMN - 1}} # {comment}"


def _inline(table: dict[str, Any]) -> str:
    numbers = {
        key: value if isinstance(value, int | float) else list(map(float, value)) for key, value in table.items()
    }
    return inline(numbers)
