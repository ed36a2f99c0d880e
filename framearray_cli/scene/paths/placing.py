"""Sources of a job -> position and strength at every light position."""

from collections.abc import Sequence
from dataclasses import replace
from math import pi, sqrt
from typing import Any, Literal

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.job.job import Job
from framearray_cli.job.keys import PlacedSource, ShownSource
from framearray_cli.job.light import LightTable
from framearray_cli.job.rowfile import RowFileError
from framearray_cli.job.sources import (
    AnyPanel,
    DirectionalKey,
    DirectionalSource,
    DomeSource,
    EnvironmentSource,
    GridSource,
    LightSource,
    MeshSource,
    PanelKey,
    PanelSource,
    PlacedLamp,
    PointKey,
    PointSource,
    RectKey,
    RectSource,
    SpotKey,
    SpotSource,
    SunSource,
)
from framearray_cli.job.values import SHORTEST

from .curves import PARALLEL, interpolate_directions, interpolate_keys, unit
from .lightpath import Cone, Emitter, LightPath, Panel, across_under, carry_across
from .panorama import REST, SUNS, Environment, norths, read_panorama
from .profiles import Profile, read_web
from .sun import NEVER, daylight, directions_to_sun, sun_path

LUMENS_PER_WATT = 683.0  # of light of 555 nm, by the definition of the candela; renderers take it for all light


def in_units(
    path: LightPath,
    source: PointSource | DirectionalSource | SpotSource | SunSource | DomeSource | GridSource | AnyPanel | MeshSource,
) -> LightPath:
    """Turn the strengths of a source from the units of its job into W/sr or W/m2.

    Lumens count all light that the lamp sends out: its intensity in candela is their number over the solid
    angle that would send out as much if it were lit evenly. What a file says of a lamp is in W/sr already.
    """
    own = isinstance(source, PointSource | SpotSource) and source.keys[0].intensity is None
    if own or source.units in (None, "W/sr", "W/m2", "W", "W/(m2 sr)"):
        return path
    by_angle = source.units == "lm" and path.panel is None  # a panel's are of its power, not of an intensity
    per_unit = 1 / LUMENS_PER_WATT / (_solid_angles(path) if by_angle else np.ones(len(path.vector)))
    return replace(path, intensity=path.intensity * per_unit[:, None])


def _solid_angles(path: LightPath) -> Float64:
    """The integral of a lamp's intensity over all directions, over its largest, at every light position, sr."""
    if path.profile is not None:
        return np.full(len(path.vector), path.profile.web.flux)
    if path.cone is None:
        return np.full(len(path.vector), 4 * np.pi)
    inner, outer = np.cos(np.radians(path.cone.angles_deg.T))
    return np.asarray(2 * np.pi * (1 - inner + (inner - outer) / 3))  # (a c + b)^2 between the cones


GOLDEN_ANGLE = pi * (3 - sqrt(5))  # radians from one point of the spiral to the next


def dome_directions(n: int, top: Float64, *, whole: bool) -> Float64:
    """Spread n unit directions evenly over a hemisphere or sphere, (n, 3), along a spiral from the top [Swinbank06].

    Each stands for the same solid angle: their heights are the middles of n slices of equal area.

    Args:
        top: (3,) middle of the hemisphere, of any length but 0.
        whole: a sphere, which ends opposite the top.
    """
    k = np.arange(n)
    height = 1 - (k + 0.5) * ((2 if whole else 1) / n)
    around, level = k * GOLDEN_ANGLE, np.sqrt(1 - height * height)
    up_dir = unit(np.asarray(top, np.float64))
    first_dir = unit(np.cross(up_dir, np.eye(3)[np.abs(up_dir).argmin()]))
    other_dir = np.cross(up_dir, first_dir)
    flat = np.cos(around)[:, None] * first_dir + np.sin(around)[:, None] * other_dir
    return np.asarray(height[:, None] * up_dir + level[:, None] * flat)


def grid_points(
    counts: tuple[int, int], corner: Sequence[float], side: Sequence[float], other_side: Sequence[float]
) -> Float64:
    """Return the points of a flat grid, (counts[0] * counts[1], 3), row by row from the corner.

    Args:
        counts: points along `side`, in each row, and along `other_side`; a single one is at the corner.
        side, other_side: from the first point to the last along each.
    """
    along, across = (np.linspace(0.0, 1.0, n) for n in counts)
    rows = np.asarray(corner) + across[:, None, None] * np.asarray(other_side)  # (n_rows, 1, 3)
    return np.asarray((rows + along[:, None] * np.asarray(side)).reshape(-1, 3))


