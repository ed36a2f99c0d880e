"""The lights of a first job, of the file or chosen, at the strength that exposes pictures well.

The starter chooses a sun over a place, or a lamp or sun that lights the view of the camera. The strength follows from a
few small renders with and without the lights.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import chain, count
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64, Images
from framearray_cli.base.colour import LUMINANCE, srgb_from_linear
from framearray_cli.base.errors import JobError
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.inputs.emitters import brightness
from framearray_cli.engine.loop import ready_frames
from framearray_cli.job.values import count_steps, even_moments
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import prepared_from
from framearray_cli.render.preview import FEWEST_SAMPLES, share_of
from framearray_cli.scene.files import Stage
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import eyes, lights, lights_without_groups
from framearray_cli.scene.paths.sun import NEVER, daylight, directions_to_sun, level_north, sun_at
from framearray_cli.scene.scene import Scene

from .draft import (
    NotedTable,
    Start,
    StartOptions,
    SunOption,
    Vector,
    round_points,
    round_vector,
    table_of,
    validate_job,
    without_accents,
)
from .probe import normals
from .site import Site
from .staged import convert_lights
from .walks import SUN_KEYS, choose_lamp_path, key_frames, spread_frames, sun_directions

LIGHTS = 12  # positions of the light of a first array, on each day; 288 images with its eyes are rendered in a minute
LAMP: Vector = (1.0, 0.92, 0.8)  # colour of a lamp, and of the sun
SUN: Vector = (1.0, 0.94, 0.84)
BLACK: Vector = (0.0, 0.0, 0.0)
GROUP_LENGTH, TAKEN = 32, ("ambient", "background", "layers", "light", "main")  # names that groups cannot have
GRAZING = 0.1  # share of the time from the rise to the set of the sun
HOUR_DEG = 15  # longitude that the sun crosses in an hour
SKY_SHARE = 0.2  # irradiance of a level surface by the sky, over a surface that faces the sun: in clear air near noon
SUN_ANGLE = 0.53  # degrees; of the sun, seen from the Earth
MOST_EMITTERS = 8  # sources; each costs a shadow ray per hit
LEAST_POWER = 0.01  # of the power of the strongest: fainter ones are left out
# Eyes and light positions that are rendered, at most: through one window the sun may shine at few positions. Each
# position needs no more than a shadow ray per hit.
PICTURES, POSITIONS = 3, 12
SIZE = (48, 36)  # pixels
WALKS = 4096  # for the ambient light, which is then known to some hundredths
CELL_SAMPLES = 2**15  # for cells that a few small pictures see
HITS = 8  # per pixel; the mean of three pictures is then known to a hundredth
# Largest shares of surface pixels that may clip: in all pictures, and at the brightest light position, where the sun on
# the floor fills a tenth.
CLIPPED, CLIPPED_ONCE = 0.03, 0.1
LEAST, MOST, STEPS = 1e-12, 1e12, 30  # bounds of the factor, and bisections: known to a ten-millionth
ROUNDING = float(np.finfo(np.float32).eps)  # over the largest radiance without the lights: fainter light is no light
UNLIT = (
    "No light shows on what the camera sees: mirrors, glass and black surfaces show only what is around them. "
    "Change their materials below, or put them on a ground."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """Target levels of pictures: means over surface pixels, sRGB encoded.

    Attributes:
        mean: with the lights.
        darkest: lowest mean at the brightest light position; kept even if more pixels clip then.
        shade: highest mean without the lights; a sky that gives more is darkened.
    """

    mean: float
    darkest: float = 0.30
    shade: float


# A room is as bright as in the jobs that come with the project. For a thing under the sky, the sun must stand out.
ROOM, THING = Levels(mean=0.42, shade=0.28), Levels(mean=0.50, shade=0.18)


def add_lights(site: Site, start: Start, stage: Stage, options: StartOptions, ends: Float64) -> Start:
    """Add the lights of the file, or a lamp inside, or a sun outside, at the strength that exposes pictures well.

    Args:
        ends: (2, 2, 3) first and last eye and target.

    Raises:
        JobError: the sun asked for never rises.
    """
    start, n, brings = start.noted(*stage.notes), options.lights or LIGHTS, ""
    own: tuple[NotedTable, ...]  # tried first
    more: tuple[NotedTable, ...]  # next to chosen ones
    if options.sun is not None:
        own = sun, _ = make_sun_day(options.sun, start.file)
        if start.inside:  # through windows, a background is less noisy than a sky
            own = (sun,)
        else:
            start = replace(start, background=BLACK)
        more = own
        n = _count_suns(options.sun, sun.table, options.lights)
        options = replace(options, lights=n)
        dark = "The sun lights nothing that the pictures show, so there is another light, too."
    else:
        sources, n = convert_lights(stage, options.lights)
        more, faint = mesh_lights(site.probe.scene)
        start, own = start.noted(*faint), (*sources, *more) if sources else ()
        brings = "The file brings its own lights."
        if n == 1 and (options.lights or 1) > 1:
            brings = f"{brings} They stand still: one light position; a second key in the job makes a light move."
        dark = "The lights of the file light nothing that its pictures show, so others were chosen."
    if own:
        noted = start.noted(brings) if brings else start
        if exposed := _exposed(replace(noted, sources=own, light_frames=n), site):
            return _with_groups(exposed, options)
        start = start.noted(dark)
    return _with_groups(_try_lights(site, start, options, ends, more), options)


def make_sun_day(sun: SunOption, file: Path) -> tuple[NotedTable, NotedTable]:
    """The sun from morning to evening, in the time zone of its longitude, and its sky; on several days while it is up.

    Raises:
        JobError: it never rises on one of the days, or they share no daylight.
        MissingExtraError: ephem is not installed.
    """
    zone = float(round(sun.longitude / HOUR_DEG))
    days = [day.isoformat() for day in sun.dates]
    hours = [daylight(day, zone, (sun.latitude, sun.longitude)).split() for day in days]  # "06:12", "to", "18:05"
    at = f"{', '.join(days)} at latitude {sun.latitude:g}"
    if [NEVER] in hours:
        at = f"{days[hours.index([NEVER])]} at latitude {sun.latitude:g}"
        raise JobError(str(file), [f"--sun: expected a day on which the sun rises, got {at}"])
    first, last = max(span[0] for span in hours), min(span[-1] for span in hours)
    if first >= last:
        raise JobError(str(file), [f"--sun: expected daylight at a common time of day, got {at}"])
    first, last = _without_ends(first, last)
    about = f"the sun over {sun.latitude:g}, {sun.longitude:g} on {', '.join(days)}, from morning to evening"
    table = {"type": "sun", "latitude": sun.latitude, "longitude": sun.longitude}
    table |= {"date": days if len(days) > 1 else days[0], "timezone": int(zone), "start": first, "stop": last}
    table |= {"step": sun.step} if sun.step else {}
    table |= {"north": list(sun.north)} if isinstance(sun.north, tuple) else {}
    sky = NotedTable(
        table=table | {"type": "sky", "irradiance": SKY_SHARE}, about=("its clear sky, in colour",), name="sky"
    )
    table |= {"irradiance": list(SUN), "angle": SUN_ANGLE}
    return NotedTable(table=table, about=(about,), name="sun"), sky


def _count_suns(sun: SunOption, table: dict[str, Any], lights: int | None) -> int:
    """Number of positions on all days: by the step, or as many as asked for, rounded up to equally many per day."""
    if sun.step:
        times = table["start"], table["stop"], table["timezone"]
        return sum(count_steps(day.isoformat(), *times, sun.step) for day in sun.dates)
    days = len(sun.dates)
    return days * (ceil(lights / days) if lights else LIGHTS)


def noon_direction(sun: SunOption, file: Path, up: int) -> Float64:
    """Unit direction (3,) from the scene to the sun in the middle of the first day.

    Args:
        up: number of the up axis.

    Raises:
        JobError: the sun never rises on one of the days, or north is along the up axis.
    """
    table = make_sun_day(sun, file)[0].table
    times = even_moments(sun.dates[0].isoformat(), table["start"], table["stop"], table["timezone"], 3)
    if (north_dir := level_north(table.get("north"), np.eye(3)[up])) is None:
        raise JobError(str(file), [f"--north: expected a direction across the up axis, got {table['north']}"])
    path = sun_at(times[1:2], sun.latitude, sun.longitude)
    return np.asarray(directions_to_sun(path, np.eye(3)[up], north_dir)[0])


def _without_ends(first: str, last: str) -> tuple[str, str]:
    """Leave out a share of the time at both ends, at which the sun only grazes the ground."""
    low, high = (60 * int(text[:2]) + int(text[3:]) for text in (first, last))
    cut = round(GRAZING * (high - low))
    start, stop = (f"{minute // 60:02d}:{minute % 60:02d}" for minute in (low + cut, high - cut))
    return start, stop


def _try_lights(site: Site, start: Start, options: StartOptions, ends: Float64, more: tuple[NotedTable, ...]) -> Start:
    """Add the first of some lights that lights what is seen."""
    for source, n in _lights_to_try(site, start, ends, options.lights or LIGHTS):
        n = options.lights or LIGHTS if any(one.table["type"] == "sun" for one in more) else n
        chosen = replace(start, sources=(*more, source), light_frames=n)
        if exposed := _exposed(chosen, site):
            return exposed
    return _dim_sky(replace(start.noted(UNLIT), sources=(*more, source), light_frames=n), site)


def _dim_sky(start: Start, site: Site) -> Start:
    """Scale the background alone, for pictures in which no light shows."""
    _, dark = _render_radiance(start, site.probe.scene, site.probe.embree)
    levels = ROOM if start.inside else THING
    sky = _largest_factor(lambda factor: _mean_luminances(factor * dark).max() <= levels.mean)
    return _with_sky(start, min(1.0, sky))


def _lights_to_try(site: Site, start: Start, ends: Float64, n: int) -> list[tuple[NotedTable, int]]:
    """Lights to try in turn, and the number of positions of each.

    A lamp where there is a room, then a sun from behind the eye, then a lamp at the eye. One that stands still has one
    position, since two equal ones would be the same picture twice.
    """
    found = []
    eyes, targets = ends[:, 0], ends[:, 1]
    if start.inside and site.room is not None:
        path = choose_lamp_path(site.probe, site.room, eyes, targets)
        if path is not None:
            points = round_points(path + site.centre, site.size)
            moves = n > 1 and points[0] != points[1]
            about = "a lamp that is carried through the room" if moves else "a lamp in the room"
            found.append((_make_light("point", [0, n - 1] if moves else [0], points, LAMP, about), n if moves else 1))
    frames, shares = key_frames(n, SUN_KEYS)
    suns = sun_directions(eyes.mean(axis=0) - targets.mean(axis=0), site.up, shares)
    about = "a sun that goes over from left to right behind the eye; `direction` is the way its light travels"
    directions = [round_vector(np.round(sun, 3)) for sun in suns]
    found.append((_make_light("directional", frames, directions, SUN, about), n))
    (eye,) = round_points(eyes[:1] + site.centre, site.size)
    found.append((_make_light("point", [0], [eye], LAMP, "a lamp at the eye"), 1))
    return found


def _make_light(kind: str, frames: list[int], vectors: list[Vector], power: Vector, about: str) -> NotedTable:
    place, strength = ("position", "intensity") if kind == "point" else ("direction", "irradiance")
    keys = [
        {"frame": frame, place: list(vector), strength: list(power)}
        for frame, vector in zip(frames, vectors, strict=False)
    ]
    return NotedTable(table={"type": kind, "keys": keys}, about=(about,), name="lamp" if kind == "point" else "sun")


def _exposed(start: Start, site: Site) -> Start | None:
    """Scale all lights and the background; None where the lights light nothing that the camera sees."""
    if (factors := find_factors(start, site.probe.scene, site.probe.embree)) is None:
        return None
    factor, sky = factors
    return _with_sky(replace(start, sources=tuple(source.scaled(factor) for source in start.sources)), sky)


def _with_sky(start: Start, factor: float) -> Start:
    """Scale the background."""
    red, green, blue = (float(f"{channel * factor:.3g}") for channel in start.background)
    return replace(start, background=(red, green, blue))


def _with_groups(start: Start, options: StartOptions) -> Start:
    """Make every source a group of its own, named after it, if the options ask for it."""
    if not options.groups:
        return start
    taken, sources = set(TAKEN), list[NotedTable]()
    for source in start.sources:
        base = re.sub(r"[^A-Za-z0-9_-]+", "-", without_accents(source.name)).strip("-")[:GROUP_LENGTH] or "lamp"
        name = next(one for one in chain([base], (f"{base}-{k}" for k in count(2))) if one.lower() not in taken)
        taken.add(name.lower())
        sources.append(replace(source, table={"type": source.table["type"], "group": name} | source.table))
    return replace(start, sources=tuple(sources))


class AllNames:
    """Every name."""

    def __contains__(self, name: object) -> bool:
        return True


def mesh_lights(scene: Scene) -> tuple[tuple[NotedTable, ...], tuple[str, ...]]:
    """Find the materials that emit most; also return a note on those that are left out, if any."""
    power: dict[str, float] = {}
    sides: dict[str, bool] = {}
    for m, name in enumerate(scene.material_names):
        rows = np.flatnonzero(scene.material == m).astype(np.int32)
        if not len(rows) or not scene.emission[m].any():
            continue
        area = np.linalg.norm(normals(scene.corners[rows]), axis=1) / 2
        bright = brightness(scene, rows, np.full(len(rows), scene.emission_texture[m]))
        sides[name] = not scene.one_sided[m]
        power[name] = power.get(name, 0.0) + float((area * bright).sum() * scene.emission[m].mean())
    names = sorted(power, key=lambda name: -power[name])
    kept = [name for name in names[:MOST_EMITTERS] if power[name] >= LEAST_POWER * power[names[0]]]
    left = [name for name in power if name not in kept]
    notes = (f"the emission of faint materials is left out: {', '.join(left[:MOST_EMITTERS])}",) if left else ()
    found = []
    for name in kept:
        keys = [{"frame": 0, "intensity": 1.0}]
        table = {"type": "mesh", "material": name, "two_sided": sides[name], "keys": keys}
        found.append(NotedTable(table=table, about=(f'the material "{name}" emits, as the file says',), name=name))
    return tuple(found), notes


def find_factors(start: Start, scene: Scene, embree: EmbreeScene) -> tuple[float, float] | None:
    """Find the factors of all intensities and of the background; None where the lights light nothing that is seen."""
    lit, dark = _render_radiance(start, scene, embree)
    if not len(dark) or lit.max() <= ROUNDING * dark.max():
        return None
    levels = ROOM if start.inside else THING
    sky = min(1.0, _largest_factor(lambda factor: _mean_luminances(factor * dark).max() <= levels.shade))
    factor = solve_exposure(lit, sky * dark, levels)
    return (factor, sky) if factor < MOST / 2 else None


def solve_exposure(lit: Float64, dark: Float64, levels: Levels) -> float:
    """Solve for the factor for which `factor * lit + dark` is well exposed; near MOST if hardly anything is lit.

    Args:
        lit: (light positions, n, 3) radiance of surfaces due to the lights.
        dark: (n, 3) the rest.
    """

    def clips(factor: float) -> bool:
        shares = ((factor * lit + dark).max(axis=-1) > 1).mean(axis=-1)
        return float(shares.mean()) > CLIPPED or float(shares.max()) > CLIPPED_ONCE

    right = _largest_factor(lambda factor: _mean_luminances(factor * lit + dark).mean() <= levels.mean)
    if not clips(right):
        return right
    spared = _largest_factor(lambda factor: not clips(factor))
    seen = _largest_factor(lambda factor: _mean_luminances(factor * lit + dark).max() <= levels.darkest)
    return max(spared, seen) if seen < right else spared  # a small patch of light reaches neither mean


def _mean_luminances(radiance: Float64) -> Float64:
    """Return the means (...) over all pixels of (..., n, 3)."""
    return np.asarray((srgb_from_linear(radiance) @ LUMINANCE).sum(axis=-1) / max(radiance.shape[-2], 1))


def _largest_factor(holds: Callable[[float], bool | np.bool]) -> float:
    """Find the largest factor for which a condition holds, by bisection; more light must break it."""
    low, high = np.log(LEAST), np.log(MOST)
    for _ in range(STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(float(np.exp(middle))) else (low, middle)
    return float(np.exp(low))


def _render_radiance(start: Start, scene: Scene, embree: EmbreeScene) -> tuple[Float64, Float64]:
    """Render the radiance of n pixels that see a surface: (positions, n, 3) due to the lights, and (n, 3) the rest."""
    table = table_of(start)
    table["camera"]["resolution"] = list(SIZE)
    n_sources = len(start.sources)
    table |= {"samples": {"hits": share_of(HITS, n_sources, 1)}, "reuse": {"n_r": 0}, "ambient": {"paths": WALKS}}
    if table["indirect"]["method"] == "cells":
        table["indirect"] |= {"samples": share_of(CELL_SAMPLES, n_sources, FEWEST_SAMPLES)}
    job = validate_job(table, start.file)
    job_eyes, job_lights = eyes(job), lights(job)
    few_eyes, few = job_eyes.at(spread_frames(job_eyes.n, PICTURES)), spread_frames(job_lights.n, POSITIONS)
    few_lights = lights_without_groups([_append_dark(source, few) for source in job_lights.sources])
    # several eyes are rendered even if they coincide: their mean has less noise
    prepared = replace(prepared_from(job, scene, few_eyes, few_lights), still=few_eyes.n == 1)
    setup, ambient = plan_work(prepared, embree, compare=False)
    shape = (setup.lights.n_lights, setup.cams.height, setup.cams.width, 3)
    found: list[Images] = []
    with TracePool(setup, prepared.threads) as pool:
        window = Window(setup, ambient, pool)
        for j in ready_frames(window, setup, range(setup.n_frames), pool):
            composed = window.compose(j, np.empty(shape, np.float32))
            found.append(composed.images[:, composed.layers["depth"] > 0])
    images = np.concatenate(found, axis=1).astype(np.float64)  # (positions + 1, n, 3); the last has no lights
    return np.maximum(images[:-1] - images[-1], 0), images[-1]


def _append_dark(source: LightPath, some: list[int]) -> LightPath:
    """Some positions of a source, followed by one at which it does not shine."""
    shown = source.at([*some, 0])
    return replace(shown, intensity=np.concatenate([shown.intensity[:-1], np.zeros((1, 3))]), notes=())
