"""The jobs of a furnace: the inside of a sphere, and its direct light at every pixel."""

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from framearray_cli.scene.paths.paths import eyes, lights
from support import ROOT
from support import closed_forms as forms

JOBS = ROOT / "jobs"
FINE = 8  # places along each edge of a pixel that its expected direct light is averaged over


def furnace_job(reflectivity: float, out: Path, seed: int = 0, method: str = "eye") -> Job:
    """A job of jobs/ with another seed and method, and files that hold float."""
    job = read_job(JOBS / f"furnace-{round(100 * reflectivity)}.toml")
    output = {"directory": out, "half": "never", "compression": "none", "layers": False}
    tables = {
        "seed": seed,
        "ambient": job.ambient.model_copy(update={"method": method}),
        "output": job.output.model_copy(update=output),
    }
    return job.model_copy(update=tables)


@cache
def expected_direct(reflectivity: float) -> NDArray[np.float64]:
    """Mean direct radiance of every pixel of the furnace job, (n_c, n_l, h, w): eye rays met with the unit sphere."""
    job = read_job(JOBS / f"furnace-{round(100 * reflectivity)}.toml")
    width, height = job.camera.resolution
    focal = 0.5 * height / np.tan(np.radians(job.camera.fov) / 2)
    x = (np.arange(width * FINE) + 0.5) / FINE - 0.5 * width
    y = 0.5 * height - (np.arange(height * FINE) + 0.5) / FINE
    image = np.stack([*np.meshgrid(x / focal, y / focal), np.full((height * FINE, width * FINE), -1.0)], axis=-1)
    frames = []
    for matrix in eyes(job).world_from_camera:
        way = image.reshape(-1, 3) @ matrix[:3, :3].T
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        eye = matrix[:3, 3]
        along = way @ eye
        points = eye + (np.sqrt(along**2 - eye @ eye + 1) - along)[:, None] * way
        per_light = [forms.point_irradiance(points, -points, place, 1.0) for place in lights(job).sources[0].vector]
        fine = np.array(per_light).reshape(-1, height, FINE, width, FINE)
        frames.append(reflectivity / np.pi * fine.mean(axis=(2, 4)))
    return np.array(frames)