def add_profile(
    path: LightPath, source: PointSource | SpotSource, way: tuple[Float64, Float64], job: Job, name: str
) -> LightPath:
    """Give a lamp the profile of its file and, where its keys have no intensity, the file's.

    Args:
        way: (n, 3) unit directions of vertical angle 0, and of horizontal angle 0 or (0, 3).
        name: of the source, for messages.

    Raises:
        JobError: its `up` points along its axis, or its file is broken by now.
    """
    assert source.ies is not None
    try:
        web = read_web(source.ies)
    except RowFileError as error:
        raise JobError(job.file or job.name, [f"{name}.ies: {source.ies.name}: {error.args[0]}"]) from error
    up_dir = np.array([0.0, 0.0, 1.0] if job.scene.up == "z" else [0.0, 1.0, 0.0])
    axis, ups = way
    across = across_under(axis, ups) if len(ups) else carry_across(axis, up_dir)
    if (flat := np.flatnonzero((across == 0).all(axis=1))).size:
        problem = f"{name}: expected an `up` across the direction of the lamp, got one along it at frame {flat[0]}"
        raise JobError(job.file or job.name, [problem])
    zero = np.cross(axis, across) if len(ups) or web.sideways else across
    intensity = path.intensity
    if source.keys[0].intensity is None:
        tilt_deg = np.degrees(np.arccos(np.clip(-axis @ up_dir, -1, 1)))
        intensity = intensity * web.candela / LUMENS_PER_WATT * web.tilt_factors(tilt_deg)[:, None]
    return replace(
        path,
        intensity=intensity,
        profile=Profile(file=source.ies.name, web=web, axis=axis, zero=zero),
    )


def place_environment(source: EnvironmentSource, job: Job, name: str, n: int) -> LightPath:
    """Read an environment map, and interpolate its keys.

    Raises:
        JobError: the map is missing or broken.
    """
    try:
        panorama = read_panorama(source.file)
    except OutputError as error:
        problem = str(error).replace(str(source.file), source.file.name)
        raise JobError(job.file or job.name, [f"{name}.file: {problem}"]) from error
    frames = [key.frame for key in source.keys]
    rotation_deg = interpolate_keys(frames, [[key.rotation] for key in source.keys], n)[:, 0]
    colors = [key.color if key.color is not None else (1.0, 1.0, 1.0) for key in source.keys]
    factor = interpolate_keys(frames, [key.intensity for key in source.keys], n) * interpolate_keys(frames, colors, n)
    up_dir = np.array([0.0, 0.0, 1.0] if job.scene.up == "z" else [0.0, 1.0, 0.0])
    environment = Environment(panorama=panorama, rotation_deg=rotation_deg, factor=factor, up=up_dir)
    return LightPath(
        kind="directional",
        vector=-norths(job.scene.up, rotation_deg),
        intensity=factor * panorama.flux,
        environment=environment,
    )


def cut_suns(path: LightPath, i: int) -> tuple[LightPath, ...]:
    """Divide source i into its map without suns and these, so that each hit sends a ray to both; or return it as it is.

    Without that hits would draw the sky so rarely, and with so much weight, that it would be noise.
    """
    whole = path.environment
    if whole is None or not whole.panorama.has_suns:
        return (path,)
    parts = [replace(whole, part=part) for part in (REST, SUNS)]
    rest, suns = (replace(path, environment=one, intensity=path.intensity * (one.flux / whole.flux)) for one in parts)
    return rest, replace(suns, part_of=i)


def in_camera_space(table: LightTable) -> bool:
    """Return whether any source has its positions in the axes of the first camera."""
    return any(isinstance(s, PlacedSource) and s.space == "camera" for s in table.sources)


def place_source(job: Job, i: int, n: int, world_from_camera: Float64 | None) -> LightPath:
    """Compute position and intensity of source i at n light positions.

    Args:
        world_from_camera: (3, 3) axes of the first camera, where a source needs them.

    Raises:
        JobError: a sun that never shines, or whose north points up; a broken environment map.
        MissingExtraError: it is a sun, and ephem is not installed.
    """
    source = job.light.sources[i]
    path = _place(source, job, i, n, world_from_camera)
    return replace(path, visible=True) if isinstance(source, ShownSource) and source.visible else path


def _place(source: LightSource, job: Job, i: int, n: int, world_from_camera: Float64 | None) -> LightPath:
    match source:
        case SunSource():
            return in_units(_place_sun(source, job, f"light.sources[{i}]", n), source)
        case DomeSource():
            return in_units(_place_dome(source, _up(job), n), source)
        case GridSource():
            points = grid_points(source.counts, source.corner, source.side, source.other_side)
            return in_units(_constant("point", points, source, n), source)
        case SpotSource():
            return in_units(_place_spot(source, job, f"light.sources[{i}]", n, world_from_camera), source)
        case EnvironmentSource():
            return place_environment(source, job, f"light.sources[{i}]", n)
        case MeshSource():
            return in_units(_place_mesh(source, n), source)
        case PanelSource():
            return in_units(_place_panel(source, job, f"light.sources[{i}]", n, world_from_camera), source)
        case _:
            path = _moved(_interpolate(source.type, source.keys, n), source, job, world_from_camera)
            if isinstance(source, PointSource) and source.ies:
                down = np.tile(-_up(job), (n, 1))
                ups = _turned(_ups(source.keys, n), source, world_from_camera)
                path = add_profile(path, source, (down, ups), job, f"light.sources[{i}]")
            return in_units(path, source)


