"""Cameras, lights and environment of a scene file -> paths of a job, with a key per frame of what moves.

The panorama of an environment is saved next to the job file.
"""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import JobError, SceneError
from framearray_cli.base.files import require_new, write_bytes
from framearray_cli.base.lens import ORTHOGRAPHIC
from framearray_cli.base.openimage import write_environment
from framearray_cli.base.units import counted
from framearray_cli.job.sources import NARROWEST
from framearray_cli.scene.files import Stage, StageCamera, StageLight, read_stage

from .draft import DIGITS, FPS, NotedTable, Start, round_vector

INTENSITY_DIGITS = 4  # significant digits of the intensity


@dataclass(frozen=True, slots=True, kw_only=True)
class PanoramaFiles:
    """Files of a panorama.

    Attributes:
        draft: where it lies while the job is planned; `final`: next to the job file.
        force: replace another file there.
    """

    draft: Path
    final: Path
    force: bool


@contextmanager
def maps_for(scene: Path, job_file: Path, *, force: bool) -> Iterator[PanoramaFiles]:
    """Yield where the panorama of a scene is saved; the draft goes at the end."""
    name = f"{scene.stem}-environment.exr"
    with tempfile.TemporaryDirectory(prefix="framearray-") as folder:
        yield PanoramaFiles(draft=Path(folder) / name, final=job_file.parent / name, force=force)


def environment_light(stage: Stage, maps: PanoramaFiles | None) -> tuple[tuple[NotedTable, ...], tuple[str, ...]]:
    """Save the panorama of the environment of a file, if it has one; also return a note if it is left out.

    Raises:
        OutputError: another file has its name already, or it cannot be written.
    """
    found = stage.environment
    if found is None:
        return (), ()
    if maps is None:
        left = "is left out: no file can lie next to a job on standard output; give --output a name"
        return (), (f"the environment of the file {left}",)
    write_environment(maps.draft, found.pixels)
    if not _is_there(maps):
        require_new(maps.final, force=maps.force)
    height, width, _ = found.pixels.shape
    about = f'the environment "{found.name}" of the file, as a panorama of {width} x {height} pixels'
    intensity = float(f"{found.intensity:.{INTENSITY_DIGITS}g}")
    keys = [{"frame": 0, "rotation": 0, "intensity": intensity}]
    table = {"type": "environment", "file": maps.draft, "keys": keys}
    return (NotedTable(table=table, about=(about,), name=found.name),), ()


def planned_panorama(scene: Path, job_file: Path, *, force: bool) -> Path | None:
    """File that the panorama of a scene would be written to; None without one, or if that very file exists.

    Raises:
        SceneError: the scene cannot be read.
        OutputError: another file has its name already.
    """
    with maps_for(scene, job_file, force=force) as maps:
        environment_light(read_stage(scene), maps)
        return maps.final if maps.draft.exists() and not _is_there(maps) else None


def install_environment(start: Start, maps: PanoramaFiles) -> Start:
    """Save the panorama of a job next to its file, and name it there.

    Raises:
        OutputError: it cannot be written.
    """
    drafts = [source.table.get("file") for source in start.sources]
    if maps.draft not in drafts:
        return start
    if not _is_there(maps):
        write_bytes(maps.final, maps.draft.read_bytes())
    sources = (
        replace(source, table=source.table | {"file": maps.final}) if file == maps.draft else source
        for source, file in zip(start.sources, drafts, strict=True)
    )
    start = replace(start, sources=tuple(sources))
    return start.noted(f"Its environment is saved next to the job, as {maps.final.name}.")


def _is_there(maps: PanoramaFiles) -> bool:
    """True if the very panorama lies there already, from an earlier job of the same scene."""
    try:
        return maps.final.is_file() and maps.final.read_bytes() == maps.draft.read_bytes()
    except OSError:
        return False


HEIGHT = 240  # pixels of a first picture
ASPECTS = (0.25, 4.0)  # width over height; values beyond are mistakes of the file
MOST_FRAMES = 1000  # of a camera: forty seconds; longer paths are sampled more coarsely
# Units of strengths where they are not candela.
UNITS = {("KHR_lights_punctual", "directional"): "lx", ("UsdLux", "directional"): "lx"}
UNITS |= {("UsdLux", kind): "nits" for kind in ("rect", "disc")}
STRENGTHS = {"directional": "irradiance", "rect": "radiance", "disc": "radiance"}  # of points and spots: intensity
MOST_LIGHTS = 48  # positions of lights, as in [FA]; each gives a picture per frame of the camera


