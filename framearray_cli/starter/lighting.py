"""The lights of a first job: those of the file, a sun over a place, or a lamp or sun that lights what is seen."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import JobError, SceneError
from framearray_cli.scene.files import Stage
from framearray_cli.scene.paths.sun import NEVER, daylight

from .environment import Maps, environment_light
from .expose import find_factors
from .lamps import choose_lamp_path
from .model import (
    EnvironmentLight,
    LightKeys,
    LightSource,
    MeshLight,
    Start,
    SunDay,
    Vector,
    round_points,
    round_vector,
    without_accents,
)
from .options import StartOptions, SunOption
from .orbit import SUN_KEYS, key_frames, sun_directions
from .shining import mesh_lights
from .site import Site
from .staged import convert_lights

LIGHTS = 12  # positions of the light of a first array; 288 images with its eyes are rendered in a minute
LAMP: Vector = (1.0, 0.92, 0.8)  # colour of a lamp, and of the sun
SUN: Vector = (1.0, 0.94, 0.84)
BLACK: Vector = (0.0, 0.0, 0.0)
GROUP_LENGTH, TAKEN = 32, ("ambient", "background", "layers", "light", "main")  # names that groups cannot have
GRAZING = 0.1  # share of the time from the rise to the set of the sun
HOUR_DEG = 15  # longitude that the sun crosses in an hour


def add_lights(
    site: Site, start: Start, stage: Stage, options: StartOptions, ends: Float64, maps: Maps | None = None
) -> Start:
    """Add the lights of the file, or a lamp inside, or a sun outside, at the strength that exposes pictures well.

    Args:
        ends: (2, 2, 3) first and last eye and target.
        maps: where an environment of the file is saved; None: it is left out.

    Raises:
        JobError: the sun asked for never rises.
        OutputError: the file of an environment is in the way, or cannot be written.
        SceneError: no light reaches what the camera sees.
    """
    start = replace(start, about=(*start.about, *stage.notes))
    if options.sun is not None:
        return _with_groups(_under_the_sun(site, start, options, ends, options.sun), options)
    sources, n = convert_lights(stage, options.lights)
    meshes, faint = mesh_lights(site.probe.scene)
    start = replace(start, about=(*start.about, *faint))
    around, left = environment_light(stage, maps)
    start = replace(start, about=(*start.about, *left))
    if sources or around:
        brings = "The file brings its own lights."
        if n == 1 and (options.lights or 1) > 1:
            brings = f"{brings} They stand still: one light position; a second key in the job makes a light move."
        sky = BLACK if around else start.background  # the environment is what lies outside
        own = replace(start, sources=(*around, *sources, *meshes), light_frames=n, background=sky)
        own = replace(own, about=(*start.about, brings))
        if (factors := find_factors(own, site.probe.scene, site.probe.embree)) is not None:
            return _with_groups(_scale_lights(own, *factors), options)
        dark = "The lights of the file light nothing that its pictures show, so others were chosen."
        start = replace(start, about=(*start.about, dark))
    return _with_groups(_try_lights(site, start, options, ends, meshes), options)


def _under_the_sun(site: Site, start: Start, options: StartOptions, ends: Float64, sun: SunOption) -> Start:
    """Add a sun over a place; and other lights too where it lights nothing that the pictures show."""
    n = options.lights or LIGHTS
    day = make_sun_day(sun, start.file)
    by_day = replace(start, sources=(day,), light_frames=n)
    if (factors := find_factors(by_day, site.probe.scene, site.probe.embree)) is not None:
        return _scale_lights(by_day, *factors)
    dark = "The sun lights nothing that the pictures show, so there is another light, too."
    return _try_lights(site, replace(start, about=(*start.about, dark)), options, ends, (day,))


def make_sun_day(sun: SunOption, file: Path) -> SunDay:
    """The sun from morning to evening, in the time zone of its longitude.

    Raises:
        JobError: it never rises on that day.
        MissingExtraError: ephem is not installed.
    """
    zone = float(round(sun.longitude / HOUR_DEG))
    hours = daylight(sun.date, zone, (sun.latitude, sun.longitude))
    if hours == NEVER:
        problem = f"--sun: expected a day on which the sun rises, got {sun.date} at latitude {sun.latitude:g}"
        raise JobError(str(file), [problem])
    first, last = hours.split(" and ")[0].split(" to ")[0], hours.split(" to ")[-1]
    first, last = _without_ends(first, last)
    about = f"the sun over {sun.latitude:g}, {sun.longitude:g} on {sun.date}, from morning to evening"
    return SunDay(
        latitude=sun.latitude,
        longitude=sun.longitude,
        date=sun.date,
        timezone=zone,
        start=first,
        stop=last,
        power=SUN,
        about=(about,),
    )


def _without_ends(first: str, last: str) -> tuple[str, str]:
    """Leave out a share of the time at both ends, at which the sun only grazes the ground."""
    low, high = (60 * int(text[:2]) + int(text[3:]) for text in (first, last))
    cut = round(GRAZING * (high - low))
    start, stop = (f"{minute // 60:02d}:{minute % 60:02d}" for minute in (low + cut, high - cut))
    return start, stop


def _try_lights(site: Site, start: Start, options: StartOptions, ends: Float64, more: tuple[LightSource, ...]) -> Start:
    """Add the first of some lights that lights what is seen."""
    for source, n in _lights_to_try(site, start, ends, options.lights or LIGHTS):
        n = options.lights or LIGHTS if any(isinstance(one, SunDay) for one in more) else n
        chosen = replace(start, sources=(*more, source), light_frames=n)
        if (factors := find_factors(chosen, site.probe.scene, site.probe.embree)) is not None:
            return _scale_lights(chosen, *factors)
    raise SceneError(f"{start.file}: no light reaches what the camera sees; its surfaces may be black")


def _lights_to_try(site: Site, start: Start, ends: Float64, n: int) -> list[tuple[LightKeys, int]]:
    """Lights to try in turn, and the number of positions of each.

    A lamp where there is a room, then a sun from behind the eye, then a lamp at the eye. One that stands still has one
    position, since two equal ones would be the same picture twice.
    """
    found = []
    eyes, targets = ends[:, 0], ends[:, 1]
    if start.inside and site.room is not None:
        way = choose_lamp_path(site.probe, site.room, eyes, targets)
        if way is not None:
            points = round_points(way + site.centre, site.size)
            moves = n > 1 and points[0] != points[1]
            about = "a lamp that is carried through the room" if moves else "a lamp in the room"
            found.append((_make_light("point", [0, n - 1] if moves else [0], points, LAMP, about), n if moves else 1))
    frames, shares = key_frames(n, SUN_KEYS)
    suns = sun_directions(eyes.mean(axis=0) - targets.mean(axis=0), site.up, shares)
    about = "a sun that goes over from left to right behind the eye; `direction` is the way its light travels"
    directions = [round_vector(np.round(way, 3)) for way in suns]
    found.append((_make_light("directional", frames, directions, SUN, about), n))
    (eye,) = round_points(eyes[:1] + site.centre, site.size)
    found.append((_make_light("point", [0], [eye], LAMP, "a lamp at the eye"), 1))
    return found


def _make_light(
    kind: Literal["point", "directional"], frames: list[int], vectors: list[Vector], power: Vector, about: str
) -> LightKeys:
    n = len(frames)
    return LightKeys(
        kind=kind,
        frames=tuple(frames),
        vectors=tuple(vectors[:n]),
        powers=(power,) * n,
        about=(about,),
        name="lamp" if kind == "point" else "sun",
    )


def _scale_lights(start: Start, factor: float, sky: float) -> Start:
    """Multiply all lights by `factor`, and the background by `sky`."""

    def strong(power: Vector, by: float) -> Vector:
        red, green, blue = (float(f"{channel * by:.3g}") for channel in power)
        return red, green, blue

    def scaled(source: LightSource) -> LightSource:
        if isinstance(source, SunDay):
            return replace(source, power=strong(source.power, factor))
        if isinstance(source, MeshLight | EnvironmentLight):
            return replace(source, intensity=float(f"{source.intensity * factor:.3g}"))
        return replace(source, powers=tuple(strong(power, factor) for power in source.powers))

    return replace(start, sources=tuple(map(scaled, start.sources)), background=strong(start.background, sky))


def _with_groups(start: Start, options: StartOptions) -> Start:
    """Make every source a group of its own, named after it, if the options ask for it."""
    if not options.groups:
        return start
    names: list[str] = []
    for source in start.sources:
        names.append(_group_name(source.name, names))
    sources = tuple(replace(source, group=name) for source, name in zip(start.sources, names, strict=True))
    return replace(start, sources=sources)


def _group_name(name: str, taken: list[str]) -> str:
    """A name of a group like that of a light, which no other has."""
    base = re.sub(r"[^A-Za-z0-9_-]+", "-", without_accents(name)).strip("-")[:GROUP_LENGTH] or "lamp"
    found, k = base, 1
    while found.lower() in (*TAKEN, *(other.lower() for other in taken)):
        k += 1
        found = f"{base}-{k}"
    return found