def _moved(path: LightPath, source: PlacedSource[Any], job: Job, world_from_camera: Float64 | None) -> LightPath:
    """Turn, scale and move the positions of a source into the coordinates of the scene file."""
    vector = _turned(path.vector, source, world_from_camera)
    if isinstance(source, PlacedLamp):
        center = source.center or (job.camera.keys[0].target if source.space == "camera" else None)
        vector = vector * source.scale if source.scale else vector
        vector = vector + np.array(center) if center else vector
    return replace(path, vector=vector)


def _turned(vectors: Float64, source: PlacedSource[Any], world_from_camera: Float64 | None) -> Float64:
    """Turn vectors of a source, (n, 3), into the axes of the scene file."""
    in_camera = source.space == "camera" and world_from_camera is not None
    return vectors @ world_from_camera.T if in_camera and world_from_camera is not None else vectors


def _place_dome(source: DomeSource, up_dir: Float64, n: int) -> LightPath:
    """Compute points or directions of a dome at n light positions."""
    to_light = dome_directions(source.positions, np.array(source.top or up_dir), whole=source.shape == "sphere")
    if source.radius is None:
        return _constant("directional", -to_light, source, n)
    return _constant("point", np.array(source.target) + source.radius * to_light, source, n)


def _place_spot(source: SpotSource, job: Job, name: str, n: int, world_from_camera: Float64 | None) -> LightPath:
    """Interpolate the keys of a spot; where they have targets, its axis follows the targets.

    Raises:
        JobError: the spot meets its target between two keys, or see `add_profile`.
    """
    keys = source.keys
    path = _interpolate("point", keys, n)
    axis = _turned(_axes(keys, path.vector, job, name, "the spot"), source, world_from_camera)
    path = _moved(path, source, job, world_from_camera)
    if source.ies:
        return add_profile(path, source, (axis, _turned(_ups(keys, n), source, world_from_camera)), job, name)
    angles = interpolate_keys([key.frame for key in keys], [(key.inner, key.outer) for key in keys], n)
    return replace(path, cone=Cone(axis=axis, angles_deg=angles))


def _place_panel(source: AnyPanel, job: Job, name: str, n: int, world_from_camera: Float64 | None) -> LightPath:
    """Interpolate the keys of a rectangle or disc.

    Raises:
        JobError: it meets its target between two keys, or its `up` points along its normal.
    """
    keys = source.keys
    frames = [key.frame for key in keys]
    position = interpolate_keys(frames, [key.position for key in keys], n)
    axis = _turned(_axes(keys, position, job, name, "the panel"), source, world_from_camera)
    ups = (
        _turned(_ups(source.keys, n), source, world_from_camera) if isinstance(source, RectSource) else np.empty((0, 3))
    )
    across = across_under(axis, ups) if len(ups) else carry_across(axis, _up(job))
    if (flat := np.flatnonzero((across == 0).all(axis=1))).size:
        problem = f"{name}: expected an `up` across the direction of the panel, got one along it at frame {flat[0]}"
        raise JobError(job.file or job.name, [problem])
    sides = interpolate_keys(frames, [key.sides for key in keys], n)
    panel = Panel(shape=source.type, axis=axis, across=across, sides=sides, two_sided=source.two_sided)
    colour = interpolate_keys(frames, [key.color if key.color is not None else (1.0, 1.0, 1.0) for key in keys], n)
    if keys[0].power is not None:
        strength = interpolate_keys(frames, [key.power or () for key in keys], n) / panel.flux
    else:
        strength = interpolate_keys(frames, [key.radiance or () for key in keys], n) * panel.area[:, None]
    path = LightPath(kind="point", vector=position, intensity=strength * colour, panel=panel)
    return _moved(path, source, job, world_from_camera)


def _ups(keys: Sequence[PointKey | RectKey], n: int) -> Float64:
    """Interpolate the `up` of keys, (n, 3); (0, 3) where they have none."""
    if keys[0].up is None:
        return np.empty((0, 3))
    return interpolate_directions([key.frame for key in keys], [key.up for key in keys if key.up], n)