def choose_camera(stage: Stage, name: str | None, file: object) -> StageCamera | None:
    """Choose the camera of that name, or the first, a perspective if there is one; None if the file has none.

    Raises:
        JobError: no camera has that name.
    """
    if name is None:
        perspectives = [camera for camera in stage.cameras if not camera.lens.height > 0]
        return next(iter([*perspectives, *stage.cameras]), None)
    for camera in stage.cameras:
        if camera.name == name:
            return camera
    known = ", ".join(f'"{camera.name}"' for camera in stage.cameras) or "no camera"
    raise JobError(str(file), [f'--camera: expected a camera of the file, got "{name}"; it has {known}'])


def frame_times(span: tuple[float, float] | None, wanted: int | None, most: int, fps: float = FPS) -> list[float]:
    """Times of the frames of a path, seconds: `wanted` ones over its span, or every frame of it, at most `most`."""
    if span is None:
        return [0.0] * (wanted or 1)
    n = wanted or min(round((span[1] - span[0]) * fps) + 1, most)
    return [float(time) for time in np.linspace(*span, n)]


def convert_camera(
    stage: Stage, camera: StageCamera, wanted: int | None, depth: float, resolution: tuple[int, int] | None = None
) -> NotedTable:
    """Convert a camera of the file to `[camera]`.

    Args:
        wanted: number of frames; None: as its animation has.
        resolution: of the pictures; None: as wide as the camera's aspect asks for.
        depth: distance from the eye to its target, scene units.

    Raises:
        SceneError: a camera whose node has a scale of 0 or is not finite.
    """
    span = stage.span([camera.node])
    times = frame_times(span, wanted, MOST_FRAMES, stage.fps or FPS)
    matrices = stage.world_from(camera.node, times)
    look, up = _normalize(-matrices[:, :3, 2], camera.name), _normalize(matrices[:, :3, 1], camera.name)
    low, high = ASPECTS
    aspect = min(max(camera.aspect or 4 / 3, low), high)
    size = resolution or (max(2 * round(HEIGHT * aspect / 2), 2), HEIGHT)
    same, own = _lens_keys(camera, times, size)
    keys = [
        {
            "frame": f,
            "eye": list(round_vector(eye)),
            "target": list(round_vector(eye + direction * depth)),
            "up": list(round_vector(above)),
            **lens,
        }
        for f, (eye, direction, above, lens) in enumerate(zip(matrices[:, :3, 3], look, up, own, strict=True))
    ]
    moves = (matrices != matrices[0]).any() or any(own)
    about = [f'the camera "{camera.name}" of the file']
    if span:
        about.append(f"animated from {span[0]:g} to {span[1]:g} s; a key for each of {counted(len(times), 'frame')}")
    others = [other.name for other in stage.cameras if other is not camera]
    about += [f'the file also has the camera "{name}": --camera "{name}"' for name in others[:20]]
    table = {"resolution": list(size), **same, "frames": len(times), "keys": keys if moves else keys[:1]}
    return NotedTable(table=table, about=tuple(about))


