"""The lens of the camera at every frame of a job."""

from typing import Any

from framearray_cli.base.lens import Lens
from framearray_cli.job.camera import KEYS_OF_TYPE
from framearray_cli.job.job import Job

from .curves import interpolate_keys


def lenses(job: Job) -> tuple[Lens, ...]:
    """Return the lens of each frame: values of the keys, between them interpolated, else those of all frames."""
    camera = job.camera
    common: dict[str, Any] = {"type": camera.type}
    moving: dict[str, Any] = {}
    for name in KEYS_OF_TYPE[camera.type]:
        values = [getattr(key, name) for key in camera.keys]
        if values[0] is not None:
            rows = [value if isinstance(value, tuple) else (value,) for value in values]
            found = interpolate_keys([key.frame for key in camera.keys], rows, camera.frames).tolist()
            moving[name] = [tuple(row) if name == "shift" else row[0] for row in found]
        elif (value := getattr(camera, name)) is not None:
            common[name] = value
    if not moving:
        return (Lens(**common),) * camera.frames
    return tuple(Lens(**common, **{name: rows[c] for name, rows in moving.items()}) for c in range(camera.frames))