def _place_mesh(source: MeshSource, n: int) -> LightPath:
    """Interpolate the strength of a material that shines; the scene says where it is."""
    frames, white = [key.frame for key in source.keys] or [0], (1.0, 1.0, 1.0)
    strengths = [key.radiance or key.intensity or white for key in source.keys] or [white]
    colours = [key.color if key.color is not None else white for key in source.keys] or [white]
    own = source.has_radiance
    emitter = Emitter(material=source.material, two_sided=source.two_sided, flat=own, absolute=own)
    intensity = interpolate_keys(frames, strengths, n) * interpolate_keys(frames, colours, n)
    return LightPath(kind="mesh", vector=np.zeros((n, 3)), intensity=intensity, emitter=emitter)


def _axes(keys: Sequence[SpotKey | PanelKey], position: Float64, job: Job, name: str, what: str) -> Float64:
    """Compute the unit directions in which a source at n positions shines, by its keys; where they have targets, it
    follows the targets.

    Raises:
        JobError: the source meets its target between two keys.
    """
    frames, n = [key.frame for key in keys], len(position)
    if keys[0].target is None:
        return interpolate_directions(frames, [key.direction for key in keys if key.direction], n)
    way = interpolate_keys(frames, [key.target for key in keys if key.target], n) - position
    if (meeting := np.flatnonzero(np.linalg.norm(way, axis=1) < SHORTEST)).size:
        problem = f"{name}: expected a target away from {what}, got the same point at frame {meeting[0]}; move a key"
        raise JobError(job.file or job.name, [problem])
    return unit(way)


def _constant(
    kind: Literal["point", "directional"], vector: Float64, source: DomeSource | GridSource, n: int
) -> LightPath:
    """A source of constant strength at its own positions; it stays at the last where n is larger."""
    strength = source.irradiance if isinstance(source, DomeSource) and kind == "directional" else source.intensity
    intensity = np.array(strength) * np.array(source.color or 1.0)
    at = np.minimum(np.arange(n), len(vector) - 1)
    return LightPath(kind=kind, vector=vector[at], intensity=np.tile(intensity, (n, 1)))


def _up(job: Job) -> Float64:
    """The up axis of the scene, (3,)."""
    return np.array([0.0, 0.0, 1.0] if job.scene.up == "z" else [0.0, 1.0, 0.0])


def _place_sun(source: SunSource, job: Job, name: str, n: int) -> LightPath:
    """Compute directions and irradiance of a sun at n light positions."""
    up_dir = _up(job)
    north_vec = unit(np.array(source.north or ((0.0, 1.0, 0.0) if job.scene.up == "z" else (0.0, 0.0, -1.0))))
    north_vec = north_vec - (north_vec @ up_dir) * up_dir
    if np.linalg.norm(north_vec) <= PARALLEL:
        problem = f'{name}.north: expected a direction that is not up, got the up axis of the scene, "{job.scene.up}"'
        raise JobError(job.file or job.name, [problem])
    place = (source.latitude, source.longitude)
    sun = sun_path(source.dates, source.start, source.stop, source.timezone, place, n, source.step)
    if not sun.is_up.any():
        hours = daylight(source.dates[0], source.timezone, place)
        when = "it does not rise on that day" if hours == NEVER else f"on {source.dates[0]} it is up from {hours}"
        problem = f"{name}: the sun is below the horizon from {source.start} to {source.stop}; {when}"
        raise JobError(job.file or job.name, [problem])
    return LightPath(
        kind="directional",
        vector=-directions_to_sun(sun, up_dir, unit(north_vec)),
        intensity=sun.is_up[:, None] * np.array(source.irradiance) * np.array(source.color or 1.0),
        size=np.full(n, source.angle) if source.angle else None,
        notes=tuple(
            {"azimuth": round(azimuth, 4), "elevation": round(elevation, 4), "time": time.isoformat(timespec="seconds")}
            for azimuth, elevation, time in zip(
                sun.azimuth_deg.tolist(), sun.elevation_deg.tolist(), sun.times, strict=True
            )
        ),
    )


def _interpolate(
    kind: Literal["point", "directional"], keys: Sequence[PointKey | DirectionalKey], n_lights: int
) -> LightPath:
    """Interpolate the keys of a point or directional source."""
    frames = [key.frame for key in keys]
    places = [key.direction if isinstance(key, DirectionalKey) else key.position for key in keys]
    powers = [key.irradiance if isinstance(key, DirectionalKey) else key.intensity or (1.0,) * 3 for key in keys]
    vector = (interpolate_keys if kind == "point" else interpolate_directions)(frames, places, n_lights)
    colors = [key.color if key.color is not None else (1.0, 1.0, 1.0) for key in keys]
    intensity = interpolate_keys(frames, powers, n_lights) * interpolate_keys(frames, colors, n_lights)
    sizes = [key.angle if isinstance(key, DirectionalKey) else key.radius for key in keys]
    size = interpolate_keys(frames, [[size or 0.0] for size in sizes], n_lights)[:, 0] if any(sizes) else None
    return LightPath(kind=kind, vector=vector, intensity=intensity, size=size)
