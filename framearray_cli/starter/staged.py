"""Cameras and lights of a scene file -> paths of a job, with a key per frame of what moves."""

from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import JobError, SceneError
from framearray_cli.base.lens import ORTHOGRAPHIC
from framearray_cli.base.units import counted
from framearray_cli.job.sources import NARROWEST
from framearray_cli.scene.files import Stage, StageCamera, StageLens, StageLight

from .draft import DIGITS, FPS, NotedTable, round_vector

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
    keys = [
        {
            "frame": f,
            "eye": list(round_vector(eye)),
            "target": list(round_vector(eye + direction * depth)),
            "up": list(round_vector(above)),
        }
        for f, (eye, direction, above) in enumerate(zip(matrices[:, :3, 3], look, up, strict=True))
    ]
    moves = bool((matrices != matrices[0]).any())
    about = [f'the camera "{camera.name}" of the file']
    if span:
        about.append(f"animated from {span[0]:g} to {span[1]:g} s; a key for each of {counted(len(times), 'frame')}")
    others = [other.name for other in stage.cameras if other is not camera]
    about += [f'the file also has the camera "{name}": --camera "{name}"' for name in others[:20]]
    table = {
        "resolution": list(size),
        **_lens_keys(camera.lens, size),
        "frames": len(times),
        "keys": keys if moves else keys[:1],
    }
    return NotedTable(table=table, about=tuple(about))


def _lens_keys(lens: StageLens, resolution: tuple[int, int]) -> dict[str, Any]:
    """Keys of the lens for all frames."""
    longer = max(resolution) / resolution[1]  # side of the picture over its height
    shift = [round(share / longer, DIGITS) + 0.0 for share in lens.shift]
    shifted = {"shift": shift} if any(shift) else {}
    if lens.height > 0:
        return {"type": ORTHOGRAPHIC, "height": float(f"{lens.height:.{DIGITS}g}"), **shifted}
    return {"fov": round(lens.fov_deg, 4), **shifted}


def convert_lights(stage: Stage, wanted: int | None) -> tuple[tuple[NotedTable, ...], int]:
    """Convert the lights of the file that shine, at the file's own strengths; also return the number of positions.

    A position that repeats an earlier one is left out, so lights that stand still have one.
    """
    shining = [light for light in stage.lights if max(light.intensity) > 0]
    span = stage.span([light.node for light in shining])
    times = frame_times(span, wanted, MOST_LIGHTS, stage.fps or FPS)
    paths = [_light_vectors(stage, light, times) for light in shining]
    rows = np.concatenate([path.round(DIGITS) for path in paths], axis=1) if paths else np.zeros((1, 0))
    kept = np.sort(np.unique(rows, axis=0, return_index=True)[1])
    sources = [_convert_light(light, path[kept]) for light, path in zip(shining, paths, strict=True)]
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
    across = [_normalize(matrices[:, :3, 1], light.name)] if light.kind == "rect" else []  # of its height
    return direction if light.kind == "directional" else np.concatenate([place, direction, *across], axis=1)


def _shape(light: StageLight) -> dict[str, float]:
    """Numbers of a key: the cone of a spot, and the size of a light; 0 where it has none."""
    low, high = light.cone_deg or (0.0, 0.0)
    cone = {"inner": round(min(low, high), 4), "outer": round(max(low, high, NARROWEST), 4)} if light.cone_deg else {}
    size = {"radius": light.radius, "angle": light.angle_deg, "width": light.size[0], "height": light.size[1]}
    return cone | {key: float(f"{value:.{DIGITS}g}") for key, value in size.items()}


def _convert_light(light: StageLight, vectors: Float64) -> NotedTable:
    """Convert a light, given its vectors at n times."""
    moves = bool((vectors != vectors[0]).any())
    strength = f"{max(light.intensity):.4g} {UNITS.get((light.schema, light.kind), 'cd')} by {light.schema}"
    shape = {name: value for name, value in _shape(light).items() if value > 0 or name == "inner"}
    place = "direction" if light.kind == "directional" else "position"
    keys = []
    for frame, vector in enumerate(vectors if moves else vectors[:1]):
        key: dict[str, Any] = {"frame": frame, place: list(round_vector(vector[:3]))}
        key[STRENGTHS.get(light.kind, "intensity")] = list(light.intensity)
        if light.kind in ("spot", "rect", "disc"):
            key["direction"] = list(round_vector(vector[3:6]))
        if light.kind == "rect":
            key["up"] = list(round_vector(vector[6:]))
        keys.append(key | shape)
    return NotedTable(
        table={"type": light.kind, "keys": keys},
        about=(f'the {light.kind} light "{light.name}" of the file, there {strength}',),
        name=light.name,
    )


def _normalize(vectors: Float64, name: str) -> Float64:
    """Scale directions to length 1."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not (np.isfinite(vectors).all() and (length > 0).all()):
        raise SceneError(f'"{name}" looks nowhere: its node, or one above it, has a scale of 0')
    return np.asarray(vectors / length)