def _lens_keys(
    camera: StageCamera, times: list[float], resolution: tuple[int, int]
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Keys of the lens for all frames, and changing keys of each frame."""
    lenses = camera.lenses(times) if camera.lenses else [camera.lens] * len(times)
    longer = max(resolution) / resolution[1]  # side of the picture over its height
    rows: list[dict[str, Any]] = []
    for lens in lenses:
        height = {"height": float(f"{lens.height:.{DIGITS}g}")} if lens.height > 0 else {}
        shift = [round(share / longer, DIGITS) + 0.0 for share in lens.shift]
        rows.append({**(height or {"fov": round(lens.fov_deg, 4)}), "shift": shift})
    same = {key: value for key, value in rows[0].items() if all(row[key] == value for row in rows)}
    own = [{key: value for key, value in row.items() if key not in same} for row in rows]
    same = {key: value for key, value in same.items() if key != "shift" or any(value)}
    return ({"type": ORTHOGRAPHIC} if camera.lens.height > 0 else {}) | same, own


def convert_lights(stage: Stage, wanted: int | None) -> tuple[tuple[NotedTable, ...], int]:
    """Convert the lights of the file that shine, at the file's own strengths; also return the number of positions.

    A position that repeats an earlier one is left out, so lights that stand still have one.
    """
    shining = [light for light in stage.lights if light.at is not None or max(light.intensity) > 0]
    span = stage.span([light.node for light in shining])
    times = frame_times(span, wanted, MOST_LIGHTS, stage.fps or FPS)
    looks = [light.at(times) if light.at is not None else [light] * len(times) for light in shining]
    looks = [look for look in looks if any(max(light.intensity) > 0 for light in look)]
    paths = [_light_vectors(stage, look[0], times) for look in looks]
    changes = [np.array([[*light.intensity, *_shape(light).values()] for light in look]) for look in looks]
    rows = np.concatenate([path.round(DIGITS) for path in paths] + changes, axis=1) if paths else np.zeros((1, 0))
    kept = np.sort(np.unique(rows, axis=0, return_index=True)[1])
    sources = [_convert_light([look[k] for k in kept], path[kept]) for look, path in zip(looks, paths, strict=True)]
    return tuple(sources), len(kept)


def _light_vectors(stage: Stage, light: StageLight, times: list[float]) -> Float64:
    """Vectors of a light, (n, 3 k): position or direction, both for a place and a direction, then across for a turn."""
    matrices = stage.world_from(light.node, times)
    place = matrices[:, :3, 3]
    if light.kind != "directional" and not np.isfinite(place).all():
        raise SceneError(f'the light "{light.name}" is nowhere: its node has no finite place')
    if light.kind == "point":
        return place
    direction = _normalize(-matrices[:, :3, 2], light.name)
    turn = 0 if light.profile else 1  # x has horizontal angle 0, and y is the height of a rectangle
    across = [_normalize(matrices[:, :3, turn], light.name)] if light.profile or light.kind == "rect" else []
    return direction if light.kind == "directional" else np.concatenate([place, direction, *across], axis=1)


def _shape(light: StageLight) -> dict[str, float]:
    """Numbers of a key: the cone of a spot, and the size of a light; 0 where it has none."""
    low, high = light.cone_deg or (0.0, 0.0)
    cone = {"inner": round(min(low, high), 4), "outer": round(max(low, high, NARROWEST), 4)} if light.cone_deg else {}
    size = {"radius": light.radius, "angle": light.angle_deg, "width": light.size[0], "height": light.size[1]}
    return cone | {key: float(f"{value:.{DIGITS}g}") for key, value in size.items()}


def _convert_light(look: list[StageLight], vectors: Float64) -> NotedTable:
    """Convert a light, given at n times, and its vectors there."""
    light = max(look, key=lambda light: max(light.intensity))
    moves = bool((vectors != vectors[0]).any())
    changes = any((other.intensity, _shape(other)) != (look[0].intensity, _shape(look[0])) for other in look)
    n = len(vectors) if moves or changes else 1
    strength = f"{max(light.intensity):.4g} {UNITS.get((light.schema, light.kind), 'cd')} by {light.schema}"
    lamp = "lamp" if light.profile else f"{light.kind} light"
    strength = f"at most {strength}" if changes else strength
    used = {key for other in look for key, value in _shape(other).items() if value > 0 or key == "inner"}
    place = "direction" if light.kind == "directional" else "position"
    keys = []
    for frame, (vector, other) in enumerate(zip(vectors[:n], look, strict=False)):
        key: dict[str, Any] = {"frame": frame, place: list(round_vector(vector[:3]))}
        key[STRENGTHS.get(light.kind, "intensity")] = list(other.intensity)
        if light.kind in ("spot", "rect", "disc"):
            key["direction"] = list(round_vector(vector[3:6]))
        if light.profile or light.kind == "rect":
            key["up"] = list(round_vector(vector[6:]))
        keys.append(key | {name: value for name, value in _shape(other).items() if name in used})
    return NotedTable(
        table={"type": light.kind, **({"ies": light.profile} if light.profile else {}), "keys": keys},
        about=(f'the {lamp} "{light.name}" of the file, there {strength}',),
        name=light.name,
    )


def _normalize(vectors: Float64, name: str) -> Float64:
    """Scale directions to length 1."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not (np.isfinite(vectors).all() and (length > 0).all()):
        raise SceneError(f'"{name}" looks nowhere: its node, or one above it, has a scale of 0')
    return np.asarray(vectors / length)
