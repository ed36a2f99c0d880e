"""Sources of a job -> position and strength at every light position."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import Any, Literal, NoReturn

import numpy as np

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.base.colour import LUMINANCE
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.units import LUMENS_PER_WATT
from framearray_cli.job.job import Job
from framearray_cli.job.keys import PlacedSource, ShownSource
from framearray_cli.job.rowfile import RowFileError
from framearray_cli.job.sources import (
    AnyPanel,
    DaySource,
    DirectionalKey,
    DomeSource,
    EnvironmentSource,
    LightSource,
    MeshSource,
    PanelSource,
    PlacedLamp,
    PointKey,
    PointSource,
    SkySource,
    SpotSource,
    SunSource,
)
from framearray_cli.job.values import SHORTEST

from .curves import PARALLEL, interpolate_directions, interpolate_keys, unit
from .lightpath import Cone, Emitter, LightPath, Panel, carry_across
from .panorama import REST, SUNS, Environment, Panorama, norths, read_panorama
from .profiles import Profile, read_web
from .sky import EFFICACY, NUMBERS, SkyModel, clear_sun, orbit
from .sky import ROWS as SKY_ROWS
from .sun import NEVER, SunPath, daylight, directions_to_sun, level_north, sun_at
from .weather import read_weather

WHITE = (1.0, 1.0, 1.0)


def _in_units(path: LightPath, source: LightSource) -> LightPath:
    """Turn the strengths of a source from the units of its job into W/sr or W/m2.

    Lumens count all light that the lamp sends out: its intensity in candela is their number over the solid
    angle that would send out as much if it were lit evenly. What a file says of a lamp is in W/sr already.
    """
    own = isinstance(source, PointSource | SpotSource) and source.keys[0].intensity is None
    own |= isinstance(source, SkySource) or (isinstance(source, SunSource) and source.irradiance is None)
    units = getattr(source, "units", None)
    if own or units in (None, "W/sr", "W/m2", "W", "W/(m2 sr)"):
        return path
    by_angle = units == "lm" and path.panel is None  # a panel's are of its power, not of an intensity
    solid_angles = np.ones(len(path.vector))  # the integral of intensity over all directions, over its largest, sr
    if by_angle and path.profile is not None:
        solid_angles *= path.profile.web.flux
    elif by_angle and path.cone is not None:
        inner, outer = np.cos(np.radians(path.cone.angles_deg.T))
        solid_angles = 2 * np.pi * (1 - inner + (inner - outer) / 3)  # (a c + b)^2 between the cones
    elif by_angle:
        solid_angles *= 4 * np.pi
    return replace(path, intensity=path.intensity * (1 / LUMENS_PER_WATT / solid_angles)[:, None])


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


ROWS = (30, 30, 24, 24, 18, 12, 6)  # patches of Tregenza's sky around, from the horizon up to the one at the zenith


def sky_patches(parts: int) -> tuple[Float64, Float64, Float64]:
    """Divide the sky into patches of about the same solid angle [Tregenza87], row by row, from north over east.

    Args:
        parts: number of parts along each side of a patch; the one at the zenith stays whole, as [Bourgeois08] has it.

    Returns:
        (n,) azimuth, degrees; elevation, radians; angular diameter of a disc of the same solid angle, degrees.
    """
    counts, step = np.repeat(ROWS, parts) * parts, np.pi / 2 / (len(ROWS) * parts + 0.5)
    low = np.arange(len(counts)) * step
    share = np.append(np.repeat((np.sin(low + step) - np.sin(low)) / counts, counts), 1 - np.cos(step / 2))
    around = np.concatenate([*(np.arange(n) * (360 / n) for n in counts), [0.0]])
    elevation = np.append(np.repeat(low + step / 2, counts), np.pi / 2)
    return around, elevation, 2 * np.degrees(np.arccos(1 - share))


def up_axis(job: Job) -> Float64:
    """(3,) up axis of the scene of a job."""
    return np.array([0.0, 0.0, 1.0] if job.scene.up == "z" else [0.0, 1.0, 0.0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Placing:
    """Context in which a source is placed.

    Attributes:
        name: of the source, for messages.
        n: number of light positions.
        world_from_camera: (3, 3) axes of the first camera, where a source needs them.
    """

    job: Job
    name: str
    n: int
    world_from_camera: Float64 | None

    @property
    def up_dir(self) -> Float64:
        """(3,) up axis of the scene."""
        return up_axis(self.job)

    def refuse(self, problem: str, error: Exception | None = None) -> NoReturn:
        """Raise a JobError of a problem that follows the name of the source."""
        raise JobError(self.job.file or self.job.name, [self.name + problem]) from error

    def turned(self, vectors: Float64, source: PlacedSource[Any]) -> Float64:
        """Turn vectors of a source, (n, 3), into the axes of the scene file."""
        in_camera = source.space == "camera" and self.world_from_camera is not None
        return vectors @ self.world_from_camera.T if in_camera and self.world_from_camera is not None else vectors

    def moved(self, path: LightPath, source: PlacedSource[Any]) -> LightPath:
        """Turn, scale and move the positions of a source into the coordinates of the scene file."""
        vector = self.turned(path.vector, source)
        if isinstance(source, PlacedLamp):
            center = source.center or (self.job.camera.keys[0].target if source.space == "camera" else None)
            vector = vector * source.scale if source.scale else vector
            vector = vector + np.array(center) if center else vector
        return replace(path, vector=vector)

    def axes(self, source: SpotSource | AnyPanel, position: Float64, what: str) -> Float64:
        """(n, 3) unit directions in which a source at n positions shines, by its directions or targets.

        Raises:
            JobError: the source meets its target between two keys.
        """
        frames = [key.frame for key in source.keys]
        if source.keys[0].target is None:
            directions = [key.direction for key in source.keys if key.direction]
            return self.turned(interpolate_directions(frames, directions, self.n), source)
        targets = interpolate_keys(frames, [key.target for key in source.keys if key.target], self.n)
        if (meeting := np.flatnonzero(np.linalg.norm(targets - position, axis=1) < SHORTEST)).size:
            self.refuse(f": expected a target away from {what}, got the same point at frame {meeting[0]}; move a key")
        return self.turned(unit(targets - position), source)

    def across(self, source: PointSource | SpotSource | AnyPanel, axis: Float64, what: str) -> Float64:
        """(n, 3) unit directions across the axis of a source: below the `up` of its keys, or carried along its path.

        Raises:
            JobError: an `up` points along the axis.
        """
        ups = [up for key in source.keys if (up := getattr(key, "up", None))]
        if ups:
            frames = [key.frame for key in source.keys]
            across = np.cross(self.turned(interpolate_directions(frames, ups, self.n), source), axis)
            length = np.linalg.norm(across, axis=1, keepdims=True)
            across = np.divide(across, length, out=np.zeros_like(across), where=length > PARALLEL)
        else:
            across = carry_across(axis, self.up_dir)
        if (flat := np.flatnonzero((across == 0).all(axis=1))).size:
            self.refuse(f": expected an `up` across the direction of {what}, got one along it at frame {flat[0]}")
        return across


def cut_suns(path: LightPath, i: int) -> tuple[LightPath, ...]:
    """Divide source i into its map without suns and these, so that each hit sends a ray to both; or return it as it is.

    Without that hits would draw the sky so rarely, and with so much weight, that it would be noise.
    """
    whole = path.environment
    if whole is None or whole.maps is not None or not whole.panorama.has_suns:
        return (path,)
    parts = [replace(whole, part=part) for part in (REST, SUNS)]
    rest, suns = (replace(path, environment=one, intensity=path.intensity * (one.flux / whole.flux)) for one in parts)
    return rest, replace(suns, part_of=i)


def place_source(job: Job, i: int, n: int, world_from_camera: Float64 | None) -> LightPath:
    """Compute position and intensity of source i at n light positions.

    Args:
        world_from_camera: (3, 3) axes of the first camera, where a source needs them.

    Raises:
        JobError: a sun that never shines, or whose north points up; a broken environment map or profile; a source that
            meets its target, or whose `up` points along its axis.
        MissingExtraError: it is a sun, and ephem is not installed.
    """
    source = job.light.sources[i]
    at = _Placing(job=job, name=f"light.sources[{i}]", n=n, world_from_camera=world_from_camera)
    path = _in_units(_place(source, at), source)
    return replace(path, visible=True) if isinstance(source, ShownSource) and source.visible else path


def _place(source: LightSource, at: _Placing) -> LightPath:
    match source:
        case SunSource():
            return _place_sun(source, at)
        case SkySource():
            return _place_sky(source, at)
        case DomeSource():
            return _place_dome(source, at)
        case SpotSource():
            return _place_spot(source, at)
        case EnvironmentSource():
            return _place_environment(source, at)
        case MeshSource():
            return _place_mesh(source, at.n)
        case PanelSource():
            return _place_panel(source, at)
        case _:
            path = at.moved(_interpolate(source.type, source.keys, at.n), source)
            if isinstance(source, PointSource) and source.ies:
                return _add_profile(path, source, np.tile(-at.up_dir, (at.n, 1)), at)
            return path


def _place_dome(source: DomeSource, at: _Placing) -> LightPath:
    """Compute points or directions of a dome; it stays at the last where there are more light positions."""
    size, rows = None, np.minimum(np.arange(at.n), source.count - 1)
    if source.parts:
        azimuth_deg, elevation, size_deg = sky_patches(source.parts)
        level = np.cos(elevation)[:, None] * norths(at.job.scene.up, azimuth_deg)
        to_light, size = (level + np.sin(elevation)[:, None] * at.up_dir)[rows], size_deg[rows]
    else:
        top = np.array(source.top or at.up_dir)
        to_light = dome_directions(source.count, top, whole=source.shape == "sphere")[rows]
    strength = source.irradiance if source.radius is None else source.intensity
    intensity = np.tile(np.array(strength) * np.array(source.color or 1.0), (at.n, 1))
    if source.radius is None:
        return LightPath(kind="directional", vector=-to_light, intensity=intensity, size=size)
    return LightPath(kind="point", vector=np.array(source.target) + source.radius * to_light, intensity=intensity)


def _place_spot(source: SpotSource, at: _Placing) -> LightPath:
    """Interpolate the keys of a spot; where they have targets, its axis follows the targets."""
    keys = source.keys
    path = _interpolate("point", keys, at.n)
    axis = at.axes(source, path.vector, "the spot")
    path = at.moved(path, source)
    if source.ies:
        return _add_profile(path, source, axis, at)
    angles = interpolate_keys([key.frame for key in keys], [(key.inner, key.outer) for key in keys], at.n)
    return replace(path, cone=Cone(axis=axis, angles_deg=angles))


def _add_profile(path: LightPath, source: PointSource | SpotSource, axis: Float64, at: _Placing) -> LightPath:
    """Give a lamp the profile of its file and, where its keys have no intensity, the file's.

    Args:
        axis: (n, 3) unit directions of vertical angle 0.
    """
    assert source.ies is not None
    try:
        web = read_web(source.ies)
    except RowFileError as error:
        at.refuse(f".ies: {source.ies.name}: {error.args[0]}", error)
    across = at.across(source, axis, "the lamp")
    zero = np.cross(axis, across) if source.keys[0].up is not None or web.sideways else across
    intensity = path.intensity
    if source.keys[0].intensity is None:
        intensity = intensity * web.candela / LUMENS_PER_WATT
    return replace(path, intensity=intensity, profile=Profile(file=source.ies.name, web=web, axis=axis, zero=zero))


def _place_panel(source: AnyPanel, at: _Placing) -> LightPath:
    keys, n = source.keys, at.n
    position, sides = _curve(keys, "position", n), _curve(keys, "sides", n)
    axis = at.axes(source, position, "the panel")
    across = at.across(source, axis, "the panel")
    panel = Panel(shape=source.type, axis=axis, across=across, sides=sides, two_sided=source.two_sided)
    if keys[0].power is not None:
        strength = _curve(keys, "power", n) / panel.flux
    else:
        strength = _curve(keys, "radiance", n) * panel.area[:, None]
    path = LightPath(kind="point", vector=position, intensity=strength * _curve(keys, "color", n), panel=panel)
    return at.moved(path, source)


def _place_mesh(source: MeshSource, n: int) -> LightPath:
    """Interpolate the strength of a material that shines; the scene says where it is."""
    own = source.has_radiance
    emitter = Emitter(material=source.material, two_sided=source.two_sided, flat=own, absolute=own)
    intensity = np.ones((n, 3))
    if source.keys:
        strengths = [key.radiance or key.intensity or WHITE for key in source.keys]
        intensity = interpolate_keys([key.frame for key in source.keys], strengths, n) * _curve(source.keys, "color", n)
    return LightPath(kind="mesh", vector=np.zeros((n, 3)), intensity=intensity, emitter=emitter)


def _place_environment(source: EnvironmentSource, at: _Placing) -> LightPath:
    """Read an environment map, and interpolate its keys."""
    try:
        panorama = read_panorama(source.file)
    except OutputError as error:
        at.refuse(f".file: {str(error).replace(str(source.file), source.file.name)}", error)
    rotations = [[key.rotation] for key in source.keys]
    rotation_deg = interpolate_keys([key.frame for key in source.keys], rotations, at.n)[:, 0]
    factor = _curve(source.keys, "intensity", at.n) * _curve(source.keys, "color", at.n)
    return LightPath(
        kind="directional",
        vector=-norths(at.job.scene.up, rotation_deg),
        intensity=factor * panorama.flux,
        environment=Environment(panorama=panorama, rotation_deg=rotation_deg, factor=factor, up=at.up_dir),
    )


def _sun_over(source: DaySource, at: _Placing) -> tuple[SunPath, Float64, Float64 | None]:
    """Find the sun of a source, (3,) north, and (2, n) direct and diffuse irradiance of its weather file."""
    up_dir, up = at.up_dir, at.job.scene.up
    if (north_dir := level_north(source.north, up_dir)) is None:
        at.refuse(f'.north: expected a direction that is not up, got the up axis of the scene, "{up}"')
    place = (source.latitude, source.longitude)
    sun = sun_at(source.moments(at.n), *place)
    if not sun.is_up.any():
        hours = daylight(source.dates[0], source.timezone, place)
        when = "it does not rise on that day" if hours == NEVER else f"on {source.dates[0]} it is up from {hours}"
        at.refuse(f": the sun is below the horizon from {source.start} to {source.stop}; {when}")
    if source.weather is None:
        return sun, north_dir, None
    try:
        weather = read_weather(source.weather)
    except RowFileError as error:
        at.refuse(f".weather: {source.weather.name}: {error.args[0]}", error)
    return sun, north_dir, sun.is_up * weather.at(sun.times) / LUMENS_PER_WATT


def _sun_notes(sun: SunPath) -> tuple[dict[str, Any], ...]:
    """Return the tables of the manifest with where the sun stands, and when."""
    rows = zip(sun.azimuth_deg.tolist(), sun.elevation_deg.tolist(), sun.times, strict=True)
    return tuple(
        {"azimuth": round(azimuth, 4), "elevation": round(elevation, 4), "time": time.isoformat(timespec="seconds")}
        for azimuth, elevation, time in rows
    )


def _place_sun(source: SunSource, at: _Placing) -> LightPath:
    sun, north_dir, light = _sun_over(source, at)
    strength = clear_sun(np.radians(sun.elevation_deg)) if light is None else light[0]
    if source.irradiance is not None:
        intensity = sun.is_up[:, None] * np.array(source.irradiance)
    else:
        intensity = strength[:, None] * np.ones(3)
    return LightPath(
        kind="directional",
        vector=-directions_to_sun(sun, at.up_dir, north_dir),
        intensity=intensity * np.array(source.color or 1.0),
        size=np.full(at.n, source.angle) if source.angle else None,
        notes=_sun_notes(sun),
    )


def _place_sky(source: SkySource, at: _Placing) -> LightPath:
    """Compute the map of a sky at every light position, and the mean map from which hits draw directions."""
    sun, north_dir, light = _sun_over(source, at)
    height, lux = np.radians(sun.elevation_deg), source.units == "lux"
    watt = 1 / LUMENS_PER_WATT if lux else 1.0
    overcast = source.model == "overcast" or (isinstance(source.model, int) and source.model < 7)
    if light is not None:
        direct = light[0]
    elif source.direct is not None:
        direct = np.full(at.n, source.direct * watt)
    else:
        direct = clear_sun(height) * (not overcast)
    maps, level = np.zeros((at.n, SKY_ROWS, 2 * SKY_ROWS, 3), np.float32), np.zeros((at.n, 3))
    for l in np.flatnonzero(sun.is_up).tolist():
        diffuse = None if light is None else np.full(3, light[1, l])
        if source.irradiance is not None:
            diffuse = np.array(source.irradiance) * watt
        model = SkyModel(
            name=NUMBERS.get(str(source.model), source.model),
            height=float(height[l]),
            diffuse=diffuse,
            direct=float(direct[l]),
            scaled=light is None and source.direct is None,
            solar=(LUMENS_PER_WATT / EFFICACY if light is not None or lux else 1.0)
            / orbit(sun.times[l].timetuple().tm_yday),
            turbidity=source.turbidity,
            albedo=source.albedo,
        )
        maps[l], level[l] = model.map()
    tint = np.array(source.color or 1.0)
    maps, level = maps * tint.astype(np.float32), level * tint
    if not maps.any():
        at.refuse(": the sky is dark at all light positions; expected some light in `weather` or `irradiance`")
    panorama = Panorama(file="", pixels=_proposal(maps))
    factor = sun.is_up[:, None] * np.ones(3)
    flat = replace(sun, elevation_deg=np.zeros(at.n))
    return LightPath(
        kind="directional",
        vector=-directions_to_sun(flat, at.up_dir, north_dir),
        intensity=factor * panorama.flux,
        environment=Environment(
            panorama=panorama, rotation_deg=sun.azimuth_deg, factor=factor, up=at.up_dir, maps=maps, level=level
        ),
        notes=_sun_notes(sun),
    )


def _proposal(maps: Float32) -> Float32:
    """Grey mean of maps, each with the same light, (h, 2 h, 3); nowhere black where one of them is not."""
    bright = maps @ LUMINANCE
    total = bright.sum(axis=(1, 2), keepdims=True)
    mean = np.divide(bright, total, out=np.zeros_like(bright), where=total > 0).mean(axis=0)
    return np.repeat(mean[..., None], 3, axis=-1).astype(np.float32)


def _interpolate(
    kind: Literal["point", "directional"], keys: Sequence[PointKey | DirectionalKey], n_lights: int
) -> LightPath:
    frames = [key.frame for key in keys]
    places = [key.direction if isinstance(key, DirectionalKey) else key.position for key in keys]
    powers = [key.irradiance if isinstance(key, DirectionalKey) else key.intensity or WHITE for key in keys]
    vector = (interpolate_keys if kind == "point" else interpolate_directions)(frames, places, n_lights)
    intensity = interpolate_keys(frames, powers, n_lights) * _curve(keys, "color", n_lights)
    sizes = [key.angle if isinstance(key, DirectionalKey) else key.radius for key in keys]
    size = interpolate_keys(frames, [[size or 0.0] for size in sizes], n_lights)[:, 0] if any(sizes) else None
    return LightPath(kind=kind, vector=vector, intensity=intensity, size=size)


def _curve(keys: Sequence[Any], name: str, n: int) -> Float64:
    """Interpolate a value of keys, (n, k); keys without have 1, 1, 1."""
    return interpolate_keys([key.frame for key in keys], [getattr(key, name) or WHITE for key in keys], n)
