"""Environments of a job -> their maps, turns and strengths at every light position."""

from dataclasses import replace

import numpy as np

from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.job.job import Job
from framearray_cli.job.sources import EnvironmentSource

from .curves import interpolate_keys
from .lightpath import LightPath
from .panorama import REST, SUNS, Environment, norths, read_panorama


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
